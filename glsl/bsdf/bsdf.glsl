// How surfaces scatter: the room's front for paths. What gathers for visible points needs `reflection.glsl` alone. Include after
// common/random.glsl.
#ifndef BSDF_BSDF
#define BSDF_BSDF

#include "bsdf/dielectric.glsl"

// A surface that passes a part of the light only is by chance all clear or all glossy; u is a uniform number again after that.
void choose_part(inout Material material, inout float u) {
    if (is_mixed(material)) {
        float t = material.transmission * (1.0 - material.metallic);
        material.metallic = min(material.metallic / (1.0 - t), 1.0); // of what isn't clear
        bool clear = u < t;
        u = clear ? u / t : (u - t) / (1.0 - t);
        material.surface = clear ? DIELECTRIC : GLOSSY_SURFACE;
    }
}

// What a ray meets of a coated surface is by chance the coat, which then is the material, or what lies below it. Returns the
// factor of what the path carries; u is a uniform number. Of what is all clear, the inside has no coat.
float choose_layer(inout SurfaceInteraction met, vec3 incoming, float u) {
    float factor = 1.0;
    bool coated = met.frame.front || !is_dielectric(met.material) || is_thin(met.material);
    if (is_coated(met.material) && coated) {
        vec3 n = met.frame.front ? met.surface.coat_normal : -met.surface.coat_normal;
        n = dot(incoming, n) < 0.0 ? n : met.frame.geometric_normal;
        // At least a quarter, as of any reflection; and 0.9 at the most, so that what a rough coat passes at grazing angles isn't
        // found by a rare choice.
        float coat = met.material.coat;
        float p = clamp(1.0 - coat_passes(coat, -dot(incoming, n)), 0.25 * coat, 0.9);
        bool is_coat = u < p;
        factor = 1.0 / (is_coat ? p : 1.0 - p);
        if (is_coat) {
            met.frame.shading_normal = n;
            met.material = coat_of(met.material);
        }
    }
    return factor;
}

// By chance one of a surface's parts and layers, for a path from the camera. Returns the factor of what it carries.
float choose_lobe(inout SurfaceInteraction met, vec3 incoming, inout Random random) {
    float factor = 1.0;
    if (is_mixed(met.material)) {
        float u = next4(random).x;
        choose_part(met.material, u);
    }
    if (is_coated(met.material)) {
        factor = choose_layer(met, incoming, next4(random).x);
    }
    return factor;
}

// Whether a path from the camera goes on here: what the surface shows is too narrow for photons.
bool is_followed(Material material) {
    return !(is_matte(material) || (is_glossy(material) && material.roughness * material.roughness >= FOLLOWED_ALPHA));
}

// Whether what is followed lies over a base, which visible points show.
bool has_base(Material material) {
    return is_glossy(material);
}

// Whether what is followed has a width, so that lights that are points show in it.
bool has_width(Material material) {
    bool is_rough = is_glossy(material) && material.roughness * material.roughness >= SMOOTH_ALPHA;
    return is_rough || (is_dielectric(material) && is_rough_glass(material));
}

// BSDF · cos of what is followed, for light that comes along -l.
vec3 evaluate_followed(SurfaceInteraction met, vec3 viewer, vec3 l) {
    vec3 n = met.frame.shading_normal;
    bool same_side = dot(l, met.frame.geometric_normal) > 0.0;
    vec3 response = vec3(0.0);
    if (is_dielectric(met.material)) {
        response = evaluate_dielectric(met.frame, viewer, l, met.material, met.outside) * (same_side ? vec3(1.0) : met.tint);
    } else if (same_side && dot(l, n) > 0.0) {
        response = evaluate_boundary(bsdf_of(met.material), n, viewer, l) * dot(l, n);
    }
    return response;
}

// The ways on from what is followed: a reflection, and what isn't reflected.
struct Branching {
    float reflectance; // the reflection's probability
    vec3 reflected;    // direction
    vec3 reflected_weight; // BSDF · cos / density
    bool transmits;    // what isn't reflected passes the surface; else it reaches the base, where the path ends
    vec3 transmitted;
    vec3 transmitted_weight;
};

// `wavelength`: the path's, which it may get here; `color`: what that makes of what the path carries.
Branching branch_bsdf(SurfaceInteraction met, vec3 incoming, vec2 u, inout float wavelength, inout Random random,
                      out vec3 color) {
    color = vec3(1.0);
    Branching ways = Branching(1.0, vec3(0.0), vec3(0.0), false, vec3(0.0), vec3(0.0));
    float cosine = -dot(incoming, met.frame.shading_normal);
    if (is_dielectric(met.material)) {
        if (DISPERSION) {
            color = disperse(met.material, wavelength, random);
        }
        Boundary boundary = sample_dielectric(met.frame, incoming, met.material, met.outside, u);
        ways.reflectance = boundary.reflectance;
        ways.reflected = boundary.reflected;
        ways.reflected_weight = boundary.reflected_weight;
        ways.transmits = true;
        ways.transmitted = boundary.refracted;
        // Radiance is compressed on its way into the denser medium: Veach, 1997, section 5.2.
        ways.transmitted_weight = met.tint * (boundary.eta * boundary.eta * boundary.refracted_weight);
    } else if (is_glossy(met.material)) {
        Bsdf bsdf = bsdf_of(met.material);
        vec3 n = met.frame.shading_normal;
        float p = reflection_probability(bsdf, cosine);
        ways.reflected = mirror_direction(met.frame, incoming);
        if (bsdf.alpha >= SMOOTH_ALPHA) {
            ways.reflected = reflected_direction(bsdf, n, -incoming, u);
        }
        ways.reflectance = p;
        // Microfacets may reflect into the surface.
        vec3 weight = reflected_weight(bsdf, n, -incoming, ways.reflected) * (1.0 / max(p, 1e-20));
        ways.reflected_weight = dot(ways.reflected, met.frame.geometric_normal) > 0.0 ? weight : vec3(0.0);
        ways.transmitted_weight = vec3(1.0 / max(1.0 - p, 1e-20));
    } else if (MIRRORS) {
        ways.reflected = mirror_direction(met.frame, incoming);
        ways.reflected_weight = fresnel_schlick(met.material.base_color, cosine);
        if (is_coated(met.material)) {
            ways.reflected_weight *= coat_passes(met.material.coat, cosine);
        }
    }
    return ways;
}

// Whether visible points lie on it, so that photons are kept there.
bool keeps_photons(Material material) {
    bool coat = is_coated(material) && material.coat_roughness * material.coat_roughness >= FOLLOWED_ALPHA;
    return is_mixed(material) || is_matte(material) || is_glossy(material) || coat;
}

// Whether a material has a coat anywhere: photons on it have their flux across their rays.
bool has_coat(uint material) {
    return is_coated(material_at(material));
}

// Photons are scattered as camera paths see it, by the adjoint BSDF: with a shading normal it isn't symmetric. Veach, «Robust
// Monte Carlo Methods for Light Transport Simulation», 1997, section 5.3. The factor has two parts. Where a photon lands, flux is
// per area of the surface; the shading normal's cosine replaces the geometric one's.
float landing_correction(ShadingFrame frame, vec3 incoming) {
    return dot(incoming, frame.shading_normal) / dot(incoming, frame.geometric_normal);
}

// Where it leaves, the other way round. `cosine`: to the shading normal.
float leaving_correction(ShadingFrame frame, vec3 outgoing, float cosine) {
    return abs(dot(outgoing, frame.geometric_normal)) / max(abs(cosine), 1e-6);
}

// The factor of a photon's flux as it is kept. Of coated surfaces it is that across the ray: a coat has another shading normal
// than what lies below it.
float kept_factor(SurfaceInteraction met, vec3 incoming) {
    float factor = landing_correction(met.frame, incoming);
    if (has_coat(met.surface.material)) {
        factor = -1.0 / dot(incoming, met.frame.geometric_normal);
    }
    return factor;
}

// Where a glossy surface scatters a photon to that comes from v, instead of the cosine-distributed `outgoing` or as that says,
// and the part of the flux that goes there, without the correction where it lands. Chosen by u.w, drawn by u.xy.
vec3 scatter(Bsdf bsdf, ShadingFrame frame, vec3 v, vec4 u, inout vec3 outgoing) {
    vec3 n = frame.shading_normal;
    float nv = dot(n, v);
    float p = reflection_probability(bsdf, nv);
    bool reflects = u.w < p;
    bool is_smooth = bsdf.alpha < SMOOTH_ALPHA;
    if (reflects) {
        outgoing = mirror_direction(frame, -v);
        if (!is_smooth) {
            outgoing = reflected_direction(bsdf, n, v, u.xy);
        }
    }
    float cosine = max(dot(outgoing, frame.geometric_normal), 0.0);
    float density = mix(cosine * (1.0 / PI), reflected_density(bsdf, n, v, outgoing), p);
    float over_density = is_smooth ? PI / (1.0 - p) : cosine / max(density, 1e-20);
    // The cosines of a mirror direction to the shading normal are equal.
    vec3 mirrored = mirrored_part(bsdf, nv, p) * leaving_correction(frame, outgoing, nv);
    return is_smooth && reflects ? mirrored : evaluate_bsdf(bsdf, n, v, outgoing) * over_density;
}

// A way on for a photon.
struct BsdfSample {
    vec3 weight; // BSDF · cos / density
    vec3 direction;
    vec3 color;       // what the wavelength that the path has got here makes of its flux
    bool specular;    // by a mirror or a boundary of a dielectric
    bool lambertian;  // another choice by the cosine may take the direction's place
    bool at_boundary; // the path is in the media on either side
    bool transmitted;
};

BsdfSample sample_bsdf(inout SurfaceInteraction met, vec3 incoming, vec4 u, inout float wavelength, inout Random random) {
    choose_part(met.material, u.w);
    float factor = 1.0;
    if (is_coated(met.material)) {
        factor = choose_layer(met, incoming, next4(random).x);
    }
    BsdfSample way = BsdfSample(vec3(0.0), vec3(0.0), vec3(1.0), true, false, false, false);
    float cosine = -dot(incoming, met.frame.shading_normal);
    if (is_matte(met.material) || is_glossy(met.material)) {
        way.specular = false;
        way.lambertian = is_matte(met.material);
        // Drawn around the geometric normal, the outgoing direction needs no second correction.
        way.direction = cosine_direction(met.frame.geometric_normal, u.xy);
        way.weight = met.material.base_color;
        if (is_glossy(met.material)) {
            way.weight = scatter(bsdf_of(met.material), met.frame, -incoming, u, way.direction);
        }
        way.weight *= factor;
    } else if (is_mirror(met.material)) {
        if (is_coated(met.material)) {
            factor *= coat_passes(met.material.coat, cosine);
        }
        way.direction = mirror_direction(met.frame, incoming);
        way.weight = fresnel_schlick(met.material.base_color, cosine) *
                     (factor * leaving_correction(met.frame, way.direction, cosine));
    } else if (DIELECTRICS) {
        if (DISPERSION) {
            way.color = disperse(met.material, wavelength, random);
        }
        Boundary boundary = sample_dielectric(met.frame, incoming, met.material, met.outside, u.yw);
        way.at_boundary = true;
        way.transmitted = u.x >= boundary.reflectance;
        way.weight = way.transmitted ? met.tint * boundary.refracted_weight : boundary.reflected_weight;
        way.direction = way.transmitted ? boundary.refracted : boundary.reflected;
        bool mirrors = !way.transmitted && !is_rough_glass(met.material);
        float leaving = mirrors ? cosine : dot(way.direction, met.frame.shading_normal);
        way.weight *= factor * leaving_correction(met.frame, way.direction, leaving);
    }
    way.weight *= landing_correction(met.frame, incoming);
    return way;
}

// Whether the direction lies where the surface scatters to.
bool is_possible(BsdfSample way, ShadingFrame frame) {
    return way.specular || dot(way.direction, frame.shading_normal) > 0.0;
}

#endif
