// What arrives at a point from the lights: a point of a light, or what lies along a direction, each with its density. Include after
// common/random.glsl.
#ifndef LIGHTS_LIGHT_SAMPLE
#define LIGHTS_LIGHT_SAMPLE

#include "lights/environment.glsl"
#include "lights/light_sources.glsl"
#include "trace/interaction.glsl"

uniform usamplerBuffer NearLights;

// A point that light is asked for.
struct LightReceiver {
    vec3 position;
    vec3 normal;
    vec3 origin; // of rays
    uint source; // FEW_SOURCES: of light, that is asked
};

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

// Along a direction that the lights have not chosen.
LightSample ray_along(vec3 direction) {
    return LightSample(direction, 1e30, NO_TRIANGLE, direction, vec3(1.0), 0.0, false);
}

// What a triangle's light sends to a place from a point, without its opacity, and the density of that point.
LightSample sample_of_point(Hit hit, uint light, float probability, vec3 position) {
    // Textures come first: what is known of the surface would hold registers.
    Material material = emitter_at(hit);
    Surface emitter = surface_at(hit);
    LightSample sampled = ray_along(vec3(0.0));
    vec3 to_light = emitter.position - position;
    float distance2 = dot(to_light, to_light);
    sampled.towards = to_light * inversesqrt(max(distance2, 1e-37));
    float cos_light = -dot(sampled.towards, emitter.geometric_normal);
    bool shines = emits(material, cos_light > 0.0) && cos_light != 0.0 && probability > 0.0;
    sampled.density = shines ? probability * distance2 / (light_at(light).area * abs(cos_light)) : 1.0;
    sampled.radiance = shines ? emitted_radiance(material, abs(cos_light)) : vec3(0.0);
    if (IMMERSED) {
        // What is between them is what the light is in.
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

// Of a light that u.x chooses, or one of that source.
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
        EnvironmentSample sky = sample_environment(u.yz, sampled.ray);
        sampled.towards = normalize(sampled.ray);
        sampled.radiance = sky.radiance;
        sampled.density = sky.density * choice.probability;
    } else {
        PlacedTriangle triangle = PlacedTriangle(light.triangle, NO_INSTANCE);
        Hit hit = hit_at(triangle, point_of_light(light, u.yz));
        float there = opacity(hit);
        sampled = sample_of_point(hit, choice.light, choice.probability, receiver.position);
        sampled.radiance *= there;
        // Both ends move off their surfaces.
        Surface emitter = surface_at(hit);
        sampled.ray = origin_towards(emitter, receiver.position - emitter.position) - receiver.origin;
        sampled.end = 1.0 - ENDS_BEFORE;
        sampled.ignored = triangle;
    }
    return sampled;
}

// The probability of a light for a ray that met it; 0 of one that isn't of the source that is asked.
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

// What comes along a ray that a direction of the BSDF has chosen, and the density of that direction by lights.
LightSample light_along(LightReceiver receiver, vec3 ray, Hit hit, Random random) {
    LightSample found = ray_along(ray);
    found.radiance = vec3(0.0);
    uint light = NO_LIGHT;
    if (hit.triangle != MISS) {
        hit = face_met(hit, ray, random);
        light = light_at_place(hit);
    } else if (ENVIRONMENT) {
        light = settings.light_count - 1u;
    }
    if (light != NO_LIGHT) {
        float probability = probability_of_light(receiver, light);
        if (hit.triangle != MISS) {
            // A ray that met the light had its chance to pass it.
            LightSample point = sample_of_point(hit, light, probability, receiver.position);
            found.radiance = point.radiance;
            found.density = point.density;
        } else if (ENVIRONMENT) {
            EnvironmentSample sky = environment_at(ray);
            found.radiance = FEW_SOURCES && probability <= 0.0 ? vec3(0.0) : sky.radiance;
            found.density = sky.density * probability;
        }
    }
    return found;
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

// Whether no direction of a BSDF meets the source that is asked.
bool asks_delta_source(LightReceiver receiver) {
    bool is_delta = false;
    if (FEW_SOURCES) {
        is_delta = is_punctual(light_source_at(receiver.source).kind);
    }
    return is_delta;
}

#endif
