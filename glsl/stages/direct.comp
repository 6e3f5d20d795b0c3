#version 460
#extension GL_GOOGLE_include_directive : require
// Adds what each visible point's path saw of the lights: by itself and, unless photons carry direct light too, by one
// ray towards a light. Where glass alone stands between, photons have to bring that light: what it would be unbent is kept,
// since it says what a picture without them doesn't have. That takes more rays: points that have photons ask now and then.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "sampling.glsl"
#include "gloss.glsl"
#include "random.glsl"
#include "texel.glsl"
#include "scene.glsl"
#include "intersect.glsl"
#include "texture.glsl"
#include "alpha.glsl"
#include "bsdf.glsl"
#include "media.glsl"
#include "contact.glsl"
#include "environment.glsl"
#include "light.glsl"
#include "light_sources.glsl"
#include "object_grid.glsl"
#include "visible_point.glsl"
#include "two_float.glsl"
#include "statistics.glsl"
#include "status.glsl"

layout(constant_id = 3) const bool SAMPLE_LIGHTS = true;
layout(constant_id = 24) const bool ASKS_BEHIND_GLASS = true; // in this iteration, see config::RenderConfig

layout(push_constant) uniform Push {
    uint iteration;
    uint path;  // of the pixel, of so many in this iteration
    uint paths;
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer GlossOf;
uniform usamplerBuffer StatisticsOf;
uniform usamplerBuffer NearLights;
layout(std430) buffer DirectSums { DirectSum direct_sums[]; };
layout(std430) buffer CoverageOf { Coverage coverage[]; };
layout(std430) buffer SequenceSums { vec4 sequence_sums[]; }; // of the iteration's sequence

// Whether a shadow ray that ends on glass goes on.
bool asks_behind_glass(uint slot) {
    bool asks = false;
    if (ASKS_BEHIND_GLASS) {
        Statistics statistics = STATISTICS(StatisticsOf, (settings.photon_maps - 1u) * slots() + slot);
        bool has_few = photons_of(statistics.accepted_low, statistics.accepted_high) < SEASONED;
        asks = DIELECTRICS && (push.iteration % ASKS_EVERY == 0u || has_few);
    }
    return asks;
}

// A ray towards a light, and what that sends along it if nothing is between.
struct LightSample {
    vec3 ray;
    float end;  // of the ray, in its lengths
    PlacedTriangle ignored;
    vec3 towards;  // unit vector to the light's point
    vec3 radiance; // of a light that is a point or a direction: irradiance across the ray
    float density; // per solid angle
    bool delta;    // no direction of the BSDF meets it
};

// What a triangle's light sends to a place from a point, without its opacity, and the density of that point.
vec3 radiance_of(Surface emitter, uint light, float probability, vec3 position, out vec3 towards, out float density) {
    vec3 to_light = emitter.position - position;
    float distance2 = dot(to_light, to_light);
    towards = to_light * inversesqrt(max(distance2, 1e-37));
    float cos_light = -dot(towards, emitter.geometric_normal);
    Material material = emitter_of(emitter);
    bool shines = emits(material, cos_light > 0.0) && cos_light != 0.0 && probability > 0.0;
    density = shines ? probability * distance2 / (light_at(light).area * abs(cos_light)) : 1.0;
    vec3 radiance = shines ? emitted_radiance(material, abs(cos_light)) : vec3(0.0);
    if (IMMERSED) {
        // What is between them is what the light is in.
        radiance *= transmittance(media_of_light(light).first, sqrt(distance2));
    }
    return radiance;
}

// Of a light that u.x chooses, or one of that source.
LightSample sample_light(vec3 position, vec3 normal, vec3 origin, uint of_source, vec3 u, vec2 digits) {
    uint chosen;
    float probability;
    if (FEW_SOURCES) {
        LightSource source = light_source_at(of_source);
        LightWithin within = light_within(source.first_light, source.light_count, digits.x);
        chosen = within.light;
        probability = within.probability;
    } else if (MANY_SOURCES) {
        LightChoice choice = choose_light_for(position, normal, u.x, digits.x);
        chosen = choice.light;
        probability = choice.probability;
    } else {
        chosen = choose_light(u.x, digits).index;
        probability = light_at(chosen).probability;
    }
    Light light = light_at(chosen);
    LightSample sampled;
    sampled.end = 1e30;
    sampled.ignored = NO_TRIANGLE;
    sampled.delta = false;
    if (PUNCTUAL_LIGHTS && is_punctual(light.kind)) {
        Arriving arriving = arriving_from(light, origin, u.yz);
        sampled.ray = arriving.ray;
        sampled.end = arriving.end;
        sampled.towards = normalize(arriving.ray);
        sampled.radiance = arriving.irradiance / probability;
        if (IMMERSED) {
            sampled.radiance *= transmittance(media_of_light(chosen).first, length(arriving.ray));
        }
        sampled.density = 1.0;
        sampled.delta = true;
    } else if (ENVIRONMENT && light.kind == ENVIRONMENT_LIGHT) {
        Sky sky = sample_environment(u.yz, sampled.ray);
        sampled.towards = normalize(sampled.ray);
        sampled.radiance = sky.radiance;
        sampled.density = sky.density * probability;
    } else {
        PlacedTriangle triangle = PlacedTriangle(light.triangle, NO_INSTANCE);
        Surface emitter = surface_at(triangle, point_of_light(light, u.yz));
        // Both ends move off their surfaces.
        sampled.ray = origin_towards(emitter, position - emitter.position) - origin;
        sampled.end = 1.0 - ENDS_BEFORE;
        sampled.ignored = triangle;
        sampled.radiance = share_there(emitter) *
                           radiance_of(emitter, chosen, probability, position, sampled.towards, sampled.density);
    }
    return sampled;
}

// Whether a light is so near that the squared distance to its points varies much.
bool is_near_light(vec3 position) {
    bool near = false;
    for (uint i = 0u; i < settings.near_light_count && !near; i++) {
        vec4 sphere = TEXEL(NearLights, i);
        vec3 apart = position - sphere.xyz;
        near = dot(apart, apart) <= sphere.w;
    }
    return near;
}

// The probability of a light for a ray that met it; 0 of one that isn't of the source that is asked.
float probability_of_light(vec3 position, vec3 normal, uint of_source, uint light) {
    if (FEW_SOURCES) {
        return has_light(light_source_at(of_source), light) ? probability_within(light) : 0.0;
    }
    if (MANY_SOURCES) {
        return probability_for(position, normal, light);
    }
    return light_at(light).probability;
}

// What comes along a ray that a direction of the BSDF has chosen, and the density of that direction by lights.
vec3 radiance_along(vec3 ray, Hit hit, vec3 position, vec3 normal, uint of_source, Random random, out float density) {
    vec3 radiance = vec3(0.0);
    density = 0.0;
    if (hit.triangle == MISS) {
        if (ENVIRONMENT) {
            Sky sky = environment_at(ray);
            float probability = probability_of_light(position, normal, of_source, settings.light_count - 1u);
            radiance = FEW_SOURCES && probability <= 0.0 ? vec3(0.0) : sky.radiance;
            density = sky.density * probability;
        }
    } else {
        Surface emitter = interface_at(hit, ray, IN_VACUUM, false, random).surface;
        if (emitter.light != NO_LIGHT) {
            // A ray that met the light had its chance to pass it.
            uint light = light_at_place(emitter);
            vec3 towards;
            radiance = radiance_of(emitter, light, probability_of_light(position, normal, of_source, light), position, towards,
                                   density);
        }
    }
    return radiance;
}

// One ray, by chance towards a point of a light or along a direction of the BSDF, with the density of both together
// (one-sample multiple importance sampling: Veach, 1997, section 9.2.4). The lights' points alone have an unbounded
// variance next to a light. What a light would bring is known before its ray is traced, so that little else is at hand then.
// behind_glass: glass stands before the light, so that this is what it would bring unbent.
vec3 sample_direct(VisiblePoint visible_point, uint slot, uint of_source, bool asks, inout Random random,
                   out bool behind_glass) {
    behind_glass = false;
    vec4 u = next4(random);
    // What chooses among many lights needs more digits.
    vec4 digits = settings.light_count > 1u ? next4(random) : vec4(0.0);

    vec3 position = visible_point.position_object.xyz;
    vec3 geometric_normal = decode_direction(floatBitsToUint(visible_point.weight_normal.w));
    vec3 shading_normal = decode_direction(floatBitsToUint(visible_point.emitted_normal.w));
    vec3 origin = offset_origin(position, geometric_normal, reach_of(floatBitsToUint(visible_point.position_object.w)));
    LightSample sampled;
    sampled.ray = cosine_direction(shading_normal, u.yz);
    sampled.end = 1e30;
    sampled.ignored = NO_TRIANGLE;
    sampled.radiance = vec3(1.0);
    sampled.density = 0.0;
    sampled.delta = false;
    // A reflection may be too narrow for points of lights to find it.
    Reflector reflector = NO_REFLECTOR;
    vec3 viewer = vec3(0.0);
    float bsdf_sampling = is_near_light(position) ? settings.bsdf_sampling : 0.0;
    float reflections = 0.0; // of the directions of the BSDF
    if (GLOSSY) {
        Gloss gloss = GLOSS(GlossOf, slot);
        reflector = reflector_of(gloss);
        viewer = decode_direction(floatBitsToUint(gloss.diffuse_viewer.w));
        if (reflector.alpha > 0.0 && settings.near_light_count > 0u) {
            bsdf_sampling = 0.5;
            reflections = reflection_probability(reflector, dot(shading_normal, viewer));
            if (u.x < reflections) {
                sampled.ray = reflected_direction(reflector.alpha, shading_normal, viewer, u.yz);
            }
        }
    }
    if (FEW_SOURCES) {
        bsdf_sampling = is_punctual(light_source_at(of_source).kind) ? 0.0 : bsdf_sampling;
    }
    bool by_bsdf = u.w < bsdf_sampling;
    sampled.towards = sampled.ray;
    if (!by_bsdf) {
        sampled = sample_light(position, shading_normal, origin, of_source, u.xyz, digits.xz);
    }
    vec3 ray = sampled.ray;
    float cos_surface = dot(sampled.towards, shading_normal);
    bool leaves = dot(ray, geometric_normal) > 0.0 && dot(ray, shading_normal) > 0.0 && cos_surface > 0.0;
    float of_bsdf = cos_surface / PI;
    vec3 weight = visible_point.weight_normal.rgb * cos_surface;
    if (GLOSSY) {
        weight *= brdf(reflector, shading_normal, viewer, sampled.towards);
        if (reflector.alpha > 0.0) {
            float of_lobe = reflected_density(reflector.alpha, shading_normal, viewer, sampled.towards);
            of_bsdf = mix(of_bsdf, of_lobe, reflections);
        }
    }
    of_bsdf *= bsdf_sampling;
    float by_light = 1.0 - bsdf_sampling;
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
        goes_on = ASKS_BEHIND_GLASS && asks && hit.triangle != MISS && !loops_cut && crossings < DIRECT_CROSSINGS;
        if (goes_on) {
            ShadingTriangle triangle = shading_triangle(hit.triangle);
            Material glass = material_at(triangle.material);
            goes_on = is_dielectric(glass) && !(by_bsdf && triangle.light != NO_LIGHT);
            // Of any hits the first one isn't known: the ray starts anew.
            if (goes_on && !any) {
                Surface met = surface_at(hit);
                behind_glass = true;
                brings *= glass.base_color;
                from = origin_towards(met, ray);
                passed = dot(from - origin, ray) / dot(ray, ray);
                crossings += 1u;
            }
            any = false;
        }
    }
    bool is_cut = loops_cut;
    if (by_bsdf && largest(brings) > 0.0 && !is_cut) {
        float density;
        vec3 radiance = radiance_along(ray, hit, position, shading_normal, of_source, random, density);
        brings *= radiance / (by_light * density + of_bsdf);
    }
    bool blocked = !by_bsdf && hit.triangle != MISS;
    if (is_cut) {
        atomicAdd(status.cut_paths, behind_glass ? 0u : 1u);
    }
    return is_cut || blocked ? vec3(0.0) : brings;
}

// Adds what it brings, or what that would be unbent.
void add_direct(VisiblePoint visible_point, uint slot, uint of_source, bool asks, inout Random random, inout vec3 radiance,
                inout float unbent) {
    bool behind_glass;
    vec3 sampled = sample_direct(visible_point, slot, of_source, asks, random, behind_glass);
    if (behind_glass) {
        unbent += finite(sampled) ? mean_of(sampled) : 0.0;
    } else {
        radiance += sampled;
    }
}

void main() {
    uint slot = invocation_index();
    if (slot >= slots() || status.again != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(VisiblePoints, slot);
    bool has_object = floatBitsToUint(visible_point.position_object.w) != NO_OBJECT;
    bool met = has_object || floatBitsToUint(visible_point.weight_normal.w) != 0u;
    coverage[slot].met += met ? 1u : 0u;
    vec3 radiance = visible_point.emitted_normal.rgb;
    float unbent = 0.0;
    bool asks = false;
    if (SAMPLE_LIGHTS && has_object) {
        asks = asks_behind_glass(slot);
        CameraTurn turn = CameraTurn(push.iteration, push.path, push.paths);
        Random random = random_of_pixel(LIGHT_SAMPLE, slot, turn, settings.seed);
        // Not one loop for both: around a single question it costs a quarter of the stage.
        if (FEW_SOURCES) {
            for (uint source = 0u; source < settings.light_source_count; source++) {
                add_direct(visible_point, slot, source, asks, random, radiance, unbent);
            }
        } else {
            add_direct(visible_point, slot, 0u, asks, random, radiance, unbent);
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
    sum.low.w += asks ? 1.0 : 0.0;
    direct_sums[slot] = sum;
    sequence_sums[slot].rgb += radiance;
}
