#version 460
#extension GL_GOOGLE_include_directive : require
// Adds an iteration's photons to each visible point's statistics (equations 2 and 3), and their contribution to the picture to
// the sum of its sequence.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/sampling.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "common/two_float.glsl"
#include "gather/radius.glsl"
#include "common/status.glsl"

layout(push_constant) uniform UpdatePush { float photons; } push; // paths of an iteration

uniform usamplerBuffer VisiblePoints;
layout(std430) readonly buffer Radii2 { float radii2[]; };
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) readonly buffer CoverageOf { Coverage coverage[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };
layout(std430) buffer SequenceSums { vec4 sequence_sums[]; }; // of the iteration's sequence

// Radiance (RGB and curvature) that one iteration's photons of a map give a visible point.
vec4 update_map(uint receiver, vec3 weight) {
    Gathered arrived = gathered[receiver];
    if (arrived.count == 0u) {
        return vec4(0.0); // no photon: nothing changes
    }
    gathered[receiver] = Gathered(vec3(0.0), 0u, 0.0, 0u, 0u, 0u);
    Statistics mine = statistics[receiver];
    vec4 flux = vec4(weight * arrived.flux, mean_of(weight) * curvature(arrived, radii2[receiver]));
    // τ belongs to a disc of radius R. The gathered disc may be smaller, see stage `radii`.
    float radius2 = mine.radius2_high;
    flux *= radius2 / radii2[receiver];
    if (!finite(flux.rgb) || isnan(flux.w) || isinf(flux.w)) {
        atomicAdd(status.non_finite, 1u);
        return vec4(0.0);
    }
    update_statistics(mine, flux, arrived.count, settings.alpha);
    statistics[receiver] = mine;
    return flux / push.photons / (PI * radius2 * share_of(coverage[receiver]));
}

void main() {
    uint slot = invocation_index();
    if (slot >= slots() || status.retry != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(VisiblePoints, slot);
    if (visible_point.object == NO_OBJECT) {
        return;
    }
    vec4 radiance = vec4(0.0);
    for (uint map = 0u; map < settings.photon_maps; map++) {
        radiance += update_map(map * slots() + slot, visible_point.weight);
    }
    if (radiance != vec4(0.0)) {
        sequence_sums[slot] += radiance;
    }
}
