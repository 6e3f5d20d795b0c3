#version 460
#extension GL_GOOGLE_include_directive : require
// Radix sort, last stage of a pass: each key goes to its place among all keys.

layout(local_size_x = 128) in;

#include "invocation.glsl"

layout(push_constant) uniform Push {
    uint shift;
    uint tiles;
} push;

#include "sort.glsl"

layout(std430) readonly buffer KeysIn { uint keys_in[]; };
layout(std430) readonly buffer ValuesIn { uint values_in[]; };
layout(std430) readonly buffer Histograms { uint histograms[]; }; // after the scan: where a tile's digit begins
layout(std430) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430) writeonly buffer ValuesOut { uint values_out[]; };

// [digit][thread]: first how many, then where in the tile's run of this digit the thread's next key goes.
shared uint places[DIGITS * gl_WorkGroupSize.x];

void main() {
    uint me = gl_LocalInvocationID.x;
    // Room for more keys than there are costs nothing.
    if (workgroup_index() * TILE_KEYS >= sort_count) {
        return;
    }
    for (uint digit = 0u; digit < DIGITS; digit++) {
        places[digit * gl_WorkGroupSize.x + me] = 0u;
    }
    uint first = workgroup_index() * TILE_KEYS + me * KEYS_PER_THREAD;
    uint last = min(first + KEYS_PER_THREAD, sort_count);
    for (uint i = first; i < last; i++) {
        places[digit_of(keys_in[i], push.shift) * gl_WorkGroupSize.x + me] += 1u;
    }
    barrier();
    if (me < DIGITS && workgroup_index() < push.tiles) {
        uint place = histograms[me * push.tiles + workgroup_index()];
        for (uint thread = 0u; thread < gl_WorkGroupSize.x; thread++) {
            uint count = places[me * gl_WorkGroupSize.x + thread];
            places[me * gl_WorkGroupSize.x + thread] = place;
            place += count;
        }
    }
    barrier();
    for (uint i = first; i < last; i++) {
        uint key = keys_in[i];
        uint slot = digit_of(key, push.shift) * gl_WorkGroupSize.x + me;
        uint place = places[slot];
        places[slot] = place + 1u;
        keys_out[place] = key;
        values_out[place] = values_in[i];
    }
}
