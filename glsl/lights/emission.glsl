// Emission: the start of photon paths. Include after common/random.glsl.
#ifndef LIGHTS_EMISSION
#define LIGHTS_EMISSION

#include "lights/aim.glsl"
#include "lights/environment.glsl"
#include "trace/opacity.glsl"


struct Emission {
    vec3 origin;
    vec3 direction;
    vec3 flux;
    PlacedTriangle ignored; // the triangle that the ray leaves
    float inverse_range; // of a punctual light
};

// What a path has to pass through.
struct Target {
    bool everything; // no restriction
    vec4 sphere;
};

const Target EVERYTHING = Target(true, vec4(0.0));

// A start, and the data that decide which targets its ray hits.
struct AimedStart {
    Emission emission;
    vec3 passed;    // a point of the ray
    bool distant; // a line without origin: parallel light or environment
    bool on_target; // known from the sampling strategy
};

// A direction around an axis, with 1 − cos of the angle between them.
vec3 direction_off(vec3 axis, float versine, float turn) {
    float across = sqrt(max(0.0, versine * (2.0 - versine)));
    return normalize(basis(axis) * vec3(across * unit_vector_at(turn), 1.0 - versine));
}

// A step of Newton's method towards the place t within a spot's ramp up to which the falloff t²·(1 + smooth·(2 − 2t)) has an
// integral; `third` is (1 + 2·smooth) / 3.
float nearer_place(float t, float integral, float smoothness, float third) {
    float error = t * t * t * (third - 0.5 * smoothness * t) - integral;
    return t - error / max(t * t * (3.0 * third - 2.0 * smoothness * t), 1e-30);
}

// 1 − cos of a photon's angle from a spot's axis, sampled so that all photons have the same flux, and the solid angle that gives
// the same flux at full intensity: the integral of a squared ramp is a third of its width, that of a smoothstep a half.
float spot_versine(Light light, float u, out float solid_angle) {
    float ramp = light.outer - light.inner;
    float smoothness = SOFT_LIGHTS ? light.area : 0.0;
    float third = (1.0 + 2.0 * smoothness) / 3.0;
    float of_ramp = ramp * (third - 0.5 * smoothness);
    float whole = light.inner + of_ramp;
    solid_angle = 2.0 * PI * whole;
    float from_outside = u * whole;
    float integral = from_outside / ramp;
    float t = pow(integral / third, 1.0 / 3.0);
    if (SOFT_LIGHTS) {
        t = nearer_place(t, integral, smoothness, third);
        t = nearer_place(t, integral, smoothness, third);
        t = nearer_place(t, integral, smoothness, third);
    }
    return from_outside < of_ramp ? light.outer - ramp * t : whole - from_outside;
}

// Distant light of many directions: from a disc across the ray that covers the target, or the scene.
AimedStart emit_distant(vec3 towards, vec3 irradiance, float area, vec2 place, Target target) {
    // `area` is that of the scene's bounding sphere across the ray.
    float scene_radius = sqrt(area / PI);
    float radius = target.everything ? scene_radius : target.sphere.w;
    vec3 passed = target.sphere.xyz + basis(-towards) * vec3(radius * disc_point(place), 0.0);
    vec3 origin = passed + towards * (scene_radius - dot(target.sphere.xyz, towards));
    float disc = target.everything ? area : PI * radius * radius;
    return AimedStart(Emission(origin, -towards, irradiance * disc, NO_TRIANGLE, 0.0), passed, true, true);
}

// Parallel light: from a disc across the rays that covers the target, or the scene.
AimedStart emit_directional(Light light, vec2 place, vec2 turn, Target target) {
    AimedStart start;
    if (SOFT_LIGHTS && light.extent > 0.0) {
        vec3 towards = direction_in_cone(-light.direction, light.extent, turn);
        start = emit_distant(towards, light.intensity, light.area, place, target);
    } else {
        vec3 centre = target.everything ? light.position : target.sphere.xyz;
        float radius = target.everything ? sqrt(light.area / PI) : target.sphere.w;
        vec3 passed = centre + basis(light.direction) * vec3(radius * disc_point(place), 0.0);
        // From a plane before the scene.
        vec3 origin = passed;
        float area = light.area;
        if (!target.everything) {
            area = PI * radius * radius;
            origin -= light.direction * dot(passed - light.position, light.direction);
        }
        Emission emission = Emission(origin, light.direction, light.intensity * area, NO_TRIANGLE, 0.0);
        start = AimedStart(emission, passed, true, true);
    }
    return start;
}

AimedStart emit_environment(float area, vec2 place, vec2 direction, Target target) {
    vec3 towards;
    EnvironmentSample environment = sample_environment(direction, towards);
    return emit_distant(towards, environment.radiance / environment.density, area, place, target);
}

AimedStart emit_point(Light light, vec2 place, vec2 u, Target target) {
    Cone cone = Cone(vec3(0.0, 0.0, 1.0), 2.0);
    if (!target.everything) {
        // Rays start anywhere on the light's disc.
        cone = cone_of(target.sphere + vec4(vec3(0.0), SOFT_LIGHTS ? light.extent : 0.0), light.position);
    }
    float solid_angle = 2.0 * PI * cone.versine;
    vec3 intensity = light.intensity;
    vec3 direction;
    bool on_target = true;
    float spot_solid_angle = 0.0;
    float versine = 0.0;
    if (light.kind == SPOT_LIGHT) {
        versine = spot_versine(light, u.x, spot_solid_angle);
    }
    if (light.kind == SPOT_LIGHT && (target.everything || solid_angle >= spot_solid_angle)) {
        solid_angle = spot_solid_angle;
        direction = direction_off(light.direction, versine, u.y);
        on_target = false;
    } else if (target.everything) {
        direction = direction_off(cone.axis, 2.0 * u.x, u.y);
    } else {
        direction = direction_in_cone(cone.axis, cone.versine, u);
        if (light.kind == SPOT_LIGHT) {
            vec3 off_axis = direction - light.direction;
            intensity *= spot_falloff(light, 0.5 * dot(off_axis, off_axis));
        }
    }
    vec3 origin = light.position;
    if (SOFT_LIGHTS && light.extent > 0.0) {
        origin += basis(direction) * vec3(light.extent * disc_point(place), 0.0);
        on_target = false;
    }
    return AimedStart(Emission(origin, direction, intensity * solid_angle, NO_TRIANGLE, light.inverse_range), origin, false,
                      on_target);
}

AimedStart emit_triangle(Light light, vec2 place, vec2 u, float side, Target target) {
    PlacedTriangle triangle = PlacedTriangle(light.triangle, NO_INSTANCE);
    Hit hit = hit_at(triangle, point_of_light(light, place));
    Surface emitter = surface_at(hit);
    Material material = emitter_at(hit);
    vec3 normal = emitter.geometric_normal;
    bool both_sides = emits(material, false);
    if (both_sides && side < 0.5) {
        normal = -normal;
    }
    float sides = both_sides ? 2.0 : 1.0;
    vec3 origin = offset_origin(emitter.position, normal, emitter.reach);
    vec3 way = target.sphere.xyz - origin;
    bool in_cone = !target.everything && target.sphere.w * target.sphere.w < WIDE_CONE * dot(way, way);
    vec3 direction;
    float projected; // cosine over the density of the direction
    if (in_cone) {
        Cone cone = cone_of(target.sphere, origin);
        direction = direction_in_cone(cone.axis, cone.versine, u);
        projected = max(0.0, dot(direction, normal)) * 2.0 * PI * cone.versine;
    } else {
        direction = cosine_direction(normal, u);
        projected = PI;
    }
    vec3 flux = emitted_radiance(material, max(0.0, dot(direction, normal))) *
                (projected * sides * light.area * opacity(hit));
    return AimedStart(Emission(origin, direction, flux, triangle, 0.0), origin, false, in_cone);
}

// From a light towards a target; flux over the density of the coordinates' choice.
AimedStart emit_from(uint index, vec2 place, vec2 direction, float side, Target target) {
    Light light = light_at(index);
    AimedStart start;
    if (is_punctual(light.kind) && light.kind == DIRECTIONAL_LIGHT) {
        start = emit_directional(light, place, direction, target);
    } else if (is_punctual(light.kind)) {
        start = emit_point(light, place, direction, target);
    } else if (is_environment(light.kind)) {
        start = emit_environment(light.area, place, direction, target);
    } else {
        start = emit_triangle(light, place, direction, side, target);
    }
    return start;
}

// The path has no flux if its ray hits another target before the one that it was chosen for.
Emission emit_aimed(vec4 u, vec4 w, out uint light) {
    EmissionTableSize size = emission_table_size();
    Start start = choose_start(size, u, w);
    light = start.light;
    // Starts without a weight are not traced, see emission::Aim.
    Emission emission = Emission(vec3(0.0), vec3(0.0, 0.0, 1.0), vec3(0.0), NO_TRIANGLE, 0.0);
    if (start.weight != 0.0) {
        Target target = EVERYTHING;
        if (start.target < size.targets) {
            target = Target(false, target_sphere(start.target));
        }
        AimedStart aimed = emit_from(start.light, start.place, start.direction, w.y, target);
        emission = aimed.emission;
        bool kept = hits_target_first(size, start.target, aimed.on_target, aimed.passed, emission.direction, aimed.distant);
        emission.flux *= kept ? start.weight / start.probability : 0.0;
    }
    return emission;
}

Emission emit(inout Random random, out uint light) {
    // Place and direction are one four-dimensional point: the remainder of the number that chose the light is the first
    // coordinate.
    vec4 u = next4(random);
    vec4 w = next4(random);
    Emission emission;
    if (AIMED) {
        emission = emit_aimed(u, w, light);
    } else {
        Choice choice = choose_light(u.x, w.xz);
        emission = emit_from(choice.index, vec2(choice.rest, u.y), u.zw, w.y, EVERYTHING).emission;
        emission.flux /= light_at(choice.index).probability;
        light = choice.index;
    }
    return emission;
}

#endif
