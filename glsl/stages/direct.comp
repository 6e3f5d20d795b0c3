#version 460
#extension GL_GOOGLE_include_directive : require
// Adds what each visible point's path saw of the lights: by itself and, unless photons carry direct light too, by one
// shadow ray to a point of a light chosen in proportion to its flux.

layout(local_size_x = 64) in;

#include "settings.glsl"
#include "sampling.glsl"
#include "random.glsl"
#include "texel.glsl"
#include "scene.glsl"
#include "intersect.glsl"
#include "bsdf.glsl"
#include "light.glsl"
#include "visible_point.glsl"
#include "two_float.glsl"
#include "statistics.glsl"
#include "status.glsl"

layout(constant_id = 3) const bool SAMPLE_LIGHTS = true;

layout(push_constant) uniform Push {
    uint iteration;
} push;

uniform usamplerBuffer VisiblePoints;
layout(std430) buffer DirectSums { DirectSum direct_sums[]; };

vec3 sample_light(VisiblePoint visible_point, uint slot) {
    Random random = random_for(LIGHT_SAMPLE, slot, push.iteration, settings.seed);
    vec4 u = next4(random);
    Light light = light_at(choose_light(u.x));
    vec2 uv = triangle_point(u.yz);
    Surface emitter = surface_at(light.triangle, uv);
    Material material = material_at(emitter.material);

    vec3 position = visible_point.position_object.xyz;
    vec3 geometric_normal = decode_direction(floatBitsToUint(visible_point.weight_normal.w));
    vec3 shading_normal = decode_direction(floatBitsToUint(visible_point.emitted_normal.w));
    vec3 to_light = emitter.position - position;
    float distance2 = dot(to_light, to_light);
    if (distance2 == 0.0) {
        return vec3(0.0);
    }
    vec3 direction = to_light * inversesqrt(distance2);
    float cos_light = -dot(direction, emitter.geometric_normal);
    float cos_surface = dot(direction, shading_normal);
    if (!emits(material, cos_light > 0.0) || cos_surface <= 0.0 || dot(direction, geometric_normal) <= 0.0) {
        return vec3(0.0);
    }
    vec3 towards_surface = cos_light > 0.0 ? emitter.geometric_normal : -emitter.geometric_normal;
    vec3 origin = offset_origin(position, geometric_normal);
    vec3 segment = offset_origin(emitter.position, towards_surface) - origin;
    Hit blocker = trace(origin, segment, 1.0, light.triangle, true);
    if (loops_cut) {
        atomicAdd(status.cut_paths, 1u);
    }
    if (blocker.triangle != MISS) {
        return vec3(0.0);
    }
    return visible_point.weight_normal.rgb * material.emission *
           (cos_surface * abs(cos_light) * light.area / (distance2 * light.probability));
}

void main() {
    uint slot = gl_GlobalInvocationID.x;
    if (slot >= pixel_slots() * settings.slots_per_pixel || status.again != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(slot);
    vec3 radiance = visible_point.emitted_normal.rgb;
    if (SAMPLE_LIGHTS && floatBitsToUint(visible_point.position_object.w) != NO_OBJECT) {
        radiance += sample_light(visible_point, slot);
    }
    if (!finite(radiance)) {
        atomicAdd(status.non_finite, 1u);
        return;
    }
    DirectSum sum = direct_sums[slot];
    add_to(sum.high.r, sum.low.r, radiance.r);
    add_to(sum.high.g, sum.low.g, radiance.g);
    add_to(sum.high.b, sum.low.b, radiance.b);
    direct_sums[slot] = sum;
}
