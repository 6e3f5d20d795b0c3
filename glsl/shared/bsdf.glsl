// Boundaries. Directions: `incoming` flies towards the surface; cosines are positive.

// Unpolarised Fresnel reflectance of a dielectric; eta: index of the incident side over that of the other side.
float fresnel_dielectric(float cos_i, float eta, out float cos_t) {
    float sin2_t = eta * eta * max(0.0, 1.0 - cos_i * cos_i);
    if (sin2_t >= 1.0) {
        cos_t = 0.0;
        return 1.0;
    }
    cos_t = sqrt(1.0 - sin2_t);
    float parallel = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    float perpendicular = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// A dielectric's reflectance at normal incidence.
float normal_reflectance(float ior) {
    float root = (ior - 1.0) / (ior + 1.0);
    return root * root;
}

// Schlick's approximation, as glTF 2.0, appendix B, has it for metals.
vec3 fresnel_schlick(vec3 f0, float cos_i) {
    return f0 + (1.0 - f0) * schlick(cos_i);
}

// A ray's meeting with a surface, with both normals turned to the side that the ray comes from.
struct Facing {
    vec3 geometric_normal;
    vec3 shading_normal;
    bool front; // the ray meets the triangle's front
};

Facing face(Surface surface, vec3 incoming) {
    Facing facing;
    facing.front = dot(incoming, surface.geometric_normal) < 0.0;
    float side = facing.front ? 1.0 : -1.0;
    facing.geometric_normal = side * surface.geometric_normal;
    facing.shading_normal = side * surface.shading_normal;
    // Past the horizon of the shading normal (at silhouettes of tessellated shapes) the geometric one stands in.
    if (dot(incoming, facing.shading_normal) >= 0.0) {
        facing.shading_normal = facing.geometric_normal;
    }
    return facing;
}

// The mirror direction. Off the shading normal it may point into the surface; then the geometric normal takes its place.
vec3 mirror_direction(Facing facing, vec3 incoming) {
    vec3 reflected = incoming - 2.0 * dot(incoming, facing.shading_normal) * facing.shading_normal;
    if (dot(reflected, facing.geometric_normal) <= 0.0) {
        reflected = incoming - 2.0 * dot(incoming, facing.geometric_normal) * facing.geometric_normal;
    }
    return normalize(reflected);
}

// A photon's flux is per area of the surface; the shading normal's cosine replaces the geometric one's: Veach, «Robust Monte
// Carlo Methods for Light Transport Simulation», 1997, section 5.3.
float landing_correction(Facing facing, vec3 incoming) {
    return dot(incoming, facing.shading_normal) / dot(incoming, facing.geometric_normal);
}

// Where a glossy surface scatters a photon to that comes from v, instead of the cosine-distributed `outgoing` or as that says,
// and the part of the flux that goes there. Chosen by u.w, drawn by u.xy.
vec3 scatter(Reflector reflector, Facing facing, vec3 v, vec4 u, inout vec3 outgoing) {
    vec3 n = facing.shading_normal;
    float nv = dot(n, v);
    float p = reflection_probability(reflector, nv);
    bool reflects = u.w < p;
    if (reflector.alpha < SMOOTH_ALPHA) {
        if (reflects) {
            outgoing = mirror_direction(facing, -v);
            return fresnel(reflector, nv) * (coat_passes(reflector.coat, nv) / p);
        }
        return PI / (1.0 - p) * brdf(reflector, n, v, outgoing);
    }
    if (reflects) {
        outgoing = reflected_direction(reflector.alpha, n, v, u.xy);
    }
    float cosine = max(dot(outgoing, facing.geometric_normal), 0.0);
    float density = mix(cosine * (1.0 / PI), reflected_density(reflector.alpha, n, v, outgoing), p);
    return brdf(reflector, n, v, outgoing) * (cosine / max(density, 1e-20));
}

// What a ray meets of a coated surface is by chance the coat, which then is the material, or what lies below it. Returns the
// factor of what the path carries; u is a uniform number. Of what is all clear, the inside has no coat.
float choose_layer(inout Material material, inout Facing facing, Surface surface, vec3 incoming, float u) {
    bool coated = is_coated(material) && (facing.front || !is_dielectric(material) || is_thin(material));
    if (!coated) {
        return 1.0;
    }
    vec3 n = facing.front ? surface.coat_normal : -surface.coat_normal;
    n = dot(incoming, n) < 0.0 ? n : facing.geometric_normal;
    // At least a quarter, as of any reflection; and 0.9 at the most, so that what a rough coat passes at grazing angles isn't
    // found by a rare choice.
    float p = clamp(1.0 - coat_passes(material.coat, -dot(incoming, n)), 0.25 * material.coat, 0.9);
    if (u >= p) {
        return 1.0 / (1.0 - p);
    }
    facing.shading_normal = n;
    material.surface = GLOSSY_SURFACE;
    material.base_color = vec3(0.0);
    material.metallic = 0.0;
    material.roughness = material.coat_roughness;
    material.specular_f0 = vec3(COAT_F0 * material.coat);
    material.specular_f90 = material.coat;
    material.coat = 0.0;
    return 1.0 / p;
}

// What can happen at a dielectric boundary.
struct Boundary {
    float reflectance;
    float eta;       // index of the incident side over that of the other side
    vec3 reflected;  // directions
    vec3 refracted;
    vec3 reflected_weight; // what microfacets and a coat let through
    vec3 refracted_weight;
};

// Weighs what a boundary reflects and refracts with what extensions make of it. ior: index inside over that outside; cosine: to
// the microfacet's normal.
void weigh(inout Boundary boundary, Facing facing, vec3 incoming, Material material, float ior, float cosine) {
    bool specular = SPECULAR_GLASS && (material.flags & SPECULAR_CHANGED) != 0u && boundary.reflectance < 1.0;
    if (specular) {
        // KHR_materials_specular changes the ends of Fresnel's curve, total reflection apart.
        float f0 = normal_reflectance(ior);
        vec3 changed = mix(material.specular_f0 * (f0 / max(normal_reflectance(material.ior), 1e-10)),
                           vec3(material.specular_f90), (boundary.reflectance - f0) / (1.0 - f0));
        changed = min(changed, 1.0);
        boundary.reflected_weight *= changed / max(boundary.reflectance, 1e-10);
        boundary.refracted_weight *= (1.0 - changed) / (1.0 - boundary.reflectance);
    }
    if (is_coated(material)) {
        // It lies outside, and its angle is the same whichever way the light goes.
        vec3 outside = facing.front ? incoming : boundary.refracted;
        float of_refracted = is_thin(material) ? cosine : -dot(outside, facing.shading_normal);
        boundary.reflected_weight *=
            facing.front || is_thin(material) ? coat_passes(material.coat, cosine) : 1.0;
        boundary.refracted_weight *= coat_passes(material.coat, of_refracted);
    }
}

bool is_rough_glass(Material material) {
    return ROUGH_GLASS && material.roughness * material.roughness >= SMOOTH_ALPHA;
}

// outside: index of refraction. u chooses the microfacet of a rough boundary. A thin wall is crossed without bending.
Boundary meet_boundary(Facing facing, vec3 incoming, Material material, float outside, vec2 u) {
    vec3 n = facing.shading_normal;
    float alpha = material.roughness * material.roughness;
    bool rough = is_rough_glass(material);
    Facing micro = facing;
    if (rough) {
        micro.shading_normal = visible_normal(alpha, n, -incoming, u);
    }
    vec3 m = micro.shading_normal;
    float ior = material.ior / outside;
    Boundary boundary;
    boundary.eta = facing.front || is_thin(material) ? 1.0 / ior : ior;
    float cos_i = -dot(incoming, m);
    float cos_t;
    boundary.reflectance = fresnel_dielectric(cos_i, boundary.eta, cos_t);
    boundary.reflected = mirror_direction(micro, incoming);
    boundary.refracted = normalize(boundary.eta * incoming + (boundary.eta * cos_i - cos_t) * m);
    boundary.reflected_weight = vec3(1.0);
    boundary.refracted_weight = vec3(1.0);
    if (is_thin(material)) {
        // Microfacets on both sides: what is reflected, turned to the other side.
        vec3 mirrored = incoming + 2.0 * cos_i * m;
        boundary.refracted = rough ? mirrored - 2.0 * dot(mirrored, n) * n : incoming;
        boundary.eta = 1.0;
    }
    if (rough) {
        float nv = -dot(incoming, n);
        float up = dot(incoming + 2.0 * cos_i * m, n);
        float down = -dot(boundary.refracted, n);
        boundary.reflected_weight = vec3(up > 0.0 ? joint_masking(alpha, nv, up) : 0.0);
        boundary.refracted_weight = vec3(down > 0.0 ? masking(alpha, down) : 0.0);
    }
    weigh(boundary, facing, incoming, material, ior, cos_i);
    return boundary;
}
