// What narrow lobes show of lights that are no surfaces, which no direction of theirs meets, and what a ray sees of those that
// have an extent. Include after alpha.glsl, bsdf.glsl,
// contact.glsl and light.glsl.

// BSDF · cos of a rough boundary of glass without its tint, as `meet_boundary` draws it: Walter and others, «Microfacet Models for Refraction
// through Rough Surfaces», EGSR 2007. v and l are unit vectors away from the surface.
vec3 glass_response(Facing facing, vec3 v, vec3 l, Material material, float outside) {
    vec3 n = facing.shading_normal;
    float alpha = material.roughness * material.roughness;
    float ior = material.ior / outside;
    bool thin = is_thin(material);
    float eta = facing.front || thin ? 1.0 / ior : ior;
    bool passes = dot(l, facing.geometric_normal) < 0.0;
    bool bends = passes && !thin;
    vec3 h = bends ? eta * v + l : v + (passes ? l - 2.0 * dot(l, n) * n : l);
    float length2 = dot(h, h);
    h *= (dot(h, n) < 0.0 ? -1.0 : 1.0) * inversesqrt(max(length2, 1e-12));
    float nv = dot(n, v);
    float nl = dot(n, l);
    float vh = dot(v, h);
    float lh = dot(l, h);
    // Straight through without bending, any microfacet will do: that is no lobe.
    if (nv <= 0.0 || vh <= 0.0 || (nl < 0.0) != passes || (bends && lh >= 0.0) || length2 < 1e-12) {
        return vec3(0.0);
    }
    float cos_t;
    Boundary boundary;
    boundary.reflectance = fresnel_dielectric(vh, eta, cos_t);
    boundary.refracted = l;
    boundary.reflected_weight = vec3(1.0);
    boundary.refracted_weight = vec3(1.0);
    weigh(boundary, facing, -v, material, ior, vh);
    float visible = 2.0 * ggx(alpha, n, h) / (nv + masking_root(alpha, nv)); // D · G1(v) / nv
    if (!passes) {
        return boundary.reflectance * boundary.reflected_weight * (0.25 * visible * joint_masking(alpha, nv, nl));
    }
    // Density of l against that of h; radiance is compressed on its way into the denser medium.
    float through = bends ? vh * -lh * eta * eta / ((eta * vh + lh) * (eta * vh + lh)) : 0.25;
    return boundary.refracted_weight * ((1.0 - boundary.reflectance) * visible * through * masking(alpha, -nl));
}

// A ray that asks whether a light is seen, and what it brings if it is.
struct LightRay {
    vec3 origin;
    vec3 direction;
    float end; // in its lengths
    vec3 contribution;
};

const LightRay NO_LIGHT_RAY = LightRay(vec3(0.0), vec3(0.0), 0.0, vec3(0.0));

bool asks_light(LightRay ray) {
    return PUNCTUAL_LIGHTS && largest(ray.contribution) > 0.0;
}

// What a surface shows of a light. `reflector`: of what isn't glass.
LightRay glint(uint index, vec2 place, Encounter met, Material material, Reflector reflector, vec3 viewer) {
    Light light = light_at(index);
    if (!is_punctual(light.kind)) {
        return NO_LIGHT_RAY;
    }
    vec3 origin = origin_towards(met.surface, arriving_from(light, met.surface.position, place).ray);
    Arriving arriving = arriving_from(light, origin, place);
    vec3 l = normalize(arriving.ray);
    float nl = dot(l, met.facing.shading_normal);
    bool same_side = dot(l, met.facing.geometric_normal) > 0.0;
    vec3 response = vec3(0.0);
    if (is_dielectric(material)) {
        response = glass_response(met.facing, viewer, l, material, met.outside) * (same_side ? vec3(1.0) : met.tint);
    } else if (same_side && nl > 0.0) {
        reflector.diffuse = vec3(0.0);
        response = brdf(reflector, met.facing.shading_normal, viewer, l) * nl;
    }
    if (ABSORPTION) {
        float way = light.kind == DIRECTIONAL_LIGHT ? 1e30 : length(arriving.ray);
        response *= transmittance(same_side ? met.through.first : met.beyond.first, way);
    }
    return LightRay(origin, arriving.ray, arriving.end, response * arriving.irradiance);
}

// Numbers for a glint, apart from the path's own: those are the same where there is nothing to ask.
float glint_number(Random random, uint i) {
    return number_of(random, uvec2(i, GLINT));
}

vec2 glint_place(Random random) {
    return SOFT_LIGHTS ? vec2(glint_number(random, 3u), glint_number(random, 4u)) : vec2(0.0);
}

LightRay glint_of_one(Encounter met, Material material, Reflector reflector, vec3 viewer, Random random) {
    vec2 digits = vec2(glint_number(random, 1u), glint_number(random, 2u));
    uint chosen = choose_light(glint_number(random, 0u), digits).index;
    LightRay ray = glint(chosen, glint_place(random), met, material, reflector, viewer);
    ray.contribution *= 1.0 / light_at(chosen).probability;
    return ray;
}

// By a ray to each light, where visible points are found once.
vec3 glint_of_all(Encounter met, Material material, Reflector reflector, vec3 viewer, Random random) {
    vec3 sum = vec3(0.0);
    // Triangles come first, and may be many.
    for (uint i = settings.light_count; i > 0u && light_at(i - 1u).kind != TRIANGLE_LIGHT && !loops_cut; i--) {
        LightRay ray = glint(i - 1u, glint_place(random), met, material, reflector, viewer);
        if (asks_light(ray)) {
            Hit hit = trace_visible(ray.origin, ray.direction, AT_ORIGIN, ray.end, NO_TRIANGLE, true, random);
            sum += hit.triangle == MISS ? ray.contribution : vec3(0.0);
        }
    }
    return sum;
}

// Radiance of lights with an extent that a ray meets within `end` lengths of its unit direction. They follow after the triangles.
vec3 soft_lights_along(vec3 origin, vec3 direction, float end, uint medium) {
    vec3 sum = vec3(0.0);
    for (uint i = settings.light_count; i > 0u && light_at(i - 1u).kind != TRIANGLE_LIGHT; i--) {
        loop_count += 1u;
        Light light = light_at(i - 1u);
        if (!is_punctual(light.kind) || light.extent <= 0.0) {
            continue;
        }
        bool distant = light.kind == DIRECTIONAL_LIGHT;
        vec3 to_middle = light.position - origin;
        float way = distant ? 1e30 : dot(to_middle, direction);
        vec3 off_axis = distant ? direction + light.direction : to_middle - way * direction;
        float off2 = dot(off_axis, off_axis);
        bool met = distant ? 0.5 * off2 <= light.extent && end >= 1e30
                           : off2 <= light.extent * light.extent && way > 0.0 && way < end;
        if (met) {
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
    return sum;
}
