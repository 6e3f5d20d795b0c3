#version 460
#extension GL_GOOGLE_include_directive : require
// Chooses the grid's cell size s. A visible point of radius R looks into (2R/s + 1)² rows of cells, and finds photons of
// an area (2R + s)² there; where radii were fitted to the photons' density, that is as many as (2 + s/R)². What grows as
// R²/s² and what grows as s²/R² weigh the same, over all points, at s⁴ = c⁴ · ΣR² / ΣR⁻².

layout(local_size_x = 64) in;

#include "settings.glsl"
#include "statistics.glsl"
#include "radius_sums.glsl"
#include "grid.glsl"

layout(push_constant) uniform Push {
    uint count; // partial sums
} push;

layout(std430) writeonly buffer Grid { GridShape grid; };
layout(std430) readonly buffer RadiusSums { RadiusSum radius_sums[]; };

// c: s / R where all radii are alike. Measured, see docs/gather.md.
const float CELLS_TO_RADIUS = 1.5;
// Render units. Positions resolve 6e-8: finer cells would gain nothing, and a visible point would reach too many of them.
const float SMALLEST_CELL = 1.0 / 1048576.0;
// Cells that the initial radius, the largest there is, may span: the few points in the dark that keep it must not hold up
// the rest. It holds so few photons that cells of that size are nearly empty.
const float MOST_CELLS = 16.0;

void main() {
    RadiusSum term = RadiusSum(0.0, 0.0, 0u, 0u);
    for (uint i = gl_LocalInvocationID.x; i < push.count; i += gl_WorkGroupSize.x) {
        term = together(term, radius_sums[i]);
    }
    RadiusSum all = reduce(term);
    if (gl_LocalInvocationID.x == 0u) {
        // Without a visible point the sums are 0, and any size will do.
        float balanced = all.count > 0u ? CELLS_TO_RADIUS * sqrt(sqrt(all.radius2 / all.inverse2)) : 1.0;
        float cell_size = max(max(balanced, sqrt(settings.initial_radius2) / MOST_CELLS), SMALLEST_CELL);
        grid.inverse_cell_size = 1.0 / cell_size;
    }
}
