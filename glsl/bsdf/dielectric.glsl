// Boundaries of dielectrics. Directions: `incoming` flies towards the surface; cosines are positive.
#ifndef BSDF_DIELECTRIC
#define BSDF_DIELECTRIC

#include "bsdf/dispersion.glsl"
#include "bsdf/reflection.glsl"
#include "trace/interaction.glsl"

// The mirror direction. Off the shading normal it may point into the surface; then the geometric normal takes its place.
vec3 mirror_direction(ShadingFrame frame, vec3 incoming) {
    vec3 reflected = incoming - 2.0 * dot(incoming, frame.shading_normal) * frame.shading_normal;
    if (dot(reflected, frame.geometric_normal) <= 0.0) {
        reflected = incoming - 2.0 * dot(incoming, frame.geometric_normal) * frame.geometric_normal;
    }
    return normalize(reflected);
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
void weigh(inout Boundary boundary, ShadingFrame frame, vec3 incoming, Material material, float ior, float cosine) {
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
        vec3 outside = frame.front ? incoming : boundary.refracted;
        float of_refracted = is_thin(material) ? cosine : -dot(outside, frame.shading_normal);
        boundary.reflected_weight *=
            frame.front || is_thin(material) ? coat_passes(material.coat, cosine) : 1.0;
        boundary.refracted_weight *= coat_passes(material.coat, of_refracted);
    }
}

// outside: index of refraction. u chooses the microfacet of a rough boundary. A thin wall is crossed without bending.
Boundary sample_dielectric(ShadingFrame frame, vec3 incoming, Material material, float outside, vec2 u) {
    vec3 n = frame.shading_normal;
    float alpha = material.roughness * material.roughness;
    bool rough = is_rough_glass(material);
    ShadingFrame micro = frame;
    if (rough) {
        micro.shading_normal = visible_normal(alpha, n, -incoming, u);
    }
    vec3 m = micro.shading_normal;
    float ior = material.ior / outside;
    Boundary boundary;
    boundary.eta = frame.front || is_thin(material) ? 1.0 / ior : ior;
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
    weigh(boundary, frame, incoming, material, ior, cos_i);
    return boundary;
}

// BSDF · cos of a rough boundary of glass without its tint, as `sample_dielectric` draws it: Walter and others, «Microfacet Models
// for Refraction through Rough Surfaces», EGSR 2007. v and l are unit vectors away from the surface.
vec3 evaluate_dielectric(ShadingFrame frame, vec3 v, vec3 l, Material material, float outside) {
    vec3 n = frame.shading_normal;
    float alpha = material.roughness * material.roughness;
    float ior = material.ior / outside;
    bool thin = is_thin(material);
    float eta = frame.front || thin ? 1.0 / ior : ior;
    bool passes = dot(l, frame.geometric_normal) < 0.0;
    bool bends = passes && !thin;
    vec3 h = bends ? eta * v + l : v + (passes ? l - 2.0 * dot(l, n) * n : l);
    float length2 = dot(h, h);
    h *= (dot(h, n) < 0.0 ? -1.0 : 1.0) * inversesqrt(max(length2, 1e-12));
    float nv = dot(n, v);
    float nl = dot(n, l);
    float vh = dot(v, h);
    float lh = dot(l, h);
    // Straight through without bending, any microfacet will do: that is no lobe.
    bool is_possible = nv > 0.0 && vh > 0.0 && (nl < 0.0) == passes && !(bends && lh >= 0.0) && length2 >= 1e-12;
    float cos_t;
    Boundary boundary;
    boundary.reflectance = fresnel_dielectric(vh, eta, cos_t);
    boundary.refracted = l;
    boundary.reflected_weight = vec3(1.0);
    boundary.refracted_weight = vec3(1.0);
    weigh(boundary, frame, -v, material, ior, vh);
    float visible = 2.0 * ggx(alpha, n, h) / (nv + masking_root(alpha, nv)); // D · G1(v) / nv
    vec3 reflected = boundary.reflectance * boundary.reflected_weight * (0.25 * visible * joint_masking(alpha, nv, nl));
    // Density of l against that of h; radiance is compressed on its way into the denser medium.
    float through = bends ? vh * -lh * eta * eta / ((eta * vh + lh) * (eta * vh + lh)) : 0.25;
    vec3 refracted = boundary.refracted_weight * ((1.0 - boundary.reflectance) * visible * through * masking(alpha, -nl));
    return is_possible ? (passes ? refracted : reflected) : vec3(0.0);
}

#endif
