// Choosing a source of light for a point: each of a few sources, or one of many by a bound of its irradiance. Conty Estévez and
// Kulla, «Importance Sampling of Many Lights with Adaptive Tree Splitting», HPG 2018.
#ifndef LIGHTS_LIGHT_SOURCES
#define LIGHTS_LIGHT_SOURCES

#include "lights/light.glsl"

layout(constant_id = 28) const bool FEW_SOURCES = false; // but more than one
layout(constant_id = 29) const bool MANY_SOURCES = false;

uniform usamplerBuffer LightSources;

LightSource light_source_at(uint i) {
    return LIGHT_SOURCE(LightSources, i);
}

// Cosine of the difference of two angles, or 1 where the first is the smaller one.
float cos_beyond(float cos_a, float cos_b) {
    float sines = sqrt(max(0.0, 1.0 - cos_a * cos_a) * max(0.0, 1.0 - cos_b * cos_b));
    return cos_a >= cos_b ? 1.0 : cos_a * cos_b + sines;
}

// Upper bound of the irradiance, up to a constant factor.
float irradiance_bound(LightSource source, vec3 position, vec3 normal) {
    vec3 to_centre = source.centre - position;
    float distance2 = dot(to_centre, to_centre);
    float radius2 = source.radius * source.radius;
    float most = source.strength / max(radius2, 1e-37);
    if (source.kind == ENVIRONMENT_LIGHT) {
        most = source.strength;
    } else if (source.kind == DIRECTIONAL_LIGHT) {
        most = source.strength * max(0.0, cos_beyond(-dot(normal, source.axis), source.cos_cone));
    } else if (distance2 > radius2) {
        float inverse_distance = inversesqrt(max(distance2, 1e-37));
        // The angle that its bounding sphere subtends.
        float cos_width = sqrt(max(0.0, 1.0 - radius2 / distance2));
        float cos_surface = cos_beyond(dot(normal, to_centre) * inverse_distance, cos_width);
        float cos_light =
            cos_beyond(cos_beyond(-dot(source.axis, to_centre) * inverse_distance, source.cos_cone), cos_width);
        bool is_lambertian = source.kind == TRIANGLE_LIGHT;
        cos_light = is_lambertian ? max(cos_light, 0.0) : (cos_light >= 1.0 ? 1.0 : 0.0);
        bool in_range = (1.0 / inverse_distance - source.radius) * source.inverse_range < 1.0;
        most = in_range ? source.strength * max(0.0, cos_surface) * cos_light * inverse_distance * inverse_distance : 0.0;
    }
    return most;
}

bool has_light(LightSource source, uint light) {
    return light - source.first_light < source.light_count;
}

// The bounds of all sources.
struct SourceBounds {
    float all;
    float probability; // independent of the point, of all sources with a bound above 0
    // Of the source of a given light.
    float by_one;
    float probability_of_one;
};

SourceBounds source_bounds(vec3 position, vec3 normal, uint light) {
    SourceBounds bounds = SourceBounds(0.0, 0.0, 0.0, 0.0);
    for (uint i = 0u; i < settings.light_source_count; i++) {
        loop_count += 1u;
        LightSource source = light_source_at(i);
        float most = irradiance_bound(source, position, normal);
        bounds.all += most;
        bounds.probability += most > 0.0 ? source.probability : 0.0;
        bool is_one = has_light(source, light);
        bounds.by_one = is_one ? most : bounds.by_one;
        bounds.probability_of_one = is_one ? source.probability : bounds.probability_of_one;
    }
    return bounds;
}

// If all bounds are 0, any choice is right.
float probability_of_source(SourceBounds bounds, float most, float without_point) {
    float with_point = most > 0.0 ? mix(most / bounds.all, without_point / bounds.probability, WITHOUT_POINT) : 0.0;
    return bounds.all <= 0.0 ? without_point : with_point;
}

struct LightChoice {
    uint light;
    float probability;
};

// u chooses the source and u_light, a multiple of 2⁻²⁴, the light.
LightChoice choose_light_for(vec3 position, vec3 normal, float u, float u_light) {
    SourceBounds bounds = source_bounds(position, normal, 0u);
    LightSource chosen = light_source_at(0u);
    float probability = 0.0;
    float sum = 0.0;
    for (uint i = 0u; i < settings.light_source_count && sum <= u; i++) {
        loop_count += 1u;
        LightSource source = light_source_at(i);
        float of_source = probability_of_source(bounds, irradiance_bound(source, position, normal), source.probability);
        sum += of_source;
        // By rounding, u may lie beyond the sum: then the last source with a probability is chosen.
        bool counts = of_source > 0.0;
        probability = counts ? of_source : probability;
        if (counts) {
            chosen = source;
        }
    }
    LightWithin within = light_within(chosen.first_light, chosen.light_count, u_light);
    return LightChoice(within.light, probability * within.probability);
}

// The probability of a light in `choose_light_for`.
float probability_for(vec3 position, vec3 normal, uint light) {
    SourceBounds bounds = source_bounds(position, normal, light);
    float of_source = probability_of_source(bounds, bounds.by_one, bounds.probability_of_one);
    return of_source * probability_within(light);
}

#endif
