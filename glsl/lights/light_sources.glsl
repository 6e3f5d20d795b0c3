// Which source of light a point asks: each of a few, or one by what each can bring to it at the most. Conty Estévez and Kulla, «Importance Sampling of
// Many Lights with Adaptive Tree Splitting», HPG 2018.
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

// Irradiance at the most, up to a factor.
float most_from(LightSource source, vec3 position, vec3 normal) {
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
        // The angle that its sphere is seen at.
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

// What all sources can bring.
struct Brought {
    float all;
    float probability; // without knowing the point, of all that can bring anything
    // By the one that has a light.
    float by_one;
    float probability_of_one;
};

Brought brought_to(vec3 position, vec3 normal, uint light) {
    Brought brought = Brought(0.0, 0.0, 0.0, 0.0);
    for (uint i = 0u; i < settings.light_source_count; i++) {
        loop_count += 1u;
        LightSource source = light_source_at(i);
        float most = most_from(source, position, normal);
        brought.all += most;
        brought.probability += most > 0.0 ? source.probability : 0.0;
        bool is_one = has_light(source, light);
        brought.by_one = is_one ? most : brought.by_one;
        brought.probability_of_one = is_one ? source.probability : brought.probability_of_one;
    }
    return brought;
}

// Where none can bring anything, nothing is lost by any choice.
float probability_of_source(Brought brought, float most, float without_point) {
    float with_point = most > 0.0 ? mix(most / brought.all, without_point / brought.probability, WITHOUT_POINT) : 0.0;
    return brought.all <= 0.0 ? without_point : with_point;
}

struct LightChoice {
    uint light;
    float probability;
};

// u chooses the source and u_light, a multiple of 2⁻²⁴, the light.
LightChoice choose_light_for(vec3 position, vec3 normal, float u, float u_light) {
    Brought brought = brought_to(position, normal, 0u);
    LightSource chosen = light_source_at(0u);
    float probability = 0.0;
    float sum = 0.0;
    for (uint i = 0u; i < settings.light_source_count && sum <= u; i++) {
        loop_count += 1u;
        LightSource source = light_source_at(i);
        float of_source = probability_of_source(brought, most_from(source, position, normal), source.probability);
        sum += of_source;
        // Rounding may leave the last number beyond all: the last source that can be chosen has it.
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
    Brought brought = brought_to(position, normal, light);
    float of_source = probability_of_source(brought, brought.by_one, brought.probability_of_one);
    return of_source * probability_within(light);
}

#endif
