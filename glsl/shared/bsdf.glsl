// Smooth boundaries. Directions: `incoming` flies towards the surface; cosines are positive.

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

// Schlick's approximation, as glTF 2.0, appendix B, has it for metals.
vec3 fresnel_schlick(vec3 f0, float cos_i) {
    float m = clamp(1.0 - cos_i, 0.0, 1.0);
    float m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
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
            return fresnel(reflector, nv) / p;
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

// What can happen at a dielectric boundary.
struct Boundary {
    float reflectance;
    float eta;       // index of the incident side over that of the other side
    vec3 reflected;  // directions
    vec3 refracted;
    float reflected_weight; // what microfacets let through
    float refracted_weight;
};

// outside: index of refraction. u chooses the microfacet of a rough boundary. A thin wall is crossed without bending.
Boundary meet_boundary(Facing facing, vec3 incoming, Material material, float outside, vec2 u) {
    vec3 n = facing.shading_normal;
    float alpha = material.roughness * material.roughness;
    bool rough = ROUGH_GLASS && alpha >= SMOOTH_ALPHA;
    if (rough) {
        facing.shading_normal = visible_normal(alpha, n, -incoming, u);
    }
    vec3 m = facing.shading_normal;
    float ior = material.ior / outside;
    Boundary boundary;
    boundary.eta = facing.front || is_thin(material) ? 1.0 / ior : ior;
    float cos_i = -dot(incoming, m);
    float cos_t;
    boundary.reflectance = fresnel_dielectric(cos_i, boundary.eta, cos_t);
    boundary.reflected = mirror_direction(facing, incoming);
    boundary.refracted = normalize(boundary.eta * incoming + (boundary.eta * cos_i - cos_t) * m);
    boundary.reflected_weight = 1.0;
    boundary.refracted_weight = 1.0;
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
        boundary.reflected_weight = up > 0.0 ? joint_masking(alpha, nv, up) : 0.0;
        boundary.refracted_weight = down > 0.0 ? 2.0 * down / (down + masking_root(alpha, down)) : 0.0;
    }
    return boundary;
}

// BSDF · cosine of a rough boundary between the viewer's side and a direction on either side; radiance's factor included.
vec3 rough_boundary(Facing facing, Material material, float outside, vec3 tint, vec3 v, vec3 l) {
    vec3 n = facing.shading_normal;
    float alpha = material.roughness * material.roughness;
    float ior = material.ior / outside;
    float eta = facing.front || is_thin(material) ? 1.0 / ior : ior;
    float nv = dot(n, v);
    float nl = abs(dot(n, l));
    float root_v = masking_root(alpha, nv);
    float root_l = masking_root(alpha, nl);
    float cos_t;
    if (dot(n, l) > 0.0 || is_thin(material)) {
        vec3 up = dot(n, l) > 0.0 ? l : l - 2.0 * dot(n, l) * n;
        vec3 h = normalize(v + up);
        float f = fresnel_dielectric(dot(v, h), eta, cos_t);
        float d = ggx(alpha, n, h) * nl;
        return dot(n, l) > 0.0 ? vec3(f * d * 0.5 / (nl * root_v + nv * root_l))
                               : tint * ((1.0 - f) * d / ((nl + root_l) * (nv + root_v)));
    }
    // By the normal that refracts the one into the other: Walter and others, «Microfacet Models for Refraction through Rough
    // Surfaces», Eurographics Symposium on Rendering, 2007.
    vec3 across = eta * v + l;
    float length2 = dot(across, across);
    vec3 h = across * inversesqrt(max(length2, 1e-20));
    h = dot(h, n) < 0.0 ? -h : h;
    float cos_i = dot(v, h);
    float f = fresnel_dielectric(cos_i, eta, cos_t);
    bool possible = cos_i > 0.0 && dot(l, h) < 0.0 && f < 1.0 && length2 > 1e-12;
    float density = ggx(alpha, n, h) * 2.0 * cos_i / (nv + root_v) * cos_t / length2;
    return possible ? tint * (eta * eta * (1.0 - f) * density * 2.0 * nl / (nl + root_l)) : vec3(0.0);
}

float largest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}
