#version 460
#extension GL_GOOGLE_include_directive : require
// The bucket of each photon, as a key for sorting, and the number of photons in each bucket.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/photon.glsl"
#include "gather/grid.glsl"

layout(std430) readonly buffer Grid { GridShape grid; };
uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) writeonly buffer Keys { uint keys[]; };
layout(std430) writeonly buffer Values { uint values[]; };
layout(std430) buffer CellStarts { uint cell_photons[]; }; // cleared before

void main() {
    uint i = invocation_index();
    if (i >= photon_count) {
        return;
    }
    Photon photon = PHOTON(Photons, i);
    uint of_shell = map_of(photon) * SHELLS + shell_of(photon.position);
    uint bucket = bucket_of(cell_of(photon.position, grid.inverse_cell_size[of_shell]), of_shell);
    keys[i] = bucket;
    values[i] = i;
    atomicAdd(cell_photons[bucket], 1u);
}
