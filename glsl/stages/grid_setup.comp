#version 460
#extension GL_GOOGLE_include_directive : require
// Chooses the grid's cell size: twice the mean radius, so that most visible points look into eight cells; more where
// some radii are far larger.

layout(local_size_x = 128) in;

#include "settings.glsl"
#include "statistics.glsl"
#include "radius_sums.glsl"

layout(push_constant) uniform Push {
    uint count; // partial sums
} push;

#include "grid.glsl"

layout(std430) writeonly buffer Grid { GridShape grid; };
layout(std430) readonly buffer RadiusSums { RadiusSum radius_sums[]; };

// Render units. Positions resolve 6e-8: finer cells would gain nothing, and a visible point would reach too many of them.
const float SMALLEST_CELL = 1.0 / 1048576.0;

void main() {
    RadiusSum term = RadiusSum(0.0, 0.0, 0u, 0u);
    for (uint i = gl_LocalInvocationID.x; i < push.count; i += gl_WorkGroupSize.x) {
        RadiusSum sum = radius_sums[i];
        term.radius += sum.radius;
        term.radius2 = max(term.radius2, sum.radius2);
        term.count += sum.count;
    }
    RadiusSum all = reduce(term);
    if (gl_LocalInvocationID.x == 0u) {
        float mean = all.radius / float(max(all.count, 1u));
        // The largest radius must not reach too many cells.
        float cell_size = max(max(2.0 * mean, sqrt(all.radius2) / 8.0), SMALLEST_CELL);
        grid.inverse_cell_size = 1.0 / cell_size;
    }
}
