#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's maximum number of photons per cell: photons beyond it are dropped and counted as lost.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "common/status.glsl"

layout(push_constant) uniform ObjectCellLimitPush {
    uint cells;
    uint maximum;
} push;

layout(std430) buffer ObjectCells { uint cell_photons[]; };

void main() {
    uint cell = invocation_index();
    if (cell < push.cells && cell_photons[cell] > push.maximum) {
        atomicAdd(status.lost_photons, cell_photons[cell] - push.maximum);
        atomicAdd(status.full_cells, 1u);
        cell_photons[cell] = push.maximum;
    }
}
