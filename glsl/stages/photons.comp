#version 460
#extension GL_GOOGLE_include_directive : require
// Photon tracing: each invocation (a lane) emits and follows its share of the batch's photon paths, one after the
// other in one loop, so that no lane of a subgroup waits for another's longer path. A lane stores its photons in a
// region of its own, which makes their order a pure function of the seed.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "sampling.glsl"
#include "gloss.glsl"
#include "random.glsl"
#include "texel.glsl"
#include "scene.glsl"
#include "intersect.glsl"
#include "texture.glsl"
#include "alpha.glsl"
#include "bsdf.glsl"
#include "dispersion.glsl"
#include "media.glsl"
#include "contact.glsl"
#include "encounter.glsl"
#include "light.glsl"
#include "guide.glsl"
#include "path_start.glsl"
#include "photon.glsl"
#include "grid.glsl"
#include "demand.glsl"
#include "status.glsl"

layout(constant_id = 3) const bool SAMPLE_LIGHTS = true;
layout(constant_id = 25) const bool DROP_UNWANTED = true; // photons that no visible point can accept aren't stored

layout(std430) readonly buffer Grid { GridShape grid; };
uniform usamplerBuffer Demand;
uniform usamplerBuffer PathStarts;
layout(std430) writeonly buffer LanePhotons { Photon lane_photons[]; };
layout(std430) writeonly buffer LaneCounts { uint lane_counts[]; };
layout(std430) writeonly buffer LaneOffsets { uint lane_offsets[]; }; // the same, to be summed up
layout(std430) writeonly buffer PathValues { uint path_values[]; }; // of an iteration's first batch

struct Path {
    vec3 origin;
    vec3 direction;
    vec3 flux;
    uint depth;
    PlacedTriangle ignored;
    Media media; // that it is in
    float wavelength; // nm; 0: of all
    bool seen_directly; // no bounce since the light: direct light, which `direct` samples
    bool caustic;       // mirrors and glass alone since the light
    float inverse_range; // of the light, until the first surface
};

Path path_from(uint start) {
    PathStart from = PATH_START(PathStarts, start);
    Path path;
    path.origin = from.origin;
    path.direction = from.direction;
    path.flux = from.flux;
    path.depth = 0u;
    path.ignored = PlacedTriangle(from.triangle, NO_INSTANCE);
    path.media = media_of_light(from.light);
    path.wavelength = 0.0;
    path.seen_directly = true;
    path.caustic = true;
    path.inverse_range = from.inverse_range;
    return path;
}

// Russian roulette that keeps the photons' powers alike: survives with the ratio of its largest channels.
bool survives(inout vec3 flux, vec3 scattered, float u) {
    float arriving = largest(flux);
    float probability = arriving > 0.0 ? min(1.0, largest(scattered) / arriving) : 0.0;
    if (u >= probability) {
        return false;
    }
    flux = scattered / probability;
    return true;
}

// What visible points want of a photon: see `demand`.
float demand_at(vec3 position, uint object, uint map) {
    uint of_shell = map * SHELLS + shell_of(position);
    ivec3 cell = cell_of(position, grid.inverse_cell_size[of_shell] * (1.0 / COARSENING));
    uint entry = demand_entry(cell, of_shell, object);
    return TEXEL(Demand, entry >> 2u)[entry & 3u];
}

// What a path was worth, and the rays that it traced, for where later ones are aimed; see emission::PathValue. One that was
// rejected at its start has neither.
void note_value(uint path, float value, uint rays) {
    if (AIMED && push.first_path == 0u) {
        path_values[path] = (floatBitsToUint(value) << 1u & 0xffffff00u) | min(rays, 255u);
    }
}

void main() {
    uint lane = invocation_index();
    if (lane >= settings.photon_lanes) {
        return;
    }
    uint stored = 0u;
    uint landed = 0u;
    float value = 0.0; // of the path: squared errors that its photons make of the picture
    uint rays = 0u;    // of the path
    uint next = lane;
    bool alive = false;
    Path path;
    Random random;
    uint truncated = 0u;
    uint non_finite = 0u;
    bool finished = false;
    while (!finished && !loops_cut) {
        loop_count += 1u;
        if (!alive) {
            if (next > lane) {
                note_value(next - settings.photon_lanes, value, rays);
            }
            finished = next >= push.path_count;
            if (!finished) {
                random = random_of_path(next);
                random.dimension = START_NUMBERS;
                path = path_from(next);
                value = 0.0;
                rays = 0u;
                next += settings.photon_lanes;
                alive = largest(path.flux) > 0.0;
            }
        }
        Hit hit = NO_HIT;
        if (alive) {
            rays += 1u;
            hit = trace_visible(path.origin, path.direction, AT_ORIGIN, 1e30, path.ignored, false, random);
        }
        if (hit.triangle == MISS) {
            alive = alive && loops_cut;
        } else if (!loops_cut) {
            vec3 incoming = path.direction;
            Encounter met = encounter(hit, incoming, path.media, false, random);
            Material material = met.material;
            if (ABSORPTION) {
                path.flux *= transmittance(met.through.first, hit.t);
            }
            if (PUNCTUAL_LIGHTS) {
                // A range is how far the light itself reaches, not what it lights.
                path.flux *= range_window(path.inverse_range, hit.t);
                path.inverse_range = 0.0;
            }
            alive = largest(path.flux) > 0.0;
            bool hidden = NESTED && met.hidden;
            if (NESTED && hidden) {
                path.flux *= met.tint;
                path.media = met.beyond;
                // No ray to a light passes it.
                path.seen_directly = false;
            } else if (alive) {
                vec4 u = next4(random);
                bool stores = choose_part(material, u.w) || is_matte(material) || is_glossy(material) ||
                              (is_coated(material) && material.coat_roughness * material.coat_roughness >= FOLLOWED_ALPHA);
                vec3 landing = path.flux;
                if (stores) {
                    landing *= landing_correction(met.facing, incoming);
                    if (!finite(landing)) {
                        non_finite += 1u;
                    } else if (!(SAMPLE_LIGHTS && path.seen_directly)) {
                        landed += 1u;
                        uint map = settings.photon_maps > 1u && path.caustic && !path.seen_directly ? 1u : 0u;
                        float wanted = 1.0;
                        if (DROP_UNWANTED) {
                            wanted = demand_at(met.surface.position, met.surface.object, map);
                        }
                        if (wanted > 0.0) {
                            float flux = (landing.r + landing.g + landing.b) * (1.0 / 3.0);
                            value = min(value + wanted * flux * flux, 1e37);
                            if (stored < settings.lane_capacity) {
                                Photon photon;
                                photon.position_object =
                                    vec4(met.surface.position, uintBitsToFloat(met.surface.object | map << 31u));
                                vec3 flux_there = landing;
                                if (has_coat(met.surface.material)) {
                                    // Across the ray: a coat has another shading normal than what lies below it.
                                    flux_there = path.flux / -dot(incoming, met.facing.geometric_normal);
                                }
                                // What is there in part is seen in part as well as met in part.
                                photon.flux_direction =
                                    vec4(flux_there / met.share, uintBitsToFloat(encode_direction(incoming)));
                                lane_photons[stored * settings.photon_lanes + lane] = photon;
                            }
                            stored += 1u;
                        }
                    }
                }
                path.seen_directly = false;
                float layer = 1.0;
                if (is_coated(material)) {
                    layer = choose_layer(material, met.facing, met.surface, incoming, next4(random).x);
                    landing = path.flux * (layer * landing_correction(met.facing, incoming));
                }
                if (is_matte(material) || is_glossy(material)) {
                    path.caustic = false;
                    // Drawn around the geometric normal, the outgoing direction needs no second correction.
                    vec3 outgoing = cosine_direction(met.facing.geometric_normal, u.xy);
                    float guided = 1.0;
                    if (AIMED && is_matte(material)) {
                        guided = guide(met.surface.position, met.facing.geometric_normal, u, outgoing);
                    }
                    vec3 scattered = landing * material.base_color;
                    if (is_glossy(material)) {
                        scattered = landing * scatter(reflector_of(material), met.facing, -incoming, u, outgoing);
                    }
                    alive = dot(outgoing, met.facing.shading_normal) > 0.0 && finite(scattered) &&
                            survives(path.flux, scattered, u.z);
                    // Those that are aimed shall come there, with less flux each.
                    path.flux *= guided;
                    alive = alive && guided > 0.0;
                    path.direction = outgoing;
                } else if (is_mirror(material)) {
                    float cos_i = -dot(incoming, met.facing.shading_normal);
                    if (is_coated(material)) {
                        layer *= coat_passes(material.coat, cos_i);
                    }
                    alive = survives(path.flux, path.flux * layer * fresnel_schlick(material.base_color, cos_i), u.z);
                    path.direction = mirror_direction(met.facing, incoming);
                } else if (DIELECTRICS) {
                    if (DISPERSION) {
                        path.flux *= disperse(material, path.wavelength, random);
                    }
                    Boundary boundary = meet_boundary(met.facing, incoming, material, met.outside, u.yw);
                    bool reflected = u.x < boundary.reflectance;
                    vec3 weight = reflected ? boundary.reflected_weight : met.tint * boundary.refracted_weight;
                    alive = survives(path.flux, path.flux * (layer * weight), u.z);
                    path.direction = reflected ? boundary.reflected : boundary.refracted;
                    path.media = met.beyond;
                    if (reflected) {
                        path.media = met.through;
                    }
                }
            }
            path.origin = origin_towards(met.surface, path.direction);
            path.ignored = met.surface.triangle;
            path.depth += hidden ? 0u : 1u;
            if (alive && path.depth >= settings.max_depth) {
                truncated += 1u;
                alive = false;
            }
        }
    }
    uint kept = min(stored, settings.lane_capacity);
    lane_counts[lane] = kept;
    lane_offsets[lane] = kept;
    atomicMax(status.lane_need, stored);
    uint landed_before = atomicAdd(status.photons_landed_low, landed);
    if (landed_before + landed < landed) {
        atomicAdd(status.photons_landed_high, 1u);
    }
    if (stored > settings.lane_capacity) {
        atomicOr(status.again, PHOTONS_DID_NOT_FIT);
    }
    if (!finished) {
        // The loop's own end was never reached: the driver or the limit cut it. Fewer paths a lane may help.
        uint begun = alive ? 1u : 0u;
        uint left = next < push.path_count ? (push.path_count - 1u - next) / settings.photon_lanes + 1u : 0u;
        atomicAdd(status.cut_paths, begun + left);
        if (push.path_count > settings.photon_lanes) {
            atomicOr(status.again, LANES_TOO_LONG);
        }
    }
    if (truncated > 0u) {
        atomicAdd(status.truncated_paths, truncated);
    }
    if (non_finite > 0u) {
        atomicAdd(status.non_finite, non_finite);
    }
}
