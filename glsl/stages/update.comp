#version 460
#extension GL_GOOGLE_include_directive : require
// Takes an iteration's photons into each visible point's statistics (equations 2 and 3).

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "two_float.glsl"
#include "radius.glsl"
#include "status.glsl"

uniform usamplerBuffer VisiblePoints;
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint slot = invocation_index();
    if (slot >= slots() || status.again != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(slot);
    if (floatBitsToUint(visible_point.position_object.w) == NO_OBJECT) {
        return;
    }
    Gathered arrived = gathered[slot];
    gathered[slot] = Gathered(vec4(0.0), 0.0, 0u, 0u, 0u);
    Statistics mine = statistics[slot];
    vec3 weight = visible_point.weight_normal.rgb;
    vec4 flux = vec4(weight * arrived.flux_count.rgb, mean_of(weight) * curvature(arrived, mine.radius2_high));
    if (!finite(flux.rgb) || isnan(flux.w) || isinf(flux.w)) {
        atomicAdd(status.non_finite, 1u);
        return;
    }
    update_statistics(mine, flux, floatBitsToUint(arrived.flux_count.w), settings.alpha);
    statistics[slot] = mine;
}
