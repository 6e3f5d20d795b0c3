#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's image synthesis: equation 4 for each visible point, and the mean of directly seen light. Also estimates the light
// behind glass that no photon has carried yet.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/sampling.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "common/status.glsl"

// Whether a picture for each part of the light is wanted.
layout(constant_id = 36) const bool LIGHT_PARTS = false;

layout(push_constant) uniform ResolvePush {
    uint iterations;
    float emitted; // photon paths of all iterations
    uint camera_paths; // per pixel, of all iterations
} push;

uniform usamplerBuffer VisiblePoints;
layout(std430) readonly buffer StatisticsOf { Statistics statistics[]; };
layout(std430) readonly buffer CoverageOf { Coverage coverage[]; };
layout(std430) readonly buffer DirectSums { DirectSum direct_sums[]; };
layout(std430) writeonly buffer Film { vec4 film[]; }; // row-major, from the top left, then the guides; w: see below
layout(std430) writeonly buffer GlassFilm { BehindGlass glass_film[]; }; // likewise, without guides
layout(std430) writeonly buffer LightPartsFilm { LightParts light_parts[]; }; // likewise

// 64-bit addition with carry.
void add_accepted(uint low, uint high) {
    if ((low | high) != 0u) {
        uint before = atomicAdd(status.photons_accepted_low, low);
        atomicAdd(status.photons_accepted_high, high + (before + low < before ? 1u : 0u));
    }
}

// The width of a pixel at a visible point that is seen directly.
float pixel_width(vec3 position) {
    return settings.pixel_spread * (settings.camera_up.w != 0.0 ? 1.0 : length(position - settings.camera_position.xyz));
}

void main() {
    uint pixel_slot = invocation_index();
    if (pixel_slot >= pixel_slots()) {
        return;
    }
    uvec2 pixel;
    if (!has_pixel(pixel_slot, pixel)) {
        return;
    }
    bool on_picture = pixel_slot < region_slots();
    vec3 radiance = vec3(0.0);
    uint met = 0u;
    bool has_surface = false;
    bool has_photons = false;
    LightParts parts = LightParts(vec4(0.0), vec4(0.0), vec4(0.0));
    BehindGlass glass = BehindGlass(0.0, 0.0, 0.0, 0.0, 0.0);
    for (uint i = 0u; i < settings.slots_per_pixel; i++) {
        uint slot = pixel_slot * settings.slots_per_pixel + i;
        DirectSum sum = direct_sums[slot];
        // Flux is divided by emitted photons first: both grow without bound, their quotient does not.
        vec3 direct = (sum.high.rgb + sum.low.rgb) / float(push.iterations);
        radiance += direct;
        parts.direct.rgb += direct;
        glass.unbent += unbent_of(sum);
        has_surface = has_surface || coverage[slot].surrounded > 0u;
        // The slots of a pixel share its camera paths.
        met = max(met, coverage[slot].met);
        VisiblePoint visible_point = VISIBLE_POINT(VisiblePoints, slot);
        bool lies_behind_glass =
            sum.high.w > 0.0 && visible_point.object != NO_OBJECT;
        for (uint map = 0u; map < settings.photon_maps; map++) {
            uint receiver = map * slots() + slot;
            Statistics mine = statistics[receiver];
            bool through_glass = map + 1u == settings.photon_maps;
            if (on_picture) {
                add_accepted(mine.accepted_low, mine.accepted_high);
            }
            has_photons = has_photons || (mine.accepted_low | mine.accepted_high) != 0u;
            if (mine.radius2_high > 0.0) {
                float area = PI * mine.radius2_high * share_of(coverage[receiver]);
                vec3 by_photons = (mine.flux_high.rgb + mine.flux_low.rgb) / push.emitted / area;
                radiance += by_photons;
                if (map > 0u) {
                    parts.caustic.rgb += by_photons;
                } else {
                    parts.indirect.rgb += by_photons;
                }
                glass.arrived += through_glass ? mean_of(by_photons) : 0.0;
            }
            if (lies_behind_glass && through_glass) {
                // Of several slots, the one with the most photons.
                glass.photons = max(glass.photons, float(photons_of(mine.accepted_low, mine.accepted_high)));
                float radius = sqrt(mine.radius2_high) / pixel_width(visible_point.position);
                glass.radius = max(glass.radius, radius);
                glass.radius2 = max(glass.radius2, mine.radius2_high);
            }
        }
    }
    if (!finite(radiance)) {
        atomicAdd(status.non_finite, 1u);
        radiance = vec3(0.0);
        parts = LightParts(vec4(0.0), vec4(0.0), vec4(0.0));
    }
    // Alpha, the share of camera paths that met a surface; negative if a point that is not in the open has received no photon
    // yet.
    float alpha = float(met) / float(push.camera_paths);
    alpha = has_surface && !has_photons ? -alpha : alpha;
    uint index = number_on_film(pixel_slot, pixel);
    film[index] = vec4(radiance, alpha);
    if (on_picture) {
        glass_film[index] = glass;
    }
    if (LIGHT_PARTS && on_picture) {
        light_parts[index] = parts;
    }
}
