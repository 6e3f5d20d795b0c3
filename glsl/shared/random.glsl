// A counter-based generator: the numbers of a path are a pure function of (path, iteration, dimension, seed), so any
// invocation can draw any of them, and two runs draw the same.

// PCG 4D: Jarzynski and Olano, «Hash Functions for GPU Rendering», JCGT 9(3), 2020.
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// What a path draws its numbers from.
struct Random {
    uint path;      // pixel, or photon path within its iteration
    uint iteration;
    uint seed;      // the user's, mixed with the kind of path
    uint dimension; // how many quadruples have been drawn
};

const uint CAMERA_PATH = 0x63616d65u;
const uint PHOTON_PATH = 0x70686f74u;
const uint LIGHT_SAMPLE = 0x6c696768u;

Random random_for(uint kind, uint path, uint iteration, uint seed) {
    return Random(path, iteration, seed ^ kind, 0u);
}

// Uniform in [0, 1): the 24 bits that an f32 in that range can hold.
vec4 unit_floats(uvec4 bits) {
    return vec4(bits >> 8u) * (1.0 / 16777216.0);
}

// The next four numbers, uniform in [0, 1).
vec4 next4(inout Random random) {
    uvec4 bits = pcg4d(uvec4(random.path, random.iteration, random.seed, random.dimension));
    random.dimension += 1u;
    return unit_floats(bits);
}
