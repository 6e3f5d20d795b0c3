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
layout(std430) readonly buffer Radii2 { float radii2[]; };
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint i = invocation_index();
    if (i >= receiver_count() || status.again != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(i % slots());
    if (floatBitsToUint(visible_point.position_object.w) == NO_OBJECT) {
        return;
    }
    Gathered arrived = gathered[i];
    if (floatBitsToUint(arrived.flux_count.w) == 0u) {
        return; // nothing has come, and nothing changes
    }
    gathered[i] = Gathered(vec4(0.0), 0.0, 0u, 0u, 0u);
    Statistics mine = statistics[i];
    vec3 weight = visible_point.weight_normal.rgb;
    vec4 flux = vec4(weight * arrived.flux_count.rgb, mean_of(weight) * curvature(arrived, radii2[i]));
    // τ is that of a disc of R. A smaller one has been gathered from where that has a bound, see `radii`.
    flux *= mine.radius2_high / radii2[i];
    if (!finite(flux.rgb) || isnan(flux.w) || isinf(flux.w)) {
        atomicAdd(status.non_finite, 1u);
        return;
    }
    update_statistics(mine, flux, floatBitsToUint(arrived.flux_count.w), settings.alpha);
    statistics[i] = mine;
}
