// Lights. Include after scene.glsl.

#include "alias_table.glsl"

const uint TRIANGLE_LIGHT = 0u;
const uint POINT_LIGHT = 1u;
const uint SPOT_LIGHT = 2u;
const uint DIRECTIONAL_LIGHT = 3u;
const uint ENVIRONMENT_LIGHT = 4u;

// Mirrors the first texel of `layout::Light`: all there is of a triangle.
struct Light {
    uint triangle;
    float probability; // nearly in proportion to its flux
    float area;        // of the triangle, or of the disc that a distant light's photons start from; render units²
    uint kind;
};

// The rest of `layout::Light`, without the second texel: the table's cell, and the light's place within its source.
struct PunctualLight {
    vec3 intensity;      // point, spot: along the axis. Directional: irradiance across the rays
    vec3 position;       // directional: centre of the disc
    vec3 direction;      // that it shines along
    float inner;         // spot: 1 − cos of the angle where it begins to fall off
    float outer;         // spot: 1 − cos of the angle where it ends
    float inverse_range; // point, spot: 0 where it has no range
};

uniform usamplerBuffer Lights;

const uint LIGHT_TEXELS = 5u;

Light light_at(uint i) {
    uvec4 bits = TEXEL_BITS(Lights, LIGHT_TEXELS * i);
    return Light(bits.x, uintBitsToFloat(bits.y), uintBitsToFloat(bits.z), bits.w);
}

PunctualLight punctual_light_at(uint i) {
    vec4 intensity_inner = TEXEL(Lights, LIGHT_TEXELS * i + 2u);
    vec4 position_outer = TEXEL(Lights, LIGHT_TEXELS * i + 3u);
    vec4 direction_range = TEXEL(Lights, LIGHT_TEXELS * i + 4u);
    return PunctualLight(intensity_inner.rgb, position_outer.xyz, direction_range.xyz, intensity_inner.w,
                         position_outer.w, direction_range.w);
}

bool is_punctual(uint kind) {
    return kind == POINT_LIGHT || kind == SPOT_LIGHT || kind == DIRECTIONAL_LIGHT;
}

Choice choose_light(float u, vec2 digits) {
    AliasPlace place = alias_place(settings.light_count, u, digits);
    vec4 entry = TEXEL(Lights, LIGHT_TEXELS * place.cell + 1u);
    return alias_choice(place, entry.x, floatBitsToUint(entry.y));
}

// Whether light leaves on the triangle's front, or on its back.
bool emits(Material material, bool front) {
    return front || (material.flags & BACK_EMITS) != 0u;
}

// Radiance at this cosine to the normal: a coat lies on lamps too.
vec3 emitted_radiance(Material material, float cosine) {
    float passed = 1.0;
    if (CLEARCOAT) {
        passed = coat_passes(material.coat, cosine);
    }
    return passed * material.emission;
}

// How much of its intensity a spot has at 1 − cos of the angle from its axis: the square of a ramp in the cosine, as
// KHR_lights_punctual recommends.
float spot_falloff(PunctualLight light, float versine) {
    float ramp = clamp((light.outer - versine) / (light.outer - light.inner), 0.0, 1.0);
    return ramp * ramp;
}

// What a light with a range has left at a distance: KHR_lights_punctual's window over the inverse square.
float range_window(float inverse_range, float distance) {
    float part = distance * inverse_range;
    float part2 = part * part;
    return clamp(1.0 - part2 * part2, 0.0, 1.0);
}

// What reaches a point from a punctual light if nothing is between.
struct Arriving {
    vec3 ray;        // to the light, or towards where it comes from
    float end;       // of the ray, in its lengths
    vec3 irradiance; // across the ray
};

Arriving arriving_from(PunctualLight light, uint kind, vec3 point) {
    if (kind == DIRECTIONAL_LIGHT) {
        return Arriving(-light.direction, 1e30, light.intensity);
    }
    vec3 ray = light.position - point;
    float distance2 = max(dot(ray, ray), 1e-37);
    vec3 irradiance = light.intensity * (range_window(light.inverse_range, sqrt(distance2)) / distance2);
    if (kind == SPOT_LIGHT) {
        vec3 off_axis = ray * inversesqrt(distance2) + light.direction;
        irradiance *= spot_falloff(light, 0.5 * dot(off_axis, off_axis));
    }
    return Arriving(ray, 1.0, irradiance);
}
