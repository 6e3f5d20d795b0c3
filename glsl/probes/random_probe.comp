#version 460
#extension GL_GOOGLE_include_directive : require
// Draws random numbers, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "common/random.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

struct Asked {
    uint kind;      // CAMERA_PATH or LIGHT_SAMPLE, of a pixel; PHOTON_PATH; COVERAGE_SAMPLE
    uint path;      // pixel, photon path or slot
    uint iteration;
    uint number;    // of the path; photons: of the block
    uint paths;     // of a pixel, points of a disc; photons: first of the sequence
    uint seed;
    uint dimension; // quadruple
    uint sampled;   // of a disc: number of the sample
};

layout(std430) readonly buffer ProbeFrom { Asked asked[]; };
layout(std430) writeonly buffer ProbeTo { vec4 numbers[]; }; // a quadruple, then x: number_of(thing 3, 5) after it

void main() {
    uint i = invocation_index();
    if (i >= push.count) {
        return;
    }
    Asked a = asked[i];
    Random random;
    if (a.kind == PHOTON_PATH) {
        random = random_of_photon(a.path, a.iteration, a.number, a.paths, a.seed);
    } else if (a.kind == COVERAGE_SAMPLE) {
        random = sample_of(random_of_disc(a.path, a.iteration, a.paths, a.seed), a.sampled, a.paths);
    } else {
        random = random_of_pixel(a.kind, a.path, CameraTurn(a.iteration, a.number, a.paths), a.seed);
    }
    vec4 quadruple = vec4(0.0);
    for (uint dimension = 0u; dimension <= a.dimension; dimension++) {
        quadruple = next4(random);
    }
    numbers[2u * i] = quadruple;
    numbers[2u * i + 1u] = vec4(number_of(random, uvec2(3u, 5u)), 0.0, 0.0, 0.0);
}
