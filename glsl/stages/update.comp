#version 460
#extension GL_GOOGLE_include_directive : require
// Takes an iteration's photons into each visible point's statistics (equations 2 and 3) and sums up the radii for the
// next iteration's grid.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "sampling.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "radius_sums.glsl"
#include "two_float.glsl"
#include "radius.glsl"
#include "status.glsl"

uniform usamplerBuffer VisiblePoints;
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };
layout(std430) writeonly buffer RadiusSums { RadiusSum radius_sums[]; };

void main() {
    uint slot = invocation_index();
    bool counts = false;
    float radius2 = 0.0;
    if (slot < slots() && status.again == 0u) {
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
    RadiusSum sum = sum_of_radii(counts, radius2);
    if (gl_LocalInvocationID.x == 0u && slot < slots() && status.again == 0u) {
        radius_sums[workgroup_index()] = sum;
    }
}
