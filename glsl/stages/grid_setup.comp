#version 460
#extension GL_GOOGLE_include_directive : require
// Chooses the grid's cell size: twice the mean radius, so that most visible points look into eight cells.

#include "settings.glsl"
#include "statistics.glsl"

layout(local_size_x = 128) in;

layout(push_constant) uniform Push {
    uint count; // partial sums
} push;

#include "grid.glsl"

layout(std430) writeonly buffer Grid { GridShape grid; };
layout(std430) readonly buffer RadiusSums { RadiusSum radius_sums[]; };

shared float shared_radius[gl_WorkGroupSize.x];
shared float shared_radius2[gl_WorkGroupSize.x];
shared uint shared_count[gl_WorkGroupSize.x];

// Below this, render units, cell coordinates would pass 2^30.
const float SMALLEST_CELL = 1.0 / 536870912.0;

void main() {
    uint me = gl_LocalInvocationID.x;
    float radius = 0.0;
    float radius2 = 0.0;
    uint count = 0u;
    for (uint i = me; i < push.count; i += gl_WorkGroupSize.x) {
        RadiusSum sum = radius_sums[i];
        radius += sum.radius;
        radius2 = max(radius2, sum.radius2);
        count += sum.count;
    }
    shared_radius[me] = radius;
    shared_radius2[me] = radius2;
    shared_count[me] = count;
    for (uint half_size = gl_WorkGroupSize.x / 2u; half_size > 0u; half_size /= 2u) {
        barrier();
        if (me < half_size) {
            shared_radius[me] += shared_radius[me + half_size];
            shared_radius2[me] = max(shared_radius2[me], shared_radius2[me + half_size]);
            shared_count[me] += shared_count[me + half_size];
        }
    }
    if (me == 0u) {
        float mean = shared_radius[0] / float(max(shared_count[0], 1u));
        float cell_size = max(2.0 * mean, SMALLEST_CELL);
        grid = GridShape(1.0 / cell_size, cell_size, mean, shared_radius2[0]);
    }
}
