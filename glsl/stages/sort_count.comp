#version 460
#extension GL_GOOGLE_include_directive : require
// Radix sort, first stage of a pass: how often each digit occurs in each tile.

layout(local_size_x = 128) in;

#include "invocation.glsl"

layout(push_constant) uniform Push {
    uint shift;
    uint tiles;
} push;

#include "sort.glsl"

layout(std430) readonly buffer KeysIn { uint keys_in[]; };
layout(std430) writeonly buffer Histograms { uint histograms[]; }; // digit-major: [digit][tile]

shared uint counts[DIGITS];

void main() {
    uint me = gl_LocalInvocationID.x;
    // Room for more keys than there are costs little.
    if (workgroup_index() * TILE_KEYS >= sort_count) {
        if (me < DIGITS && workgroup_index() < push.tiles) {
            histograms[me * push.tiles + workgroup_index()] = 0u;
        }
        return;
    }
    if (me < DIGITS) {
        counts[me] = 0u;
    }
    barrier();
    for (uint i = 0u; i < KEYS_PER_THREAD; i++) {
        uint index = workgroup_index() * TILE_KEYS + i * gl_WorkGroupSize.x + me;
        if (index < sort_count) {
            atomicAdd(counts[digit_of(keys_in[index], push.shift)], 1u);
        }
    }
    barrier();
    if (me < DIGITS && workgroup_index() < push.tiles) {
        histograms[me * push.tiles + workgroup_index()] = counts[me];
    }
}
