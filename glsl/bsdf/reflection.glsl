// A base under a boundary of microfacets, as glTF 2.0, appendix B, has it, with Schlick's Fresnel; and how visible points carry it
// to whatever gathers for them. v and l are unit vectors to the viewer and to the light.
#ifndef BSDF_REFLECTION
#define BSDF_REFLECTION

#include "bsdf/fresnel.glsl"
#include "bsdf/microfacet.glsl"
#include "bsdf/material_features.glsl"

// Sheen: Estevez and Kulla's «Charlie» distribution (Production Friendly Microfacet Sheen BRDF, SIGGRAPH 2017) with Neubelt and
// Pettineo's visibility, which is bounded here so that the weight of a cosine-distributed direction is: 51 at the most. Both are
// functions of both directions, so that light may go either way.
layout(constant_id = 33) const bool SHEEN = false;

// Below that, the lobe is a few degrees wide.
float sheen_roughness(float roughness) {
    return max(roughness, 0.1);
}

// Its albedo at grazing incidence, of a white one: fitted to quadrature, to 0.006.
float sheen_peak(float r) {
    return 2.463 + r * (-8.00398151 + r * (14.34744501 + r * (-12.32805692 + r * 4.07491165)));
}

// Its value. What would reflect more than all light is scaled.
float sheen_lobe(float roughness, float nv, float nl, vec3 n, vec3 h) {
    float r = sheen_roughness(roughness);
    float inverse = 1.0 / (r * r);
    float sine = min(length(cross(n, h)), 1.0);
    float distribution = (2.0 + inverse) * pow(sine, inverse) * (0.5 / PI);
    float visibility = min(0.25 / max(nl + nv - nl * nv, 1e-6), 1.0);
    return distribution * visibility / max(sheen_peak(r), 1.0);
}

// Its albedo at this cosine: fitted to quadrature, too high by 0.05 at the most and never too low.
float sheen_albedo(float roughness, float cosine) {
    float r = sheen_roughness(roughness);
    float fall = pow(max(1.0 - cosine, 0.0), 0.84 / r + 0.4);
    float rest = 0.02971007 + r * (-0.29507969 + r * (0.98345712 - r * 0.49700958));
    return min(min(sheen_peak(r), 1.0) * mix(rest, 1.0, fall) + 0.024, 1.0);
}

struct Sheen {
    vec3 color;
    float roughness;
};

// KHR_materials_anisotropy: GGX with another α along a direction of the surface.
layout(constant_id = 34) const bool ANISOTROPY = false;

bool carries_layers() {
    bool carries = SHEEN;
    if (ANISOTROPY) {
        carries = true;
    }
    return carries;
}

struct Bsdf {
    vec3 diffuse;   // albedo of the base
    vec3 f0;        // reflectance of the boundary at normal and at grazing incidence
    float f90;
    float alpha;
    vec2 over_base; // largest channel of what reflects over the base, at normal and at grazing incidence
    float coat;     // what lies above both, see KHR_materials_clearcoat: how much of a dielectric's reflection it has
    Sheen sheen;    // between
    float along;    // α along `direction`, where it is another; else 0
    uint direction; // octahedral
};

Bsdf lambertian(vec3 albedo) {
    return Bsdf(albedo, vec3(0.0), 0.0, 0.0, vec2(0.0), 0.0, Sheen(vec3(0.0), 0.0), 0.0, 0u);
}

vec3 fresnel(Bsdf bsdf, float cosine) {
    return bsdf.f0 + (bsdf.f90 - bsdf.f0) * schlick(cosine);
}

// What gets through to the base, alike for all colours (KHR_materials_specular), and past what isn't metal alone.
float through_to_base(Bsdf bsdf, float cosine) {
    return 1.0 - mix(bsdf.over_base.x, bsdf.over_base.y, schlick(cosine));
}

bool is_anisotropic(Bsdf bsdf) {
    return ANISOTROPY && bsdf.along > 0.0;
}

// The direction along which α is another, the one across it, and the normal.
mat3 frame_of(Bsdf bsdf, vec3 n) {
    vec3 t = decode_direction(bsdf.direction);
    t -= dot(t, n) * n;
    float length2 = dot(t, t);
    mat3 frame = basis(n);
    if (length2 > 1e-6) {
        t *= inversesqrt(length2);
        frame = mat3(t, cross(n, t), n);
    }
    return frame;
}

// Λ's square root of a direction, and the density of microfacet normals, as microfacet.glsl has them for one α: Heitz, 2014,
// section 5.4.
float masking_root(Bsdf bsdf, mat3 frame, vec3 v) {
    return length(v * frame * vec3(bsdf.along, bsdf.alpha, 1.0));
}

float ggx(Bsdf bsdf, mat3 frame, vec3 h) {
    float a2 = bsdf.along * bsdf.alpha;
    vec3 q = h * frame * vec3(bsdf.alpha, bsdf.along, a2);
    float d = dot(q, q);
    return a2 * a2 * a2 / (PI * d * d);
}

bool has_sheen(Bsdf bsdf) {
    return SHEEN && largest(bsdf.sheen.color) > 0.0;
}

// What a sheen lets through to what lies below, alike for all colours (KHR_materials_sheen).
float sheen_passes(Bsdf bsdf, float nv, float nl) {
    float passes = 1.0;
    if (has_sheen(bsdf)) {
        passes = 1.0 - largest(bsdf.sheen.color) * sheen_albedo(bsdf.sheen.roughness, min(nv, nl));
    }
    return passes;
}

// Its value, 1/sr, without what a smooth boundary mirrors.
vec3 evaluate_bsdf(Bsdf bsdf, vec3 n, vec3 v, vec3 l) {
    float nv = dot(n, v);
    float nl = dot(n, l);
    vec3 h = normalize(v + l);
    float cosine = dot(v, h);
    vec3 f = fresnel(bsdf, cosine);
    float through = through_to_base(bsdf, cosine);
    float alpha = max(bsdf.alpha, SMOOTH_ALPHA);
    float visibility = 0.5 / (nl * masking_root(alpha, nv) + nv * masking_root(alpha, nl));
    float lobe = bsdf.alpha < SMOOTH_ALPHA ? 0.0 : ggx(alpha, n, h) * visibility;
    if (is_anisotropic(bsdf)) {
        mat3 frame = frame_of(bsdf, n);
        lobe = ggx(bsdf, frame, h) * 0.5 / (nl * masking_root(bsdf, frame, v) + nv * masking_root(bsdf, frame, l));
    }
    vec3 value = through * bsdf.diffuse * (1.0 / PI) + f * lobe;
    if (has_sheen(bsdf)) {
        value = sheen_passes(bsdf, nv, nl) * value + bsdf.sheen.color * sheen_lobe(bsdf.sheen.roughness, nv, nl, n, h);
    }
    return nv > 0.0 && nl > 0.0 ? coat_passes(bsdf.coat, cosine) * value : vec3(0.0);
}

vec3 reflected_direction(Bsdf bsdf, vec3 n, vec3 v, vec2 u) {
    vec3 l;
    if (is_anisotropic(bsdf)) {
        vec3 h = visible_normal(vec2(bsdf.along, bsdf.alpha), frame_of(bsdf, n), v, u);
        l = normalize(2.0 * dot(v, h) * h - v);
    } else {
        l = reflected_direction(bsdf.alpha, n, v, u);
    }
    return l;
}

// Its density per solid angle.
float reflected_density(Bsdf bsdf, vec3 n, vec3 v, vec3 l) {
    float density;
    if (is_anisotropic(bsdf)) {
        mat3 frame = frame_of(bsdf, n);
        float nv = max(dot(n, v), 1e-6);
        density = ggx(bsdf, frame, normalize(v + l)) * 0.5 / (nv + masking_root(bsdf, frame, v));
    } else {
        density = reflected_density(bsdf.alpha, n, v, l);
    }
    return density;
}

// Share of the samples that go to the boundary's reflection: at least a quarter, for what it mirrors may be bright.
float reflection_probability(Bsdf bsdf, float nv) {
    vec3 f = fresnel(bsdf, nv);
    float reflected = max(f.r, max(f.g, f.b));
    float under = max(bsdf.diffuse.r, max(bsdf.diffuse.g, bsdf.diffuse.b)) * (1.0 - reflected);
    if (has_sheen(bsdf)) {
        float passes = sheen_passes(bsdf, nv, nv);
        reflected *= passes;
        under = passes * under + largest(bsdf.sheen.color) * sheen_albedo(bsdf.sheen.roughness, nv);
    }
    return reflected <= 0.0 ? 0.0 : (under <= 0.0 ? 1.0 : max(reflected / (reflected + under), 0.25));
}

// The weight of what a smooth boundary mirrors, chosen with this probability.
vec3 mirrored_part(Bsdf bsdf, float nv, float probability) {
    return sheen_passes(bsdf, nv, nv) * fresnel(bsdf, nv) * (coat_passes(bsdf.coat, nv) / probability);
}

// BRDF · cos / density of a direction from `reflected_direction`, or of a mirror's.
vec3 reflected_weight(Bsdf bsdf, vec3 n, vec3 v, vec3 l) {
    float nv = dot(n, v);
    float nl = dot(n, l);
    bool smooth_boundary = bsdf.alpha < SMOOTH_ALPHA;
    float vh = smooth_boundary ? nv : dot(v, normalize(v + l));
    float masking = smooth_boundary ? 1.0 : (nl > 0.0 ? joint_masking(bsdf.alpha, nv, nl) : 0.0);
    if (is_anisotropic(bsdf) && nl > 0.0) {
        mat3 frame = frame_of(bsdf, n);
        float root = masking_root(bsdf, frame, v);
        masking = nl * (nv + root) / (nl * root + nv * masking_root(bsdf, frame, l));
    }
    vec3 weight = fresnel(bsdf, vh) * (coat_passes(bsdf.coat, vh) * masking);
    return sheen_passes(bsdf, nv, smooth_boundary ? nv : max(nl, 0.0)) * weight;
}

// The reflection of a boundary that paths follow has been taken away from what a visible point shows.
Bsdf base_of(Bsdf bsdf) {
    bsdf.alpha = 0.0;
    bsdf.along = 0.0;
    return bsdf;
}

// The value of its boundary alone.
vec3 evaluate_boundary(Bsdf bsdf, vec3 n, vec3 v, vec3 l) {
    float passes = sheen_passes(bsdf, dot(n, v), dot(n, l));
    bsdf.diffuse = vec3(0.0);
    bsdf.sheen.color = vec3(0.0);
    return passes * evaluate_bsdf(bsdf, n, v, l);
}

// Whether it scatters anything that isn't followed.
bool scatters(Bsdf bsdf) {
    return largest(bsdf.diffuse) > 0.0 || bsdf.alpha > 0.0 || has_sheen(bsdf);
}

// A visible point's BSDF, towards its viewer. Where nothing but Lambertian surfaces is known its value is 1, since the visible
// point's weight has it.
struct VisibleBsdf {
    vec3 normal;
    vec3 viewer;
    Bsdf bsdf;
    bool coated; // photons have their flux across their rays, since each layer has a normal of its own
};

VisibleBsdf no_visible_bsdf() {
    return VisibleBsdf(vec3(0.0), vec3(0.0), lambertian(vec3(0.0)), false);
}

// Whether visible points carry one.
bool carries_bsdf() {
    return GLOSSY;
}

// The part of a visible point's weight that it has.
vec3 weight_of(Bsdf bsdf) {
    vec3 weight = bsdf.diffuse / PI;
    if (GLOSSY) {
        weight = vec3(1.0);
    }
    return weight;
}

PackedBsdf pack_bsdf(Bsdf bsdf, vec3 viewer, bool coated) {
    return PackedBsdf(vec4(bsdf.diffuse, uintBitsToFloat(encode_direction(viewer))),
                 uvec4(packHalf2x16(bsdf.f0.rg), packHalf2x16(vec2(bsdf.f0.b, bsdf.f90)),
                       packHalf2x16(vec2(bsdf.alpha, bsdf.coat)) | (coated ? COATED : 0u), packHalf2x16(bsdf.over_base)));
}

// Into and out of the buffer of all. (Macros, see common/texel.glsl.)
#define STORE_BSDF(buffer, slot, bsdf, viewer, coated)                                                                             \
    {                                                                                                                              \
        PackedBsdf packed = pack_bsdf(bsdf, viewer, coated);                                                                       \
        buffer[2u * (slot)] = floatBitsToUint(packed.diffuse_viewer);                                                              \
        buffer[2u * (slot) + 1u] = packed.rest;                                                                                    \
        if (carries_layers()) {                                                                                                    \
            buffer[2u * slots() + (slot)] = pack_layers(bsdf);                                                                     \
        }                                                                                                                          \
    }
#define LOAD_BSDF(buffer, slot, normal) \
    unpack_bsdf(PACKED_BSDF(buffer, slot), carries_layers() ? TEXEL_BITS(buffer, 2u * slots() + (slot)) : uvec4(0u), normal)

// A PackedLayers.
uvec4 pack_layers(Bsdf bsdf) {
    return uvec4(packHalf2x16(bsdf.sheen.color.rg), packHalf2x16(vec2(bsdf.sheen.color.b, bsdf.sheen.roughness)),
                 packHalf2x16(vec2(bsdf.along, 0.0)), bsdf.direction);
}

VisibleBsdf unpack_bsdf(PackedBsdf packed, uvec4 layers, vec3 normal) {
    vec2 sheen = unpackHalf2x16(layers.y);
    vec2 f0_b_f90 = unpackHalf2x16(packed.rest.y);
    vec2 alpha_coat = unpackHalf2x16(packed.rest.z);
    Bsdf bsdf = Bsdf(packed.diffuse_viewer.rgb, vec3(unpackHalf2x16(packed.rest.x), f0_b_f90.x), f0_b_f90.y,
                     abs(alpha_coat.x), unpackHalf2x16(packed.rest.w), alpha_coat.y,
                     Sheen(vec3(unpackHalf2x16(layers.x), sheen.x), sheen.y), unpackHalf2x16(layers.z).x, layers.w);
    return VisibleBsdf(normal, decode_direction(floatBitsToUint(packed.diffuse_viewer.w)), bsdf,
                       (packed.rest.z & COATED) != 0u);
}

vec3 evaluate_bsdf(VisibleBsdf visible, vec3 l) {
    vec3 value = vec3(1.0);
    if (GLOSSY) {
        value = evaluate_bsdf(visible.bsdf, visible.normal, visible.viewer, l);
    }
    return value;
}

// The part of a photon's flux that is scattered to the viewer, 1/sr. Its direction is coded; a photon that doesn't count may have
// none.
vec3 gathered_part(VisibleBsdf visible, uint direction) {
    vec3 part = vec3(1.0);
    if (GLOSSY) {
        vec3 l = -decode_direction(direction);
        float cosine = visible.coated ? max(dot(visible.normal, l), 0.0) : 1.0;
        part = cosine * evaluate_bsdf(visible, l);
    }
    return part;
}

// Whether it has a reflection that may be too narrow for points of lights to find it.
bool has_narrow_lobe(VisibleBsdf visible) {
    return GLOSSY && visible.bsdf.alpha > 0.0;
}

float probability_of_lobe(VisibleBsdf visible) {
    float probability = 0.0;
    if (has_narrow_lobe(visible)) {
        probability = reflection_probability(visible.bsdf, dot(visible.normal, visible.viewer));
    }
    return probability;
}

// A direction to where light may come from: u.x chooses among the lobes.
vec3 sample_bsdf(VisibleBsdf visible, vec3 u) {
    vec3 l = cosine_direction(visible.normal, u.yz);
    if (GLOSSY) {
        if (u.x < probability_of_lobe(visible)) {
            l = reflected_direction(visible.bsdf, visible.normal, visible.viewer, u.yz);
        }
    }
    return l;
}

// The density by which `sample_bsdf` has chosen it, per solid angle.
float bsdf_density(VisibleBsdf visible, vec3 l) {
    float density = dot(l, visible.normal) / PI;
    if (has_narrow_lobe(visible)) {
        float of_lobe = reflected_density(visible.bsdf, visible.normal, visible.viewer, l);
        density = mix(density, of_lobe, probability_of_lobe(visible));
    }
    return density;
}

#endif
