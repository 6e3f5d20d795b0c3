// Microfacets: GGX with height-correlated masking (Heitz, «Understanding the Masking-Shadowing Function in Microfacet-Based
// BRDFs», JCGT 3(2), 2014). v and l are unit vectors to the viewer and to the light.
#ifndef BSDF_MICROFACET
#define BSDF_MICROFACET

#include "layout.glsl"
#include "common/sampling.glsl"

// Density of microfacet normals. The sine comes from the cross product: 1 − cos² of a small angle is rounding.
float ggx(float alpha, vec3 n, vec3 h) {
    vec3 sine = cross(n, h);
    float cosine = dot(n, h);
    float a2 = alpha * alpha;
    float d = dot(sine, sine) + a2 * cosine * cosine;
    return a2 / (PI * d * d);
}

// Λ's square root: masking of a direction at this cosine is 2 cos / (cos + root).
float masking_root(float alpha, float cosine) {
    float a2 = alpha * alpha;
    return sqrt(a2 + (1.0 - a2) * cosine * cosine);
}

// G1: the share of what a direction sees of microfacets.
float masking(float alpha, float cosine) {
    return 2.0 * cosine / (cosine + masking_root(alpha, cosine));
}

// G2 / G1(v): the share of the light that v's visible normals reflect that isn't held back on its way out.
float joint_masking(float alpha, float nv, float nl) {
    float root_v = masking_root(alpha, nv);
    return nl * (nv + root_v) / (nl * root_v + nv * masking_root(alpha, nl));
}

// A microfacet's normal that v sees: Dupuy and Benyoub, «Sampling Visible GGX Normals with Spherical Caps», Computer
// Graphics Forum 42(8), 2023. `alpha`: along the frame's first two directions; its third is the surface's normal.
vec3 visible_normal(vec2 alpha, mat3 frame, vec3 v, vec2 u) {
    vec3 local = v * frame;
    vec3 stretched = normalize(vec3(alpha * local.xy, local.z));
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 cap = vec3(sine * unit_vector_at(u.x), z) + stretched;
    return normalize(frame * normalize(vec3(alpha * cap.xy, max(cap.z, 1e-6))));
}

vec3 visible_normal(float alpha, vec3 n, vec3 v, vec2 u) {
    return visible_normal(vec2(alpha), basis(n), v, u);
}

vec3 reflected_direction(float alpha, vec3 n, vec3 v, vec2 u) {
    vec3 h = visible_normal(alpha, n, v, u);
    return normalize(2.0 * dot(v, h) * h - v);
}

// Its density per solid angle.
float reflected_density(float alpha, vec3 n, vec3 v, vec3 l) {
    float nv = max(dot(n, v), 1e-6);
    return ggx(alpha, n, normalize(v + l)) * 0.5 / (nv + masking_root(alpha, nv));
}

#endif
