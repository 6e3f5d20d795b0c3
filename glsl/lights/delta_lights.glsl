// Delta lights, which no BSDF sample hits: their contribution to lobes that camera paths follow, by a ray to a light; and the
// radiance along a ray of punctual lights with an extent. Include after common/random.glsl.
#ifndef LIGHTS_DELTA_LIGHTS
#define LIGHTS_DELTA_LIGHTS

#include "bsdf/bsdf.glsl"
#include "lights/light.glsl"

// A shadow ray to a light, and the light's contribution if it is visible.
struct LightRay {
    vec3 origin;
    vec3 direction;
    float end; // in its lengths
    vec3 contribution;
};

const LightRay NO_LIGHT_RAY = LightRay(vec3(0.0), vec3(0.0), 0.0, vec3(0.0));

bool contributes(LightRay ray) {
    return PUNCTUAL_LIGHTS && largest(ray.contribution) > 0.0;
}

// The contribution of a light to a followed lobe.
LightRay ray_to_light(uint index, vec2 place, SurfaceInteraction met, vec3 viewer) {
    Light light = light_at(index);
    LightRay result = NO_LIGHT_RAY;
    if (is_punctual(light.kind)) {
        vec3 origin = origin_towards(met.surface, arriving_from(light, met.surface.position, place).ray);
        Arriving arriving = arriving_from(light, origin, place);
        vec3 l = normalize(arriving.ray);
        vec3 response = evaluate_followed(met, viewer, l);
        if (ABSORPTION) {
            bool same_side = dot(l, met.frame.geometric_normal) > 0.0;
            float way = light.kind == DIRECTIONAL_LIGHT ? 1e30 : length(arriving.ray);
            response *= transmittance(same_side ? met.through.first : met.beyond.first, way);
        }
        result = LightRay(origin, arriving.ray, arriving.end, response * arriving.irradiance);
    }
    return result;
}

// Whether delta lights contribute to the followed lobe.
bool shows_delta_lights(Material material) {
    return PUNCTUAL_LIGHTS && has_width(material);
}

// Random numbers of their own: the path's numbers do not depend on whether a light is sampled.
float delta_light_number(Random random, uint i) {
    return number_of(random, uvec2(i, DELTA_LIGHT_NUMBERS));
}

vec2 delta_light_place(Random random) {
    vec2 place = vec2(0.0);
    if (SOFT_LIGHTS) {
        place = vec2(delta_light_number(random, 3u), delta_light_number(random, 4u));
    }
    return place;
}

// To a light chosen at random.
LightRay sample_delta_light(SurfaceInteraction met, vec3 viewer, Random random) {
    vec2 digits = vec2(delta_light_number(random, 1u), delta_light_number(random, 2u));
    uint chosen = choose_light(delta_light_number(random, 0u), digits).index;
    LightRay ray = ray_to_light(chosen, delta_light_place(random), met, viewer);
    ray.contribution *= 1.0 / light_at(chosen).probability;
    return ray;
}

// By a ray to each light, for estimators that find visible points once.
vec3 all_delta_lights(SurfaceInteraction met, vec3 viewer, Random random) {
    vec3 sum = vec3(0.0);
    // Triangles come first in the table, and may be many.
    for (uint i = settings.light_count; i > 0u && light_at(i - 1u).kind != TRIANGLE_LIGHT && !loops_cut; i--) {
        LightRay ray = ray_to_light(i - 1u, delta_light_place(random), met, viewer);
        if (contributes(ray)) {
            Hit hit = trace_visible(ray.origin, ray.direction, AT_ORIGIN, ray.end, NO_TRIANGLE, true, random);
            sum += hit.triangle == MISS ? ray.contribution : vec3(0.0);
        }
    }
    return sum;
}

// Radiance of the lights with an extent that a ray hits within `end` lengths of its unit direction. They follow the triangles in
// the table.
vec3 soft_lights_along(vec3 origin, vec3 direction, float end, uint medium) {
    vec3 sum = vec3(0.0);
    if (SOFT_LIGHTS) {
        for (uint i = settings.light_count; i > 0u && light_at(i - 1u).kind != TRIANGLE_LIGHT; i--) {
            loop_count += 1u;
            Light light = light_at(i - 1u);
            bool distant = light.kind == DIRECTIONAL_LIGHT;
            vec3 to_middle = light.position - origin;
            float way = distant ? 1e30 : dot(to_middle, direction);
            vec3 off_axis = distant ? direction + light.direction : to_middle - way * direction;
            float off2 = dot(off_axis, off_axis);
            bool met = distant ? 0.5 * off2 <= light.extent && end >= 1e30
                               : off2 <= light.extent * light.extent && way > 0.0 && way < end;
            if (met && is_punctual(light.kind) && light.extent > 0.0) {
                float area = distant ? 2.0 * PI * light.extent : PI * light.extent * light.extent;
                vec3 radiance = light.intensity / area;
                if (!distant) {
                    radiance *= range_window(light.inverse_range, way);
                }
                if (light.kind == SPOT_LIGHT) {
                    vec3 off_spot = direction + light.direction;
                    radiance *= spot_falloff(light, 0.5 * dot(off_spot, off_spot));
                }
                sum += radiance * transmittance(medium, way);
            }
        }
    }
    return sum;
}

#endif
