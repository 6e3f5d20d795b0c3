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
    vec4 sum = gathered[slot].flux_count;
    gathered[slot].flux_count = vec4(0.0);
    vec3 flux = visible_point.weight_normal.rgb * sum.rgb;
    if (!finite(flux)) {
        atomicAdd(status.non_finite, 1u);
        return;
    }
    Statistics mine = statistics[slot];
    update_statistics(mine, flux, floatBitsToUint(sum.w), settings.alpha);
    statistics[slot] = mine;
}
