// Where photon paths start. Include after random.glsl, environment.glsl and light.glsl.

struct Emission {
    vec3 origin;
    vec3 direction;
    vec3 flux;
    PlacedTriangle ignored; // the triangle that it leaves
    float inverse_range; // of a punctual light
};

// From a disc across the direction of flight that covers the scene.
vec3 origin_afar(vec3 centre, vec3 direction, float area, vec2 u) {
    return centre + basis(direction) * vec3(sqrt(area / PI) * disc_point(u), 0.0);
}

// A direction around an axis, with 1 − cos of the angle between them.
vec3 direction_off(vec3 axis, float versine, float turn) {
    float across = sqrt(max(0.0, versine * (2.0 - versine)));
    float phi = 2.0 * PI * turn;
    return normalize(basis(axis) * vec3(across * cos(phi), across * sin(phi), 1.0 - versine));
}

// 1 − cos of a photon's angle from a spot's axis, such that all photons have the same flux, and the solid angle that would
// have the whole intensity: the integral of the squared ramp is a third of its width.
float spot_versine(PunctualLight light, float u, out float solid_angle) {
    float ramp = light.outer - light.inner;
    float whole = light.inner + ramp / 3.0;
    solid_angle = 2.0 * PI * whole;
    float from_outside = u * whole;
    return from_outside < ramp / 3.0 ? light.outer - pow(3.0 * from_outside * ramp * ramp, 1.0 / 3.0)
                                     : whole - from_outside;
}

Emission emit_punctual(PunctualLight light, uint kind, float area, vec2 place, vec2 direction) {
    if (kind == DIRECTIONAL_LIGHT) {
        return Emission(origin_afar(light.position, light.direction, area, place), light.direction,
                        light.intensity * area, NO_TRIANGLE, 0.0);
    }
    float solid_angle = 4.0 * PI;
    float versine = 2.0 * direction.x;
    vec3 axis = vec3(0.0, 0.0, 1.0);
    if (kind == SPOT_LIGHT) {
        versine = spot_versine(light, direction.x, solid_angle);
        axis = light.direction;
    }
    return Emission(light.position, direction_off(axis, versine, direction.y), light.intensity * solid_angle,
                    NO_TRIANGLE,
                    light.inverse_range);
}

Emission emit_environment(float area, vec2 place, vec2 direction) {
    vec3 towards;
    Sky sky = sample_environment(direction, towards);
    return Emission(origin_afar(towards * sqrt(area / PI), -towards, area, place), -towards,
                    sky.radiance * (area / sky.density), NO_TRIANGLE, 0.0);
}

Emission emit(inout Random random) {
    // Place and direction are one point of four dimensions: what is left of the number that chose the light is the first.
    vec4 u = next4(random);
    vec4 w = next4(random);
    Choice choice = choose_light(u.x, w.xz);
    vec2 place = vec2(choice.rest, u.y);
    Light light = light_at(choice.light);
    Emission emission;
    if (PUNCTUAL_LIGHTS && is_punctual(light.kind)) {
        emission = emit_punctual(punctual_light_at(choice.light), light.kind, light.area, place, u.zw);
    } else if (ENVIRONMENT && light.kind == ENVIRONMENT_LIGHT) {
        emission = emit_environment(light.area, place, u.zw);
    } else {
        PlacedTriangle triangle = PlacedTriangle(light.triangle, NO_INSTANCE);
        Surface emitter = surface_at(triangle, triangle_point(place));
        Material material = material_of(emitter);
        vec3 normal = emitter.geometric_normal;
        bool both_sides = emits(material, false);
        if (both_sides && w.y < 0.5) {
            normal = -normal;
        }
        float sides = both_sides ? 2.0 : 1.0;
        vec3 direction = cosine_direction(normal, u.zw);
        emission = Emission(offset_origin(emitter.position, normal, emitter.reach), direction,
                            emitted_radiance(material, dot(direction, normal)) *
                                (PI * sides * light.area * share_there(emitter)),
                            triangle, 0.0);
    }
    emission.flux /= light.probability;
    return emission;
}
