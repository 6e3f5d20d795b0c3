// Glossy reflection as glTF 2.0, appendix B, has it: a Lambertian base under a boundary of GGX microfacets with
// height-correlated masking (Heitz, «Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs», JCGT 3(2), 2014)
// and Schlick's Fresnel. v and l are unit vectors to the viewer and to the light. Include after sampling.glsl.

layout(constant_id = 9) const bool GLOSSY = false; // the scene has glossy surfaces

// Below this α a boundary is a mirror.
const float SMOOTH_ALPHA = 1e-3;
// Below this α camera paths follow reflections; photons gathered on such a narrow lobe would be noise.
const float FOLLOWED_ALPHA = 0.1;

// In which a byte has a part from 0 to 1: a half is one of them.
const float PART_STEPS = 254.0;

struct Reflector {
    vec3 diffuse;    // albedo of the base
    vec3 f0;         // reflectance of the boundary at normal and at grazing incidence
    float f90;
    float alpha;
    float metallic;  // part that is metal and has no base
    vec2 over_base;  // largest channel of what reflects over the base, at normal and at grazing incidence
};

const Reflector NO_REFLECTOR = Reflector(vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, vec2(0.0));

float largest_channel(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

// specular: reflectance at grazing incidence of the part that isn't metal.
Reflector make_reflector(vec3 diffuse, vec3 f0, float specular, float metallic, float alpha) {
    // f0 is a mixture of the metal's colour, of which `diffuse` is what isn't metal, and of what is wanted.
    float rest = max(1.0 - metallic, 1e-3);
    float over_base = max(largest_channel(f0 - diffuse * (metallic / rest)) / rest, 0.0);
    return Reflector(diffuse, f0, mix(specular, 1.0, metallic), alpha, metallic, vec2(over_base, specular));
}

// How a visible point's surface scatters.
struct Gloss {
    vec4 diffuse_viewer; // w: uint bits, octahedral v
    // w: uint bits. Lower half an f16, α, 0 where the path followed the reflection itself; then two bytes, of PART_STEPS:
    // `metallic` and `specular` of make_reflector.
    vec4 f0_rest;
};

#define GLOSS(i) Gloss(TEXEL(GlossOf, 2u * (i)), TEXEL(GlossOf, 2u * (i) + 1u))

Reflector reflector_of(Gloss gloss) {
    uint rest = floatBitsToUint(gloss.f0_rest.w);
    vec2 parts = vec2(rest >> 16u & 0xffu, rest >> 24u) * (1.0 / PART_STEPS);
    return make_reflector(gloss.diffuse_viewer.rgb, gloss.f0_rest.rgb, parts.y, parts.x, unpackHalf2x16(rest).x);
}

Gloss gloss_of(Reflector reflector, vec3 v) {
    uvec2 parts = uvec2(vec2(reflector.metallic, reflector.over_base.y) * PART_STEPS + 0.5);
    uint rest = packHalf2x16(vec2(reflector.alpha, 0.0)) | parts.x << 16u | parts.y << 24u;
    return Gloss(vec4(reflector.diffuse, uintBitsToFloat(encode_direction(v))),
                 vec4(reflector.f0, uintBitsToFloat(rest)));
}

float schlick_weight(float cosine) {
    float m = clamp(1.0 - cosine, 0.0, 1.0);
    float m2 = m * m;
    return m2 * m2 * m;
}

vec3 fresnel(Reflector reflector, float cosine) {
    return reflector.f0 + (reflector.f90 - reflector.f0) * schlick_weight(cosine);
}

// What gets through to the base, alike for all colours (KHR_materials_specular), and past what isn't metal alone.
float through_to_base(Reflector reflector, float cosine) {
    return 1.0 - mix(reflector.over_base.x, reflector.over_base.y, schlick_weight(cosine));
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
    return nv > 0.0 && nl > 0.0 ? through * reflector.diffuse * (1.0 / PI) + f * lobe : vec3(0.0);
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
    if (reflector.alpha < SMOOTH_ALPHA) {
        return fresnel(reflector, nv);
    }
    return nl > 0.0 ? fresnel(reflector, dot(v, normalize(v + l))) * joint_masking(reflector.alpha, nv, nl) : vec3(0.0);
}
