#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's grid of each object: each photon takes the next place of its cell from an atomic counter. The order of photons
// within a cell is undefined and differs between runs.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "gather/photon.glsl"
#include "trace/object_grid.glsl"

uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) readonly buffer ObjectCells { uint cell_starts[]; };
layout(std430) buffer ObjectCellCursors { uint cursors[]; }; // cleared before
layout(std430) writeonly buffer SortedPhotons { Photon sorted_photons[]; };

void main() {
    uint i = invocation_index();
    if (i >= photon_count) {
        return;
    }
    Photon photon = PHOTON(Photons, i);
    ObjectGrid grid = object_grid(object_of(photon));
    uint cell = cell_number(grid, cell_in(grid, photon.position));
    uint place = cell_starts[cell] + atomicAdd(cursors[cell], 1u);
    // The cell is full.
    if (place < cell_starts[cell + 1u]) {
        sorted_photons[place] = photon;
    }
}
