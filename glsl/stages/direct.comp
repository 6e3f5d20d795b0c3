#version 460
#extension GL_GOOGLE_include_directive : require
// Adds the emission that each visible point's path has seen and, unless photons carry direct light too, direct light by one ray
// towards a light. If only glass occludes the light, photons have to carry it: its contribution without refraction is stored, as
// an estimate of what the picture lacks until they do. That takes more rays, so points that have photons do it in few iterations.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "bsdf/reflection.glsl"
#include "trace/interaction.glsl"
#include "trace/object_grid.glsl"
#include "lights/light_sample.glsl"
#include "gather/visible_point.glsl"
#include "common/two_float.glsl"
#include "gather/statistics.glsl"
#include "common/status.glsl"

layout(constant_id = 3) const bool SAMPLE_LIGHTS = true;
layout(constant_id = 24) const bool BEHIND_GLASS = true; // in this iteration, see RenderConfig::samples_behind_glass

layout(push_constant) uniform CameraTurnPush {
    uint iteration;
    uint path;  // index of the camera path among those of the pixel in this iteration
    uint paths;
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer PackedBsdfs;
uniform usamplerBuffer StatisticsOf;
layout(std430) buffer DirectSums { DirectSum direct_sums[]; };
layout(std430) buffer CoverageOf { Coverage coverage[]; };
layout(std430) buffer SequenceSums { vec4 sequence_sums[]; }; // of the iteration's sequence

// Whether a shadow ray that ends on glass continues.
bool samples_behind_glass(uint slot) {
    bool through_glass = false;
    if (BEHIND_GLASS) {
        Statistics statistics = STATISTICS(StatisticsOf, (settings.photon_maps - 1u) * slots() + slot);
        bool has_few = photons_of(statistics.accepted_low, statistics.accepted_high) < SEASONED;
        through_glass = (push.iteration % BEHIND_GLASS_EVERY == 0u || has_few);
    }
    return through_glass;
}

// Loaded at its use: otherwise it would hold registers.
VisibleBsdf bsdf_of_slot(uint slot, vec3 shading_normal) {
    VisibleBsdf bsdf = no_visible_bsdf();
    bsdf.normal = shading_normal;
    if (carries_bsdf()) {
        bsdf = LOAD_BSDF(PackedBsdfs, slot, shading_normal);
    }
    return bsdf;
}

// One ray, at random towards a point of a light or along a BSDF sample, with the density of both strategies together (one-sample
// multiple importance sampling: Veach, 1997, section 9.2.4). Points of lights alone have unbounded variance next to a light. The
// contribution is evaluated before the ray is traced, so that few values are live during the traversal. behind_glass: glass
// occludes the light, and the result is its contribution without refraction.
vec3 sample_direct(VisiblePoint visible_point, uint slot, uint of_source, bool through_glass, inout Random random,
                   out bool behind_glass) {
    behind_glass = false;
    vec4 u = next4(random);
    // Choosing among many lights needs more digits.
    vec4 digits = settings.light_count > 1u ? next4(random) : vec4(0.0);

    vec3 position = visible_point.position;
    vec3 geometric_normal = decode_direction(visible_point.geometric_normal);
    vec3 shading_normal = decode_direction(visible_point.shading_normal);
    vec3 origin = offset_origin(position, geometric_normal, reach_of(visible_point.object));
    LightReceiver receiver = LightReceiver(position, shading_normal, origin, of_source);
    float bsdf_sampling = is_near_light(position) ? settings.bsdf_sampling : 0.0;
    if (has_narrow_lobe(bsdf_of_slot(slot, shading_normal)) && settings.near_light_count > 0u) {
        bsdf_sampling = 0.5;
    }
    bsdf_sampling = is_delta_source(receiver) ? 0.0 : bsdf_sampling;
    bool by_bsdf = u.w < bsdf_sampling;
    LightSample sampled = ray_along(vec3(0.0));
    if (by_bsdf) {
        sampled = ray_along(sample_bsdf(bsdf_of_slot(slot, shading_normal), u.xyz));
    } else {
        sampled = sample_light(receiver, u.xyz, digits.xz);
    }
    vec3 ray = sampled.ray;
    float cos_surface = dot(sampled.towards, shading_normal);
    bool leaves = dot(ray, geometric_normal) > 0.0 && dot(ray, shading_normal) > 0.0 && cos_surface > 0.0;
    VisibleBsdf bsdf = bsdf_of_slot(slot, shading_normal);
    float of_bsdf = bsdf_sampling * bsdf_density(bsdf, sampled.towards);
    float by_light = 1.0 - bsdf_sampling;
    vec3 weight = visible_point.weight * cos_surface * evaluate_bsdf(bsdf, sampled.towards);
    vec3 brings = leaves ? weight * sampled.radiance : vec3(0.0);
    if (!by_bsdf) {
        brings /= by_light * sampled.density + (sampled.delta ? 0.0 : of_bsdf);
    }
    Hit hit = NO_HIT;
    vec3 from = origin;
    float passed = 0.0;
    uint crossings = 0u;
    bool any = !by_bsdf;
    bool goes_on = largest(brings) > 0.0;
    while (goes_on) {
        hit = trace_visible(from, ray, AT_ORIGIN, sampled.end - passed, sampled.ignored, any, random);
        goes_on = BEHIND_GLASS && through_glass && hit.triangle != MISS && !loops_cut && crossings < DIRECT_CROSSINGS;
        if (goes_on) {
            vec3 tint;
            bool ends_at_light = by_bsdf && is_light(hit);
            goes_on = passes_unbent(hit, tint) && !ends_at_light;
            // Any-hit search does not find the first hit: the ray starts again.
            if (goes_on && !any) {
                behind_glass = true;
                brings *= tint;
                from = origin_towards(surface_at(hit), ray);
                passed = dot(from - origin, ray) / dot(ray, ray);
                crossings += 1u;
            }
            any = false;
        }
    }
    bool is_cut = loops_cut;
    if (by_bsdf && largest(brings) > 0.0 && !is_cut) {
        LightSample along = light_along(receiver, ray, hit, random);
        brings *= along.radiance / (by_light * along.density + of_bsdf);
    }
    bool blocked = !by_bsdf && hit.triangle != MISS;
    if (is_cut) {
        atomicAdd(status.cut_paths, behind_glass ? 0u : 1u);
    }
    return is_cut || blocked ? vec3(0.0) : brings;
}

// Adds the contribution, or the one without refraction.
void add_direct(VisiblePoint visible_point, uint slot, uint of_source, bool through_glass, inout Random random, inout vec3 radiance,
                inout float unbent) {
    bool behind_glass;
    vec3 sampled = sample_direct(visible_point, slot, of_source, through_glass, random, behind_glass);
    if (behind_glass) {
        unbent += finite(sampled) ? mean_of(sampled) : 0.0;
    } else {
        radiance += sampled;
    }
}

void main() {
    uint slot = invocation_index();
    if (slot >= slots() || status.retry != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(VisiblePoints, slot);
    bool has_object = visible_point.object != NO_OBJECT;
    bool met = has_object || visible_point.geometric_normal != 0u;
    coverage[slot].met += met ? 1u : 0u;
    vec3 radiance = visible_point.emitted;
    float unbent = 0.0;
    bool through_glass = false;
    if (SAMPLE_LIGHTS && has_object) {
        through_glass = samples_behind_glass(slot);
        CameraTurn turn = CameraTurn(push.iteration, push.path, push.paths);
        Random random = random_of_pixel(LIGHT_SAMPLE, slot_in_whole(slot), turn, settings.seed);
        // Not one loop for both cases: around a single sample it costs a quarter of the stage.
        if (FEW_SOURCES) {
            for (uint source = 0u; source < settings.light_source_count; source++) {
                add_direct(visible_point, slot, source, through_glass, random, radiance, unbent);
            }
        } else {
            add_direct(visible_point, slot, 0u, through_glass, random, radiance, unbent);
        }
    }
    if (!finite(radiance)) {
        atomicAdd(status.non_finite, 1u);
        return;
    }
    radiance /= float(push.paths);
    DirectSum sum = direct_sums[slot];
    add_to(sum.high.r, sum.low.r, radiance.r);
    add_to(sum.high.g, sum.low.g, radiance.g);
    add_to(sum.high.b, sum.low.b, radiance.b);
    sum.high.w += unbent;
    sum.low.w += through_glass ? 1.0 : 0.0;
    direct_sums[slot] = sum;
    sequence_sums[slot].rgb += radiance;
}
