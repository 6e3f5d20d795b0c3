#version 460
#extension GL_GOOGLE_include_directive : require
// Chooses the cell size s of each grid. A visible point of radius R visits (2R/s + 1)² rows of cells, and finds photons of an
// area (2R + s)² there; if radii are fitted to the photon density, their number is proportional to (2 + s/R)². The costs that
// grow as R/s and as s/R balance at a multiple of the geometric mean of the radii.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/statistics.glsl"
#include "gather/grid.glsl"

layout(std430) writeonly buffer Grid { GridShape grid; };
layout(std430) readonly buffer RadiiOfShells { ShellRadii radii_of_shells[]; };

// The radius at first at the outer end of a shell of a photon map. Its bits may not depend on the pixels that are rendered.
float first_radius(uint of_shell) {
    float distance = min(exp2(2.0 * float(of_shell % SHELLS) - 12.0), 4.0);
    float footprint = settings.pixel_spread * (settings.camera_up.w != 0.0 ? 1.0 : distance);
    float radius = sqrt(settings.initial_radius2);
    return radius > 0.0 ? radius : settings.first_footprints[of_shell / SHELLS] * footprint;
}

void main() {
    uint i = invocation_index();
    if (i >= 2u * SHELLS) {
        return;
    }
    ShellRadii radii = radii_of_shells[i];
    // Without visible points any size will do; small cells distribute photons evenly over the table. If not all pixels are guides,
    // a shell without any has few visible points, with radii of about those at first.
    float radius = settings.guides.x == 0u ? 0.0 : first_radius(i);
    float balanced = CELLS_TO_RADIUS * (radii.count > 0u ? mean_radius(radii) : radius);
    float bounded = sqrt(uintBitsToFloat(radii.largest)) / MOST_CELLS;
    float size = max(max(balanced, bounded), SMALLEST_CELL);
    grid.inverse_cell_size[i] = 1.0 / size;
}
