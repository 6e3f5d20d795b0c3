#version 460
#extension GL_GOOGLE_include_directive : require
// Radix sort, first stage of a pass: counts each digit in each tile.

layout(local_size_x = 128) in;

#include "common/invocation.glsl"
#include "common/sort.glsl"

layout(std430) readonly buffer KeysIn { uint keys_in[]; };
layout(std430) writeonly buffer Histograms { uint histograms[]; };

shared uint counts[MOST_DIGITS];

void main() {
    uint me = gl_LocalInvocationID.x;
    uint first = workgroup_index() * SORT_TILE;
    // Capacity beyond the number of keys costs nothing.
    if (first >= sort_count) {
        return;
    }
    for (uint digit = me; digit < digits(); digit += gl_WorkGroupSize.x) {
        counts[digit] = 0u;
    }
    barrier();
    uint end = min(first + SORT_TILE, sort_count);
    for (uint i = first + me; i < end; i += gl_WorkGroupSize.x) {
        atomicAdd(counts[digit_of(keys_in[i])], 1u);
    }
    barrier();
    for (uint digit = me; digit < digits(); digit += gl_WorkGroupSize.x) {
        histograms[histogram_of(digit, workgroup_index())] = counts[digit];
    }
}
