// Reflectance of boundaries.
#ifndef BSDF_FRESNEL
#define BSDF_FRESNEL

#include "layout.glsl"

// Unpolarised Fresnel reflectance of a dielectric; eta: index of the incident side over that of the other side.
float fresnel_dielectric(float cos_i, float eta, out float cos_t) {
    float sin2_t = eta * eta * max(0.0, 1.0 - cos_i * cos_i);
    cos_t = sqrt(max(0.0, 1.0 - sin2_t));
    float parallel = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    float perpendicular = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return sin2_t >= 1.0 ? 1.0 : 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// A dielectric's reflectance at normal incidence.
float normal_reflectance(float ior) {
    float root = (ior - 1.0) / (ior + 1.0);
    return root * root;
}

// The fifth power of 1 − cosine.
float schlick(float cosine) {
    float m = clamp(1.0 - cosine, 0.0, 1.0);
    float m2 = m * m;
    return m2 * m2 * m;
}

// Schlick's approximation, as glTF 2.0, appendix B, has it for metals.
vec3 fresnel_schlick(vec3 f0, float cos_i) {
    return f0 + (1.0 - f0) * schlick(cos_i);
}

// What a coat lets through to what lies below. KHR_materials_clearcoat takes the cosine to the viewer; that to the
// microfacet's normal is the same where the coat is smooth, and both ways of the light are one.
float coat_passes(float coat, float cosine) {
    return 1.0 - coat * mix(COAT_F0, 1.0, schlick(cosine));
}

#endif
