// A counter-based generator: the numbers of a path are a pure function of (path, iteration, dimension, seed), so any
// invocation can draw any of them, and two runs draw the same.

#include "layout.glsl"

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

// Where numbers come from, see config::Sampler.
layout(constant_id = 5) const uint SAMPLER = 0u;

#include "common/sobol.glsl"

// The state of a path's random numbers.
struct Random {
    uint path;      // pixel, or photon path within its iteration
    uint iteration;
    uint seed;      // the user's seed, mixed with the kind of path
    uint dimension; // how many quadruples have been drawn
    uint sequence;  // of low discrepancy: a pixel's own, or one of all photons
    uint block;     // of iterations whose numbers are one sequence
    uint index;     // in that sequence
    uint state;     // of the congruential generator
};

Random random_for(uint kind, uint path, uint iteration, uint block, uint sequence, uint index, uint seed) {
    uint mixed = seed ^ kind;
    return Random(path, iteration, mixed, 0u, sequence, block, index, mixed + iteration * 0x9e3779b1u + path);
}

// The camera path of a pixel in an iteration.
struct CameraTurn {
    uint iteration;
    uint path;
    uint paths; // see config::RenderConfig::camera_paths
};

// For a pixel, or another index that has one path in each turn.
Random random_of_pixel(uint kind, uint pixel, CameraTurn turn, uint seed) {
    uint index = turn.iteration / SEQUENCES * turn.paths + turn.path;
    return random_for(kind, pixel, turn.iteration * turn.paths + turn.path, turn.iteration % SEQUENCES, pixel, index, seed);
}

// For a photon path of an iteration that begins at `first` in its sequence.
Random random_of_photon(uint path, uint iteration, uint block, uint first, uint seed) {
    return random_for(PHOTON_PATH, path, iteration, block, iteration % SEQUENCES, first + path, seed);
}

// For several points of a disc: they are one set; later sets continue one sequence.
Random random_of_disc(uint slot, uint iteration, uint points, uint seed) {
    uint block = points > 1u ? iteration : 0xffffffffu;
    return random_for(COVERAGE_SAMPLE, slot, iteration, block, slot, points > 1u ? 0u : iteration, seed);
}

// For one of several samples of the same kind in a path.
Random sample_of(Random random, uint number, uint samples) {
    Random result = random;
    result.index = random.index * samples + number;
    result.dimension = SAMPLER == SOBOL ? 0u : number;
    result.state += number * 0x85ebca6bu; // a separate stream
    return result;
}

// Uniform in [0, 1): the 24 bits that an f32 in that range can hold.
vec4 unit_floats(uvec4 bits) {
    return vec4(bits >> 8u) * (1.0 / 16777216.0);
}

// The paper's «classic congruential generator», with the constants of Press and others, «Numerical Recipes», 1992. Its
// neighbouring streams are correlated: only for comparison.
uint congruential(inout uint state) {
    state = state * 1664525u + 1013904223u;
    return state;
}

// A number for a thing at the path's current dimension: the same whenever it is drawn there.
float number_of(Random random, uvec2 thing) {
    return unit_floats(pcg4d(uvec4(random.path ^ 0x616c7068u, random.iteration + thing.y * 0x85ebca6bu,
                                   random.seed + thing.x * 0x9e3779b9u, random.dimension))).x;
}

// The next four numbers, uniform in [0, 1).
vec4 next4(inout Random random) {
    uvec4 bits;
    if (SAMPLER == SOBOL) {
        uvec4 seed = pcg4d(uvec4(random.sequence, random.block, ~random.seed, random.dimension));
        bits = sobol_point(random.index, seed);
    } else if (SAMPLER == INDEPENDENT) {
        bits = pcg4d(uvec4(random.path, random.iteration, random.seed, random.dimension));
    } else {
        bits.x = congruential(random.state);
        bits.y = congruential(random.state);
        bits.z = congruential(random.state);
        bits.w = congruential(random.state);
    }
    random.dimension += 1u;
    return unit_floats(bits);
}
