#version 460
#extension GL_GOOGLE_include_directive : require
// Puts the photons into the sorted order and notes where each bucket begins and ends.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "texel.glsl"
#include "photon.glsl"

// A bucket's photons in the sorted order; padded to a texel.
struct CellRange {
    uint first;
    uint end;
    uint padding0;
    uint padding1;
};

layout(std430) readonly buffer Keys { uint keys[]; };
layout(std430) readonly buffer Values { uint values[]; };
uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) writeonly buffer SortedPhotons { Photon sorted_photons[]; };
layout(std430) writeonly buffer CellRanges { CellRange cell_ranges[]; }; // cleared before: empty buckets are (0, 0)

void main() {
    uint i = invocation_index();
    if (i >= photon_count) {
        return;
    }
    uint key = keys[i];
    if (i == 0u || keys[i - 1u] != key) {
        cell_ranges[key].first = i;
    }
    if (i + 1u == photon_count || keys[i + 1u] != key) {
        cell_ranges[key].end = i + 1u;
    }
    sorted_photons[i] = PHOTON(Photons, values[i]);
}
