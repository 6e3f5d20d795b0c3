#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's image synthesis: eq. 4 for each visible point, and the mean of what was seen directly.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "sampling.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "status.glsl"

layout(push_constant) uniform Push {
    uint iterations;
    float emitted; // photon paths of all iterations
} push;

layout(std430) readonly buffer StatisticsOf { Statistics statistics[]; };
layout(std430) readonly buffer CoverageOf { Coverage coverage[]; };
layout(std430) readonly buffer DirectSums { DirectSum direct_sums[]; };
layout(std430) writeonly buffer Film { vec4 film[]; }; // row-major, from the top left

void main() {
    uint pixel_slot = invocation_index();
    if (pixel_slot >= pixel_slots()) {
        return;
    }
    uvec2 pixel = pixel_of(pixel_slot);
    if (any(greaterThanEqual(pixel, settings.resolution))) {
        return;
    }
    vec4 radiance = vec4(0.0); // w: as if the photons' curvature were their flux
    bool has_surface = false;
    bool has_photons = false;
    for (uint i = 0u; i < settings.slots_per_pixel; i++) {
        uint slot = pixel_slot * settings.slots_per_pixel + i;
        Statistics mine = statistics[slot];
        DirectSum sum = direct_sums[slot];
        has_surface = has_surface || coverage[slot].asked > 0u;
        has_photons = has_photons || (mine.accepted_low | mine.accepted_high) != 0u;
        // The quotient of flux and emitted photons comes first: both grow without bound, it doesn't.
        radiance.rgb += (sum.high.rgb + sum.low.rgb) / float(push.iterations);
        if (mine.radius2_high > 0.0) {
            float area = PI * mine.radius2_high * share_of(coverage[slot]);
            radiance += (mine.flux_high + mine.flux_low) / push.emitted / area;
        }
    }
    if (!finite(radiance.rgb) || isnan(radiance.w) || isinf(radiance.w)) {
        atomicAdd(status.non_finite, 1u);
        radiance = vec4(0.0);
    }
    if (has_surface && !has_photons) {
        radiance.w = uintBitsToFloat(0x7f800000u);
    }
    film[pixel.y * settings.resolution.x + pixel.x] = radiance;
}
