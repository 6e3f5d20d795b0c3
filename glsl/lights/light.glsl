// Lights, and the light of one of them at a point. Include after settings.glsl.
#ifndef LIGHTS_LIGHT
#define LIGHTS_LIGHT

#include "bsdf/fresnel.glsl"
#include "lights/alias_table.glsl"
#include "trace/media.glsl"

layout(constant_id = 14) const bool PUNCTUAL_LIGHTS = false;
layout(constant_id = 30) const bool SOFT_LIGHTS = false; // some punctual lights have an extent or a smooth falloff
layout(constant_id = 15) const bool ENVIRONMENT = false;
layout(constant_id = 31) const bool PARTED_LIGHTS = false; // triangles whose parts are lights

uniform usamplerBuffer Lights;
uniform usamplerBuffer MediaOfLights;

Light light_at(uint i) {
    return LIGHT(Lights, i);
}

// The media that a light is in.
Media media_of_light(uint light) {
    Media media = IN_VACUUM;
    if (IMMERSED) {
        media = media_from(TEXEL_BITS(MediaOfLights, light));
    }
    return media;
}

// Barycentric coordinates of a point of a triangle's light.
vec2 point_of_light(Light light, vec2 u) {
    vec2 uv = triangle_point(u);
    if (PARTED_LIGHTS) {
        // The part of the triangle: column, row, number of columns. See packing::part.
        vec3 part = light.position;
        vec2 at = (part.xy + uv) / part.z;
        uv = part.x + part.y >= part.z ? 1.0 - at : at;
    }
    return uv;
}

bool is_light(Hit hit) {
    return shading_triangle(hit.triangle).light != NO_LIGHT;
}

// The light that a point of a triangle belongs to; NO_LIGHT if it does not emit.
uint light_at_place(Hit hit) {
    uint light = shading_triangle(hit.triangle).light;
    if (PARTED_LIGHTS && light != NO_LIGHT) {
        float n = light_at(light).position.z;
        vec2 at = vec2(hit.u, hit.v) * n;
        float row = clamp(floor(at.y), 0.0, n - 1.0);
        float column = clamp(floor(at.x), 0.0, n - 1.0 - row);
        bool upside_down = at.x - column + at.y - row > 1.0 && column + row + 1.0 < n;
        vec2 cell = vec2(column, row);
        cell = upside_down ? n - 1.0 - cell : cell;
        light += uint(cell.y * n + cell.x);
    }
    return light;
}

bool is_punctual(uint kind) {
    return PUNCTUAL_LIGHTS && (kind == POINT_LIGHT || kind == SPOT_LIGHT || kind == DIRECTIONAL_LIGHT);
}

bool is_environment(uint kind) {
    return ENVIRONMENT && kind == ENVIRONMENT_LIGHT;
}

float cumulative_probability(uint light) {
    return light_at(light).cumulative;
}

struct LightWithin {
    uint light;
    float probability; // within its source
};

// Of a source's lights the one that a number chooses, a multiple of 2⁻²⁴ as their cumulative probabilities are.
LightWithin light_within(uint first, uint count, float e) {
    uint low = first;
    uint high = first + count - 1u;
    float before = 0.0;
    float end = 1.0;
    while (low < high) {
        uint middle = (low + high) / 2u;
        float cumulative = cumulative_probability(middle);
        if (e < cumulative) {
            high = middle;
            end = cumulative;
        } else {
            low = middle + 1u;
            before = cumulative;
        }
    }
    return LightWithin(low, end - before);
}

// A light's probability within its source. The last one before those of a source has 1.
float probability_within(uint light) {
    float before = light > 0u ? cumulative_probability(light - 1u) : 0.0;
    return cumulative_probability(light) - (before < 1.0 ? before : 0.0);
}

Choice choose_light(float u, vec2 digits) {
    AliasPlace place = alias_place(settings.light_count, u, digits);
    Light entry = light_at(place.cell);
    return alias_choice(place, entry.accept, entry.alias);
}

// Radiance at this cosine to the normal. Lamps may have a clear coat.
vec3 emitted_radiance(Material material, float cosine) {
    float passed = 1.0;
    if (CLEARCOAT) {
        passed = coat_passes(material.coat, cosine);
    }
    return passed * material.emission;
}

// The share of a spot's intensity at 1 − cos of the angle from its axis: the square of a ramp in the cosine, as
// KHR_lights_punctual recommends, or its smoothstep.
float spot_falloff(Light light, float versine) {
    float ramp = clamp((light.outer - versine) / (light.outer - light.inner), 0.0, 1.0);
    float falloff = ramp * ramp;
    if (SOFT_LIGHTS) {
        falloff *= 1.0 + light.area * (2.0 - 2.0 * ramp);
    }
    return falloff;
}

// The attenuation of a light with a range at a distance: KHR_lights_punctual's window over the inverse square.
float range_window(float inverse_range, float distance) {
    float left = 1.0;
    if (PUNCTUAL_LIGHTS) {
        float part = distance * inverse_range;
        float part2 = part * part;
        left = clamp(1.0 - part2 * part2, 0.0, 1.0);
    }
    return left;
}

// The light of a punctual light at a point without occlusion; if the light has an extent, from the point of it that u chooses.
struct Arriving {
    vec3 ray;        // towards the light
    float end;       // of the ray, in its lengths
    vec3 irradiance; // across the ray
};

Arriving arriving_from(Light light, vec3 point, vec2 u) {
    bool distant = light.kind == DIRECTIONAL_LIGHT;
    bool is_soft = SOFT_LIGHTS && light.extent > 0.0;
    vec3 ray = distant ? -light.direction : light.position - point;
    float distance2 = max(dot(ray, ray), 1e-37);
    float area_over_angle = distance2; // area of the light over the solid angle that it subtends
    if (is_soft) {
        // A disc that faces the receiver subtends the same solid angle as a sphere; within its radius, a hemisphere.
        float radius2 = light.extent * light.extent;
        float sin2 = radius2 / distance2;
        float versine = sin2 < 1.0 ? sin2 / (1.0 + sqrt(1.0 - sin2)) : 1.0;
        vec3 axis = ray * (distant ? 1.0 : inversesqrt(distance2));
        vec3 towards = direction_in_cone(axis, distant ? light.extent : versine, u);
        float way = distant ? 1.0 : max(dot(towards, ray), 1e-18);
        ray = way * towards;
        distance2 = way * way;
        area_over_angle = radius2 / (2.0 * versine);
    }
    vec3 irradiance = light.intensity;
    if (!distant) {
        irradiance *= range_window(light.inverse_range, sqrt(distance2)) / area_over_angle;
    }
    if (light.kind == SPOT_LIGHT) {
        vec3 off_axis = ray * inversesqrt(distance2) + light.direction;
        irradiance *= spot_falloff(light, 0.5 * dot(off_axis, off_axis));
    }
    return Arriving(ray, distant ? 1e30 : 1.0, irradiance);
}

#endif
