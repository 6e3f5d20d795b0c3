// Glossy reflection as glTF 2.0, appendix B, has it: a Lambertian base under a boundary of GGX microfacets with
// height-correlated masking (Heitz, «Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs», JCGT 3(2), 2014)
// and Schlick's Fresnel. v and l are unit vectors to the viewer and to the light. Include after sampling.glsl.

#include "layout.glsl"

layout(constant_id = 9) const bool GLOSSY = false; // the scene has glossy surfaces

struct Reflector {
    vec3 diffuse;   // albedo of the base
    vec3 f0;        // reflectance of the boundary at normal and at grazing incidence
    float f90;
    float alpha;
    vec2 over_base; // largest channel of what reflects over the base, at normal and at grazing incidence
    float coat;     // what lies above both, see KHR_materials_clearcoat: how much of a dielectric's reflection it has
};

const Reflector NO_REFLECTOR = Reflector(vec3(0.0), vec3(0.0), 0.0, 0.0, vec2(0.0), 0.0);

Reflector reflector_of(Gloss gloss) {
    vec2 f0_b_f90 = unpackHalf2x16(gloss.rest.y);
    vec2 alpha_coat = unpackHalf2x16(gloss.rest.z);
    return Reflector(gloss.diffuse_viewer.rgb, vec3(unpackHalf2x16(gloss.rest.x), f0_b_f90.x), f0_b_f90.y,
                     abs(alpha_coat.x), unpackHalf2x16(gloss.rest.w), alpha_coat.y);
}

bool is_coated(Gloss gloss) {
    return (gloss.rest.z & COATED) != 0u;
}

Gloss gloss_of(Reflector reflector, vec3 v, bool coated) {
    return Gloss(vec4(reflector.diffuse, uintBitsToFloat(encode_direction(v))),
                 uvec4(packHalf2x16(reflector.f0.rg), packHalf2x16(vec2(reflector.f0.b, reflector.f90)),
                       packHalf2x16(vec2(reflector.alpha, reflector.coat)) | (coated ? COATED : 0u),
                       packHalf2x16(reflector.over_base)));
}

// The fifth power of 1 − cosine.
float schlick(float cosine) {
    float m = clamp(1.0 - cosine, 0.0, 1.0);
    float m2 = m * m;
    return m2 * m2 * m;
}

vec3 fresnel(Reflector reflector, float cosine) {
    return reflector.f0 + (reflector.f90 - reflector.f0) * schlick(cosine);
}

// What gets through to the base, alike for all colours (KHR_materials_specular), and past what isn't metal alone.
float through_to_base(Reflector reflector, float cosine) {
    return 1.0 - mix(reflector.over_base.x, reflector.over_base.y, schlick(cosine));
}

// What a coat lets through to what lies below. KHR_materials_clearcoat takes the cosine to the viewer; that to the
// microfacet's normal is the same where the coat is smooth, and both ways of the light are one.
float coat_passes(float coat, float cosine) {
    return 1.0 - coat * mix(COAT_F0, 1.0, schlick(cosine));
}

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

// The BRDF, 1/sr, without what a smooth boundary mirrors.
vec3 brdf(Reflector reflector, vec3 n, vec3 v, vec3 l) {
    float nv = dot(n, v);
    float nl = dot(n, l);
    vec3 h = normalize(v + l);
    float cosine = dot(v, h);
    vec3 f = fresnel(reflector, cosine);
    float through = through_to_base(reflector, cosine);
    float alpha = max(reflector.alpha, SMOOTH_ALPHA);
    float visibility = 0.5 / (nl * masking_root(alpha, nv) + nv * masking_root(alpha, nl));
    float lobe = reflector.alpha < SMOOTH_ALPHA ? 0.0 : ggx(alpha, n, h) * visibility;
    vec3 value = through * reflector.diffuse * (1.0 / PI) + f * lobe;
    return nv > 0.0 && nl > 0.0 ? coat_passes(reflector.coat, cosine) * value : vec3(0.0);
}

// Share of the samples that go to the boundary's reflection: at least a quarter, for what it mirrors may be bright.
float reflection_probability(Reflector reflector, float nv) {
    vec3 f = fresnel(reflector, nv);
    float reflected = max(f.r, max(f.g, f.b));
    float under = max(reflector.diffuse.r, max(reflector.diffuse.g, reflector.diffuse.b)) * (1.0 - reflected);
    return reflected <= 0.0 ? 0.0 : (under <= 0.0 ? 1.0 : max(reflected / (reflected + under), 0.25));
}

// A microfacet's normal that v sees: Dupuy and Benyoub, «Sampling Visible GGX Normals with Spherical Caps», Computer
// Graphics Forum 42(8), 2023.
vec3 visible_normal(float alpha, vec3 n, vec3 v, vec2 u) {
    mat3 frame = basis(n);
    vec3 local = v * frame;
    vec3 stretched = normalize(vec3(alpha * local.xy, local.z));
    float phi = 2.0 * PI * u.x;
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 cap = vec3(sine * cos(phi), sine * sin(phi), z) + stretched;
    return normalize(frame * normalize(vec3(alpha * cap.xy, max(cap.z, 1e-6))));
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

// BRDF · cos / density of a direction from `reflected_direction`, or of a mirror's.
vec3 reflected_weight(Reflector reflector, vec3 n, vec3 v, vec3 l) {
    float nv = dot(n, v);
    float nl = dot(n, l);
    bool smooth_boundary = reflector.alpha < SMOOTH_ALPHA;
    float vh = smooth_boundary ? nv : dot(v, normalize(v + l));
    float masking = smooth_boundary ? 1.0 : (nl > 0.0 ? joint_masking(reflector.alpha, nv, nl) : 0.0);
    return fresnel(reflector, vh) * (coat_passes(reflector.coat, vh) * masking);
}
