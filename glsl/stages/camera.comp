#version 460
#extension GL_GOOGLE_include_directive : require
// Camera paths: follows each pixel's path over mirrors and glass to its visible points.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "common/sampling.glsl"
#include "common/camera.glsl"
#include "trace/interaction.glsl"
#include "bsdf/bsdf.glsl"
#include "lights/environment.glsl"
#include "lights/delta_lights.glsl"
#include "gather/visible_point.glsl"
#include "common/status.glsl"

// Visible points per pixel. Above 1, glass splits the path as long as a slot is free (the paper's estimator, whose visible points
// are found once and have to cover both branches).
layout(constant_id = 1) const uint SLOTS = 1u;

layout(push_constant) uniform CameraTurnPush {
    uint iteration;
    uint path;  // index of the camera path among those of the pixel in this iteration
    uint paths;
} push;

layout(std430) writeonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(std430) writeonly buffer Footprints { float footprints[]; };
layout(std430) writeonly buffer PackedBsdfs { uvec4 packed_bsdfs[]; };

struct Branch {
    vec3 origin;
    vec3 direction;
    vec3 throughput;
    vec3 emitted;
    float way; // distance from the camera so far
    uint depth;
    PlacedTriangle ignored;
    Media media;          // of the ray
    float wavelength;     // nm; 0: all wavelengths
    bool reflection_seen; // emitters in the reflection of a boundary that did not split the path are added
    bool lamps_seen;      // lights with an extent along the ray are added
};

// Distance to the hit, in lengths of the ray's direction.
float way_of(Hit hit) {
    return hit.triangle == MISS ? 1e30 : hit.t;
}

// The transmitted ray of a boundary is stored while the reflected ray is traced for emitters, before one of both is followed: the
// faint reflection of a lamp in glass, sampled by a rare choice only, would be a bright speck.
void store_transmitted(vec3 origin, vec3 direction, vec3 throughput, Media media) {
    keep(FIRST_KEPT_BY_KERNEL, origin);
    keep(FIRST_KEPT_BY_KERNEL + 3u, direction);
    keep(FIRST_KEPT_BY_KERNEL + 6u, throughput);
    keep_media(FIRST_KEPT_BY_KERNEL + 9u, media);
}

void load_transmitted(inout Branch branch) {
    branch.origin = kept(FIRST_KEPT_BY_KERNEL);
    branch.direction = kept(FIRST_KEPT_BY_KERNEL + 3u);
    branch.throughput = kept(FIRST_KEPT_BY_KERNEL + 6u);
    branch.media = kept_media(FIRST_KEPT_BY_KERNEL + 9u);
}

void main() {
    uint pixel_slot = invocation_index();
    if (pixel_slot >= pixel_slots() || status.retry != 0u) {
        return;
    }
    uvec2 pixel;
    bool inside = has_pixel(pixel_slot, pixel);

    CameraTurn turn = CameraTurn(push.iteration, push.path, push.paths);
    Random random = random_of_pixel(CAMERA_PATH, number_in_picture(pixel), turn, settings.seed);
    vec4 u = next4(random);

    uint slots_of_pixel = SLOTS;
    bool many = slots_of_pixel > 1u;
    Branch pending[SLOTS];
    uint pending_count = 0u;
    uint used = 0u;
    Branch branch;
    sample_camera_ray(pixel, u.xy, random, branch.origin, branch.direction);
    branch.throughput = vec3(1.0);
    branch.emitted = vec3(0.0);
    branch.way = 0.0;
    branch.depth = 0u;
    branch.ignored = NO_TRIANGLE;
    branch.media = media_from(settings.camera_media);
    branch.wavelength = 0.0;
    branch.reflection_seen = false;
    branch.lamps_seen = false;

    // Reflectance of the boundary whose transmitted ray is stored; negative if the reflected ray will not be followed.
    float waits = 0.0;
    LightRay light_ray = NO_LIGHT_RAY;
    bool alive = inside;
    bool ended = false;
    bool cut = false;
    bool met_surface = false;
    bool found = false; // a visible point
    Progress progress = AT_ORIGIN; // past culled back faces
    while (alive) {
        loop_count += 1u;
        uint slot = pixel_slot * SLOTS + used;
        // All rays of a path are traced here: each call would compile the traversal again.
        bool is_light_ray = contributes(light_ray);
        vec3 origin = is_light_ray ? light_ray.origin : branch.origin;
        vec3 direction = is_light_ray ? light_ray.direction : branch.direction;
        PlacedTriangle ignored = PlacedTriangle(is_light_ray ? MISS : branch.ignored.triangle, branch.ignored.instance);
        Hit hit = trace_visible(origin, direction, progress, is_light_ray ? light_ray.end : 1e30, ignored, is_light_ray, random);
        bool missed = hit.triangle == MISS;
        vec3 from_light = missed ? light_ray.contribution : vec3(0.0);
        light_ray = NO_LIGHT_RAY;
        if (loops_cut) {
            cut = true;
            ended = true;
        } else if (is_light_ray) {
            branch.emitted += from_light;
        } else {
            bool culls = branch.depth == 0u;
            bool dark = missed;       // nothing at the hit scatters light
            bool passes_back = false; // a culled back face
            vec3 passed = vec3(1.0); // transmittance along the ray
            if (!branch.lamps_seen) {
                vec3 from = branch.origin + progress.t * branch.direction;
                branch.emitted += branch.throughput * soft_lights_along(from, branch.direction, way_of(hit) - progress.t,
                                                                        branch.media.first);
            }
            SurfaceInteraction met = no_interaction();
            if (missed) {
                branch.emitted += branch.throughput * environment_radiance_along(branch.direction);
            } else {
                met = interact(hit, branch.direction, branch.media, culls, random);
                passes_back = culls && is_hidden_back(met.surface, met.material, branch.direction);
                passed = transmittance(met.through.first, hit.t);
                if (!met.hidden && !passes_back && emits(met.material, met.frame.front)) {
                    float cosine = -dot(branch.direction, met.frame.geometric_normal);
                    branch.emitted += branch.throughput * passed * emitted_radiance(met.material, cosine);
                }
                dark = is_black(met.material);
            }
            bool goes_on = !passes_back;
            progress = AT_ORIGIN;
            if (passes_back) {
                progress = past(hit);
            } else if (waits != 0.0) {
                bool passes = dark || waits < 0.0;
                float reflectance = abs(waits);
                waits = 0.0;
                branch.throughput *= 1.0 / reflectance;
                goes_on = !passes;
                if (passes) {
                    load_transmitted(branch);
                    // The reflection is complete: nothing at its hit scatters light.
                    branch.throughput *= dark ? 1.0 - reflectance : 1.0;
                }
            }
            if (goes_on && missed) {
                ended = true;
            } else if (goes_on) {
                branch.way += hit.t;
                branch.throughput *= passed;
                branch.ignored = met.surface.triangle;
                branch.lamps_seen = false;
                if (met.hidden) {
                    branch.throughput *= met.tint;
                    branch.media = met.beyond;
                } else {
                    met_surface = true;
                    vec3 incoming = branch.direction;
                    branch.throughput *= choose_lobe(met, incoming, random);
                    bool follows = is_followed(met.material);
                    bool stops = !follows;
                    ended = true;
                    if (follows && branch.depth + 1u >= settings.max_depth) {
                        atomicAdd(status.truncated_paths, 1u);
                        // What isn't reflected needs no further ray.
                        stops = has_base(met.material);
                    } else if (follows) {
                        branch.depth += 1u;
                        u = next4(random);
                        if (shows_delta_lights(met.material)) {
                            branch.lamps_seen = true;
                            if (many) {
                                branch.emitted += branch.throughput * all_delta_lights(met, -incoming, random);
                            } else {
                                light_ray = sample_delta_light(met, -incoming, random);
                                light_ray.contribution *= branch.throughput;
                            }
                        }
                        vec3 color;
                        Branching ways = branch_bsdf(met, incoming, u.yz, branch.wavelength, random, color);
                        branch.throughput *= color;
                        float p = ways.reflectance;
                        bool uncertain = p > 0.0 && p < 1.0;
                        bool splits = many && uncertain && used + pending_count + 1u < SLOTS;
                        bool peeks = ways.transmits && !splits && !branch.reflection_seen && uncertain;
                        bool reflects = !splits && (peeks || u.x < p);
                        if (many && splits) {
                            Branch reflected = branch;
                            reflected.direction = ways.reflected;
                            reflected.throughput *= p * ways.reflected_weight;
                            if (ways.transmits) {
                                reflected.media = met.through;
                            }
                            reflected.origin = origin_towards(met.surface, reflected.direction);
                            reflected.emitted = vec3(0.0);
                            pending[pending_count] = reflected;
                            pending_count += 1u;
                            ways.transmitted_weight *= 1.0 - p;
                        }
                        if (peeks) {
                            waits = u.x < p ? p : -p;
                            store_transmitted(origin_towards(met.surface, ways.transmitted), ways.transmitted,
                                     branch.throughput * ways.transmitted_weight, met.beyond);
                            branch.reflection_seen = true;
                            branch.throughput *= p;
                        }
                        branch.throughput *= reflects ? ways.reflected_weight : ways.transmitted_weight;
                        branch.direction = reflects ? ways.reflected : ways.transmitted;
                        if (ways.transmits) {
                            branch.media = met.through;
                            if (!reflects) {
                                branch.media = met.beyond;
                            }
                        }
                        stops = !reflects && !ways.transmits;
                        ended = stops || (largest(branch.throughput) <= 0.0 && waits == 0.0);
                    }
                    // A visible point has the base of the surface, and its reflection unless that is so narrow that the path
                    // follows it.
                    Bsdf bsdf = bsdf_of(met.material);
                    if (follows) {
                        bsdf = base_of(bsdf);
                    }
                    if (stops && scatters(bsdf)) {
                        if (carries_bsdf()) {
                            STORE_BSDF(packed_bsdfs, slot, bsdf, -incoming, has_coat(met.surface.material));
                        }
                        found = true;
                        visible_points[slot].position = met.surface.position;
                        visible_points[slot].object = met.surface.object;
                        visible_points[slot].weight = branch.throughput * weight_of(bsdf);
                        visible_points[slot].geometric_normal = encode_direction(met.frame.geometric_normal);
                        visible_points[slot].shading_normal = encode_direction(met.frame.shading_normal);
                    }
                }
                branch.origin = origin_towards(met.surface, branch.direction);
            }
        }
        if (ended && !contributes(light_ray)) {
            if (found) {
                visible_points[slot].emitted = branch.emitted;
            } else {
                visible_points[slot] = no_visible_point(branch.emitted, met_surface);
            }
            footprints[slot] = settings.pixel_spread * (is_orthographic() ? 1.0 : branch.way);
            used += 1u;
            alive = pending_count > 0u && !cut;
            if (alive) {
                pending_count -= 1u;
                branch = pending[pending_count];
                ended = false;
                found = false;
            }
        }
    }
    if (cut || loops_cut) {
        atomicAdd(status.cut_paths, 1u);
    }
    for (; used < SLOTS; used++) {
        visible_points[pixel_slot * SLOTS + used] = no_visible_point(vec3(0.0), false);
    }
}
