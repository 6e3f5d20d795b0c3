#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's grid of each object: counts the photons in each cell.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "gather/photon.glsl"
#include "trace/object_grid.glsl"

uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) buffer ObjectCells { uint cell_photons[]; }; // cleared before

void main() {
    uint i = invocation_index();
    if (i < photon_count) {
        Photon photon = PHOTON(Photons, i);
        ObjectGrid grid = object_grid(object_of(photon));
        atomicAdd(cell_photons[cell_number(grid, cell_in(grid, photon.position))], 1u);
    }
}
