#version 460
#extension GL_GOOGLE_include_directive : require
// Photon tracing: each invocation (a lane) follows its share of the batch's photon paths, one after the other in one loop, so
// that no invocation of a subgroup waits for another's longer path. A lane stores its photons in its own region, which makes
// their order a pure function of the seed.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "trace/interaction.glsl"
#include "bsdf/bsdf.glsl"
#include "lights/light.glsl"
#include "lights/aim.glsl"
#include "common/path_start.glsl"
#include "gather/photon.glsl"
#include "gather/grid.glsl"
#include "gather/demand.glsl"
#include "common/status.glsl"

layout(constant_id = 3) const bool SAMPLE_LIGHTS = true;
layout(constant_id = 25) const bool DROP_UNWANTED = true; // photons that no visible point can accept are not stored

layout(std430) readonly buffer Grid { GridShape grid; };
uniform usamplerBuffer Demand;
uniform usamplerBuffer PathStarts;
layout(std430) writeonly buffer LanePhotons { Photon lane_photons[]; };
layout(std430) writeonly buffer LaneCounts { uint lane_counts[]; };
layout(std430) writeonly buffer LaneOffsets { uint lane_offsets[]; }; // the same, for a prefix sum
layout(std430) writeonly buffer PathValues { uint path_values[]; }; // of an iteration's first batch

struct Path {
    vec3 origin;
    vec3 direction;
    vec3 flux;
    uint depth;
    PlacedTriangle ignored;
    Media media; // of the ray
    float wavelength; // nm; 0: all wavelengths
    float guided; // factor by which aiming at bounces has weighted the flux
    bool seen_directly; // no bounce since the light: direct light, which `direct` samples
    bool caustic;       // only mirrors and glass since the light
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
    path.guided = 1.0;
    path.seen_directly = true;
    path.caustic = true;
    path.inverse_range = from.inverse_range;
    return path;
}

// Russian roulette that keeps the flux of photons similar: the survival probability is the ratio of the largest channels.
bool survives(inout vec3 flux, vec3 scattered, float u) {
    float arriving = largest(flux);
    float probability = arriving > 0.0 ? min(1.0, largest(scattered) / arriving) : 0.0;
    flux = scattered / max(probability, 1e-37);
    return u < probability;
}

// Demand for a photon, see stage `demand`.
float demand_at(vec3 position, uint object, uint map) {
    uint of_shell = map * SHELLS + shell_of(position);
    ivec3 cell = cell_of(position, grid.inverse_cell_size[of_shell] * (1.0 / COARSENING));
    uint entry = demand_entry(cell, of_shell, object);
    return TEXEL(Demand, entry >> 2u)[entry & 3u];
}

// Stores the value of a path and its number of rays, from which the emission table is learned; see emission::PathValue. Both are
// 0 for a path that was rejected at its start.
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
    float value = 0.0; // of the path: squared errors that its photons cause in the picture
    uint rays = 0u;    // of the path
    uint next = lane;
    bool alive = false;
    // Values that are equal for all paths are set before the loop: they take no vector registers.
    Random random = random_of_path(lane);
    Path path = Path(vec3(0.0), vec3(0.0), vec3(0.0), 0u, NO_TRIANGLE, IN_VACUUM, 0.0, 1.0, true, true, 0.0);
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
                turn_to_path(random, next);
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
            SurfaceInteraction met = interact(hit, incoming, path.media, false, random);
            path.flux *= transmittance(met.through.first, hit.t);
            // The range of a light applies to its first segment only.
            path.flux *= range_window(path.inverse_range, hit.t);
            path.inverse_range = 0.0;
            path.ignored = met.surface.triangle;
            alive = largest(path.flux) > 0.0;
            if (met.hidden) {
                path.flux *= met.tint;
                path.media = met.beyond;
                // Shadow rays do not pass this boundary.
                path.seen_directly = false;
            } else if (alive) {
                vec4 u = next4(random);
                if (keeps_photons(met.material)) {
                    vec3 landing = path.flux * landing_correction(met.frame, incoming);
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
                            value = min(value + (wanted > LEAST_DEMAND ? wanted * flux * flux : 0.0), 1e37);
                            if (stored < settings.lane_capacity) {
                                // A partly transparent surface is seen in part as well as hit in part.
                                vec3 flux_there = path.flux * kept_factor(met, incoming) / met.opacity;
                                lane_photons[stored * settings.photon_lanes + lane] =
                                    Photon(met.surface.position, met.surface.object | map << 31u,
                                           flux_there, encode_direction(incoming));
                            }
                            stored += 1u;
                        }
                    }
                }
                path.seen_directly = false;
                BsdfSample way = sample_bsdf(met, incoming, u, path.wavelength, random);
                float guided = 1.0;
                if (AIMED && way.lambertian) {
                    float share = guided_share(path.guided);
                    guided = guide(met.surface.position, met.frame.geometric_normal, u, share, way.direction);
                }
                path.flux *= way.color;
                vec3 scattered = path.flux * way.weight;
                alive = is_possible(way, met.frame) && finite(scattered) && survives(path.flux, scattered, u.z);
                // Weighted after Russian roulette: many aimed photons survive, with less flux each.
                path.flux *= guided;
                path.guided *= guided;
                alive = alive && guided > 0.0;
                path.direction = way.direction;
                path.caustic = path.caustic && way.specular;
                if (way.at_boundary) {
                    path.media = met.through;
                    if (way.transmitted) {
                        path.media = met.beyond;
                    }
                }
                path.depth += 1u;
            }
            path.origin = origin_towards(met.surface, path.direction);
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
        atomicOr(status.retry, PHOTONS_DID_NOT_FIT);
    }
    if (!finished) {
        // The driver or the limit cut the loop. Fewer paths per lane may help.
        uint begun = alive ? 1u : 0u;
        uint left = next < push.path_count ? (push.path_count - 1u - next) / settings.photon_lanes + 1u : 0u;
        atomicAdd(status.cut_paths, begun + left);
        if (push.path_count > settings.photon_lanes) {
            atomicOr(status.retry, LANES_TOO_LONG);
        }
    }
    if (truncated > 0u) {
        atomicAdd(status.truncated_paths, truncated);
    }
    if (non_finite > 0u) {
        atomicAdd(status.non_finite, non_finite);
    }
}
