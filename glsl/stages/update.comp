#version 460
#extension GL_GOOGLE_include_directive : require
// Takes an iteration's photons into each visible point's statistics (equations 2 and 3) and sums up the radii for the
// next iteration's grid.

#include "settings.glsl"
#include "texel.glsl"
#include "sampling.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "two_float.glsl"
#include "radius.glsl"
#include "status.glsl"

layout(local_size_x = 64) in;

uniform usamplerBuffer VisiblePoints;
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };
layout(std430) writeonly buffer RadiusSums { RadiusSum radius_sums[]; };

shared float shared_radius[gl_WorkGroupSize.x];
shared float shared_radius2[gl_WorkGroupSize.x];
shared uint shared_count[gl_WorkGroupSize.x];

void main() {
    uint slot = gl_GlobalInvocationID.x;
    uint me = gl_LocalInvocationID.x;
    bool counts = false;
    float radius2 = 0.0;
    if (slot < pixel_slots() * settings.slots_per_pixel && status.overflow == 0u) {
        VisiblePoint visible_point = VISIBLE_POINT(slot);
        Statistics mine = statistics[slot];
        counts = floatBitsToUint(visible_point.position_object.w) != NO_OBJECT;
        if (counts) {
            vec4 sum = gathered[slot].flux_count;
            gathered[slot].flux_count = vec4(0.0);
            vec3 flux = visible_point.weight_normal.rgb * sum.rgb;
            if (finite(flux)) {
                update_statistics(mine, flux, floatBitsToUint(sum.w), settings.alpha);
                statistics[slot] = mine;
            } else {
                atomicAdd(status.non_finite, 1u);
            }
        }
        radius2 = mine.radius2_high;
    }
    shared_radius[me] = counts ? sqrt(radius2) : 0.0;
    shared_radius2[me] = counts ? radius2 : 0.0;
    shared_count[me] = counts ? 1u : 0u;
    for (uint half_size = gl_WorkGroupSize.x / 2u; half_size > 0u; half_size /= 2u) {
        barrier();
        if (me < half_size) {
            shared_radius[me] += shared_radius[me + half_size];
            shared_radius2[me] = max(shared_radius2[me], shared_radius2[me + half_size]);
            shared_count[me] += shared_count[me + half_size];
        }
    }
    if (me == 0u && status.overflow == 0u) {
        radius_sums[gl_WorkGroupID.x] = RadiusSum(shared_radius[0], shared_radius2[0], shared_count[0], 0u);
    }
}
