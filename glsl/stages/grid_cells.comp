#version 460
#extension GL_GOOGLE_include_directive : require
// Puts the photons into the sorted order and notes where each bucket begins and ends.

#include "photon.glsl"

layout(local_size_x = 64) in;

layout(std430) readonly buffer Keys { uint keys[]; };
layout(std430) readonly buffer Values { uint values[]; };
layout(std430) readonly buffer Photons { Photon photons[]; };
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) writeonly buffer SortedPhotons { Photon sorted_photons[]; };
layout(std430) writeonly buffer CellStarts { uint cell_starts[]; };
layout(std430) writeonly buffer CellEnds { uint cell_ends[]; }; // cleared before: an empty bucket ends at 0

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= photon_count) {
        return;
    }
    uint key = keys[i];
    if (i == 0u || keys[i - 1u] != key) {
        cell_starts[key] = i;
    }
    if (i + 1u == photon_count || keys[i + 1u] != key) {
        cell_ends[key] = i + 1u;
    }
    sorted_photons[i] = photons[values[i]];
}
