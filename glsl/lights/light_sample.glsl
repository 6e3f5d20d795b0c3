// Light samples at a point: a point of a light, or the light along a direction, each with its density. Include after
// common/random.glsl.
#ifndef LIGHTS_LIGHT_SAMPLE
#define LIGHTS_LIGHT_SAMPLE

#include "lights/environment.glsl"
#include "lights/light_sources.glsl"
#include "trace/interaction.glsl"

uniform usamplerBuffer NearLights;

// A point that receives light.
struct LightReceiver {
    vec3 position;
    vec3 normal;
    vec3 origin; // of rays
    uint source; // FEW_SOURCES: the source that is sampled
};

// A ray towards a light, and the unoccluded light along it.
struct LightSample {
    vec3 ray;
    float end;  // of the ray, in its lengths
    PlacedTriangle ignored;
    vec3 towards;  // unit vector to the light's point
    vec3 radiance; // of delta lights: irradiance across the ray
    float density; // per solid angle
    bool delta;    // no BSDF sample can hit the light
};

// Along a direction that was not chosen by light sampling.
LightSample ray_along(vec3 direction) {
    return LightSample(direction, 1e30, NO_TRIANGLE, direction, vec3(1.0), 0.0, false);
}

// The light from a point of an emissive triangle at a position, without the opacity of the triangle, and the density of that
// point.
LightSample sample_of_point(Hit hit, uint light, float probability, vec3 position) {
    // Textures come first: the surface would hold registers.
    Material material = emitter_at(hit);
    Surface emitter = surface_at(hit);
    LightSample sampled = ray_along(vec3(0.0));
    vec3 to_light = emitter.position - position;
    float distance2 = dot(to_light, to_light);
    sampled.towards = to_light * inversesqrt(max(distance2, 1e-37));
    float cos_light = -dot(sampled.towards, emitter.geometric_normal);
    bool emitting = emits(material, cos_light > 0.0) && cos_light != 0.0 && probability > 0.0;
    sampled.density = emitting ? probability * distance2 / (light_at(light).area * abs(cos_light)) : 1.0;
    sampled.radiance = emitting ? emitted_radiance(material, abs(cos_light)) : vec3(0.0);
    if (IMMERSED) {
        // Both are in the medium of the light.
        sampled.radiance *= transmittance(media_of_light(light).first, sqrt(distance2));
    }
    return sampled;
}

LightChoice choose_light_of(LightReceiver receiver, float u, vec2 digits) {
    LightChoice choice = LightChoice(0u, 0.0);
    if (FEW_SOURCES) {
        LightSource source = light_source_at(receiver.source);
        LightWithin within = light_within(source.first_light, source.light_count, digits.x);
        choice = LightChoice(within.light, within.probability);
    } else if (MANY_SOURCES) {
        choice = choose_light_for(receiver.position, receiver.normal, u, digits.x);
    } else {
        choice.light = choose_light(u, digits).index;
        choice.probability = light_at(choice.light).probability;
    }
    return choice;
}

// A sample of the light that u.x chooses; with FEW_SOURCES, of the receiver's source.
LightSample sample_light(LightReceiver receiver, vec3 u, vec2 digits) {
    LightChoice choice = choose_light_of(receiver, u.x, digits);
    Light light = light_at(choice.light);
    LightSample sampled = ray_along(vec3(0.0));
    if (is_punctual(light.kind)) {
        Arriving arriving = arriving_from(light, receiver.origin, u.yz);
        sampled.ray = arriving.ray;
        sampled.end = arriving.end;
        sampled.towards = normalize(arriving.ray);
        sampled.radiance = arriving.irradiance / choice.probability;
        if (IMMERSED) {
            sampled.radiance *= transmittance(media_of_light(choice.light).first, length(arriving.ray));
        }
        sampled.density = 1.0;
        sampled.delta = true;
    } else if (is_environment(light.kind)) {
        EnvironmentSample environment = sample_environment(u.yz, sampled.ray);
        sampled.towards = normalize(sampled.ray);
        sampled.radiance = environment.radiance;
        sampled.density = environment.density * choice.probability;
    } else {
        PlacedTriangle triangle = PlacedTriangle(light.triangle, NO_INSTANCE);
        Hit hit = hit_at(triangle, point_of_light(light, u.yz));
        float light_opacity = opacity(hit);
        sampled = sample_of_point(hit, choice.light, choice.probability, receiver.position);
        sampled.radiance *= light_opacity;
        // Both ends are offset from their surfaces.
        Surface emitter = surface_at(hit);
        sampled.ray = origin_towards(emitter, receiver.position - emitter.position) - receiver.origin;
        sampled.end = 1.0 - ENDS_BEFORE;
        sampled.ignored = triangle;
    }
    return sampled;
}

// The probability of a light that a ray has hit; 0 if it does not belong to the sampled source.
float probability_of_light(LightReceiver receiver, uint light) {
    float probability = 0.0;
    if (FEW_SOURCES) {
        probability = has_light(light_source_at(receiver.source), light) ? probability_within(light) : 0.0;
    } else if (MANY_SOURCES) {
        probability = probability_for(receiver.position, receiver.normal, light);
    } else {
        probability = light_at(light).probability;
    }
    return probability;
}

// The light along a ray of a BSDF sample, and the density of that direction by light sampling.
LightSample light_along(LightReceiver receiver, vec3 ray, Hit hit, Random random) {
    LightSample found = ray_along(ray);
    found.radiance = vec3(0.0);
    uint light = NO_LIGHT;
    if (hit.triangle != MISS) {
        hit = preferred_face(hit, ray, random);
        light = light_at_place(hit);
    } else if (ENVIRONMENT) {
        light = settings.light_count - 1u;
    }
    if (light != NO_LIGHT) {
        float probability = probability_of_light(receiver, light);
        if (hit.triangle != MISS) {
            // Opacity was decided when the ray hit the light.
            LightSample point = sample_of_point(hit, light, probability, receiver.position);
            found.radiance = point.radiance;
            found.density = point.density;
        } else if (ENVIRONMENT) {
            EnvironmentSample environment = environment_at(ray);
            found.radiance = FEW_SOURCES && probability <= 0.0 ? vec3(0.0) : environment.radiance;
            found.density = environment.density * probability;
        }
    }
    return found;
}

// Whether a light is so near that the squared distance to its points varies strongly.
bool is_near_light(vec3 position) {
    bool near = false;
    for (uint i = 0u; i < settings.near_light_count && !near; i++) {
        vec4 sphere = TEXEL(NearLights, i);
        vec3 apart = position - sphere.xyz;
        near = dot(apart, apart) <= sphere.w;
    }
    return near;
}

// Whether no BSDF sample can hit the sampled source.
bool is_delta_source(LightReceiver receiver) {
    bool is_delta = false;
    if (FEW_SOURCES) {
        is_delta = is_punctual(light_source_at(receiver.source).kind);
    }
    return is_delta;
}

#endif
