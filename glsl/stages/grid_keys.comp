#version 460
#extension GL_GOOGLE_include_directive : require
// The bucket of each photon, to be sorted by.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "photon.glsl"

#include "grid.glsl"

layout(std430) readonly buffer Grid { GridShape grid; };
uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) writeonly buffer Keys { uint keys[]; };
layout(std430) writeonly buffer Values { uint values[]; };

void main() {
    uint i = invocation_index();
    if (i >= photon_count) {
        return;
    }
    keys[i] = bucket_of(cell_of(TEXEL(Photons, 2u * i).xyz, grid.inverse_cell_size));
    values[i] = i;
}
