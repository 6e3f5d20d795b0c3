#version 460
#extension GL_GOOGLE_include_directive : require
// Camera rays: follows each pixel's path over mirrors and glass to its visible points.

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
#include "environment.glsl"
#include "light.glsl"
#include "glint.glsl"
#include "visible_point.glsl"
#include "status.glsl"

// Visible points a pixel: above 1, glass splits the path for as long as a slot is free (the paper's estimator, whose
// visible points are found once and have to hold both branches).
layout(constant_id = 1) const uint SLOTS = 1u;
layout(constant_id = 2) const bool JITTER = true;
layout(constant_id = 19) const bool LENS = false;

layout(push_constant) uniform Push {
    uint iteration;
    uint path;  // of the pixel, of so many in this iteration
    uint paths;
} push;

layout(std430) writeonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(std430) writeonly buffer Footprints { float footprints[]; };
layout(std430) writeonly buffer GlossOf { Gloss gloss_of_slots[]; };

struct Branch {
    vec3 origin;
    vec3 direction;
    vec3 throughput;
    vec3 emitted;
    float way; // from the camera so far
    uint depth;
    PlacedTriangle ignored;
    Media media;          // that it is in
    float wavelength;     // nm; 0: of all
    bool reflection_seen; // what a boundary that didn't split the path reflects of the lights' own radiance
    bool lamps_seen;      // what lights with an extent send along the ray
};

// What a ray sees that meets no surface.
vec3 radiance_from_afar(vec3 direction) {
    if (ENVIRONMENT) {
        return environment_at(direction).radiance;
    }
    return vec3(0.0);
}

// Lengths of a ray's direction up to what it met.
float way_of(Hit hit) {
    return hit.triangle == MISS ? 1e30 : hit.t;
}

// What passes a boundary waits while the path looks at what the boundary reflects, before it chooses which of both to follow: a
// lamp's faint reflection in glass, seen by a rare choice alone, would be a bright speck. It waits in shared memory, a place for
// each invocation, since registers are scarce where rays are traced.
shared vec3 passing_origin[64];
shared vec3 passing_direction[64];
shared vec3 passing_throughput[64];
shared uint passing_medium[64];
shared uvec3 passing_other_media[64]; // NESTED

void let_wait(vec3 origin, vec3 direction, vec3 throughput, Media media) {
    uint place = gl_LocalInvocationIndex;
    passing_origin[place] = origin;
    passing_direction[place] = direction;
    passing_throughput[place] = throughput;
    passing_medium[place] = media.first;
    if (NESTED) {
        passing_other_media[place] = media.others;
    }
}

void take_what_waits(inout Branch branch) {
    uint place = gl_LocalInvocationIndex;
    branch.origin = passing_origin[place];
    branch.direction = passing_direction[place];
    branch.throughput = passing_throughput[place];
    branch.media.first = passing_medium[place];
    if (NESTED) {
        branch.media.others = passing_other_media[place];
    }
}

// Follows what a boundary of microfacets reflects, or none of it where that would fly into the surface.
void reflect_branch(inout Branch branch, Reflector reflector, Facing facing, vec2 u) {
    vec3 viewer = -branch.direction;
    branch.direction = reflector.alpha < SMOOTH_ALPHA
                           ? mirror_direction(facing, branch.direction)
                           : reflected_direction(reflector.alpha, facing.shading_normal, viewer, u);
    branch.throughput *= dot(branch.direction, facing.geometric_normal) > 0.0
                             ? reflected_weight(reflector, facing.shading_normal, viewer, branch.direction)
                             : vec3(0.0);
}

void main() {
    uint pixel_slot = invocation_index();
    if (pixel_slot >= pixel_slots() || status.again != 0u) {
        return;
    }
    uvec2 pixel = pixel_of(pixel_slot);
    bool inside = all(lessThan(pixel, settings.resolution));

    Random random =
        random_of_pixel(CAMERA_PATH, pixel.y * settings.resolution.x + pixel.x, CameraTurn(push.iteration, push.path, push.paths),
                        settings.seed);
    vec4 u = next4(random);
    vec2 film = (vec2(pixel) + (JITTER ? u.xy : vec2(0.5))) / vec2(settings.resolution) * 2.0 - 1.0;

    uint slots_of_pixel = SLOTS;
    bool many = slots_of_pixel > 1u;
    Branch pending[SLOTS];
    uint pending_count = 0u;
    uint used = 0u;
    Branch branch;
    vec3 place = film.x * settings.camera_right.xyz - film.y * settings.camera_up.xyz;
    bool parallel = settings.camera_up.w != 0.0;
    branch.origin = settings.camera_position.xyz + (parallel ? place : vec3(0.0));
    branch.direction = settings.camera_forward.xyz + (parallel ? vec3(0.0) : place);
    float lens_radius = settings.camera_position.w;
    if (LENS && lens_radius > 0.0) {
        // All rays of a place in the picture meet where it is in focus.
        vec2 on_lens = lens_radius * disc_point(next4(random).xy);
        vec3 off_axis = on_lens.x * normalize(settings.camera_right.xyz) + on_lens.y * normalize(settings.camera_up.xyz);
        branch.origin += off_axis;
        branch.direction = settings.camera_right.w * branch.direction - off_axis;
    }
    branch.direction = normalize(branch.direction);
    branch.throughput = vec3(1.0);
    branch.emitted = vec3(0.0);
    branch.way = 0.0;
    branch.depth = 0u;
    branch.ignored = NO_TRIANGLE;
    branch.media = IN_VACUUM;
    if (IMMERSED) {
        branch.media = Media(settings.camera_media.x, settings.camera_media.yzw);
    }
    branch.wavelength = 0.0;
    branch.reflection_seen = false;
    branch.lamps_seen = false;

    // Reflectance of a boundary that something which passes it waits for; negative where the reflection won't be followed.
    float waits = 0.0;
    LightRay light_ray = NO_LIGHT_RAY;
    bool alive = inside;
    bool ended = false;
    bool cut = false;
    bool met_surface = false;
    bool found = false; // a visible point
    Progress progress = AT_ORIGIN; // past backs that no camera sees
    while (alive) {
        loop_count += 1u;
        uint slot = pixel_slot * SLOTS + used;
        // A path's rays are all traced here, since the traversal is compiled as often as it is called.
        bool asks = asks_light(light_ray);
        vec3 origin = asks ? light_ray.origin : branch.origin;
        vec3 direction = asks ? light_ray.direction : branch.direction;
        PlacedTriangle ignored = PlacedTriangle(asks ? MISS : branch.ignored.triangle, branch.ignored.instance);
        Hit hit = trace_visible(origin, direction, progress, asks ? light_ray.end : 1e30, ignored, asks, random);
        bool missed = hit.triangle == MISS;
        if (loops_cut) {
            cut = true;
            ended = true;
            light_ray = NO_LIGHT_RAY;
        } else if (asks) {
            branch.emitted += missed ? light_ray.contribution : vec3(0.0);
            light_ray = NO_LIGHT_RAY;
        } else {
            bool culls = CULLING && branch.depth == 0u;
            vec3 seen = vec3(0.0); // radiance along the ray
            bool dark = missed;    // nothing is there that scatters light
            if (SOFT_LIGHTS && !branch.lamps_seen) {
                vec3 from = branch.origin + progress.t * branch.direction;
                seen = soft_lights_along(from, branch.direction, way_of(hit) - progress.t, branch.media.first);
            }
            Encounter met;
            vec3 kept = vec3(1.0); // of what comes along the ray
            if (missed) {
                seen += radiance_from_afar(branch.direction);
            } else {
                met = encounter(hit, branch.direction, branch.media, culls, random);
                if (CULLING && culls && is_hidden_back(met.surface, met.material, branch.direction)) {
                    branch.emitted += branch.throughput * seen;
                    progress = past(hit);
                    continue;
                }
                if (ABSORPTION) {
                    kept = transmittance(met.through.first, hit.t);
                }
                if (!met.hidden && emits(met.material, met.facing.front)) {
                    seen += kept * emitted_radiance(met.material, -dot(branch.direction, met.facing.geometric_normal));
                }
                dark = is_matte(met.material) && largest(met.material.base_color) == 0.0;
            }
            progress = AT_ORIGIN;
            bool goes_on = true;
            branch.emitted += branch.throughput * seen;
            if (DIELECTRICS && waits != 0.0) {
                bool passes = dark || waits < 0.0;
                float reflectance = abs(waits);
                waits = 0.0;
                branch.throughput *= 1.0 / reflectance;
                goes_on = !passes;
                if (passes) {
                    take_what_waits(branch);
                    // In the dark that was all there is to the reflection.
                    branch.throughput *= dark ? 1.0 - reflectance : 1.0;
                }
            }
            if (goes_on && missed) {
                ended = true;
            } else if (goes_on) {
                branch.way += hit.t;
                branch.throughput *= kept;
                branch.ignored = met.surface.triangle;
                branch.lamps_seen = false;
                if (NESTED && met.hidden) {
                    branch.throughput *= met.tint;
                    branch.media = met.beyond;
                    branch.origin = origin_towards(met.surface, branch.direction);
                    continue;
                }
                met_surface = true;
                Material material = met.material;
                if (is_mixed(material)) {
                    u = next4(random);
                    choose_part(material, u.x);
                }
                if (is_coated(material)) {
                    u = next4(random);
                    branch.throughput *= choose_layer(material, met.facing, met.surface, branch.direction, u.x);
                }
                // A visible point has the surface's base, and its reflection unless that is so narrow that the path follows it.
                Reflector reflector = NO_REFLECTOR;
                reflector.diffuse = material.base_color;
                if (is_glossy(material)) {
                    reflector = reflector_of(material);
                }
                vec3 viewer = -branch.direction;
                bool stops = is_matte(material) || (is_glossy(material) && reflector.alpha >= FOLLOWED_ALPHA);
                ended = true;
                if (!stops && branch.depth + 1u >= settings.max_depth) {
                    atomicAdd(status.truncated_paths, 1u);
                } else if (!stops) {
                    branch.depth += 1u;
                    u = next4(random);
                    bool rough = is_dielectric(material) ? is_rough_glass(material) : reflector.alpha >= SMOOTH_ALPHA;
                    if (PUNCTUAL_LIGHTS && rough) {
                        branch.lamps_seen = true;
                        if (many) {
                            branch.emitted += branch.throughput * glint_of_all(met, material, reflector, viewer, random);
                        } else {
                            light_ray = glint_of_one(met, material, reflector, viewer, random);
                            light_ray.contribution *= branch.throughput;
                        }
                    }
                    if (is_mirror(material)) {
                        float cosine = dot(viewer, met.facing.shading_normal);
                        branch.throughput *= fresnel_schlick(material.base_color, cosine);
                        if (is_coated(material)) {
                            branch.throughput *= coat_passes(material.coat, cosine);
                        }
                        branch.direction = mirror_direction(met.facing, branch.direction);
                    } else if (is_glossy(material)) {
                        Branch reflected = branch;
                        float p = reflection_probability(reflector, dot(viewer, met.facing.shading_normal));
                        reflect_branch(reflected, reflector, met.facing, u.yz);
                        if (many && p > 0.0 && p < 1.0 && used + pending_count + 1u < SLOTS) {
                            reflected.emitted = vec3(0.0);
                            reflected.origin = origin_towards(met.surface, reflected.direction);
                            pending[pending_count] = reflected;
                            pending_count += 1u;
                            stops = true;
                        } else if (u.x < p) {
                            branch = reflected;
                            branch.throughput *= 1.0 / p;
                        } else {
                            branch.throughput *= 1.0 / (1.0 - p);
                            stops = true;
                        }
                        reflector.alpha = 0.0;
                    } else if (DIELECTRICS) {
                        if (DISPERSION) {
                            branch.throughput *= disperse(material, branch.wavelength, random);
                        }
                        Boundary boundary = meet_boundary(met.facing, branch.direction, material, met.outside, u.yz);
                        // Radiance is compressed on its way into the denser medium: Veach, 1997, section 5.2.
                        vec3 transmission = met.tint * (boundary.eta * boundary.eta * boundary.refracted_weight);
                        bool splits = many && used + pending_count + 1u < SLOTS && boundary.reflectance < 1.0;
                        bool uncertain = boundary.reflectance > 0.0 && boundary.reflectance < 1.0;
                        bool peeks = !splits && !branch.reflection_seen && uncertain;
                        bool reflects = !splits && (peeks || u.x < boundary.reflectance);
                        if (many && splits) {
                            Branch reflected = branch;
                            reflected.direction = boundary.reflected;
                            reflected.throughput *= boundary.reflectance * boundary.reflected_weight;
                            reflected.media = met.through;
                            reflected.origin = origin_towards(met.surface, reflected.direction);
                            reflected.emitted = vec3(0.0);
                            pending[pending_count] = reflected;
                            pending_count += 1u;
                            transmission *= 1.0 - boundary.reflectance;
                        }
                        if (peeks) {
                            waits = u.x < boundary.reflectance ? boundary.reflectance : -boundary.reflectance;
                            let_wait(origin_towards(met.surface, boundary.refracted), boundary.refracted,
                                     branch.throughput * transmission, met.beyond);
                            branch.reflection_seen = true;
                            branch.throughput *= boundary.reflectance;
                        }
                        branch.throughput *= reflects ? boundary.reflected_weight : transmission;
                        branch.direction = reflects ? boundary.reflected : boundary.refracted;
                        branch.media = met.beyond;
                        if (reflects) {
                            branch.media = met.through;
                        }
                    }
                    ended = stops || (largest(branch.throughput) <= 0.0 && waits == 0.0);
                    branch.origin = origin_towards(met.surface, branch.direction);
                }
                if (stops && (largest(reflector.diffuse) > 0.0 || reflector.alpha > 0.0)) {
                    vec3 weight = branch.throughput;
                    if (GLOSSY) {
                        gloss_of_slots[slot] = gloss_of(reflector, viewer, has_coat(met.surface.material));
                    } else {
                        weight *= reflector.diffuse / PI;
                    }
                    found = true;
                    visible_points[slot].position_object = vec4(met.surface.position, uintBitsToFloat(met.surface.object));
                    visible_points[slot].weight_normal =
                        vec4(weight, uintBitsToFloat(encode_direction(met.facing.geometric_normal)));
                    visible_points[slot].emitted_normal.w = uintBitsToFloat(encode_direction(met.facing.shading_normal));
                }
            }
        }
        if (ended && !asks_light(light_ray)) {
            if (found) {
                visible_points[slot].emitted_normal.rgb = branch.emitted;
            } else {
                visible_points[slot] = VisiblePoint(vec4(0.0, 0.0, 0.0, uintBitsToFloat(NO_OBJECT)),
                                                    vec4(0.0, 0.0, 0.0, uintBitsToFloat(met_surface ? 1u : 0u)),
                                                    vec4(branch.emitted, 0.0));
            }
            footprints[slot] = settings.pixel_spread * (parallel ? 1.0 : branch.way);
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
        visible_points[pixel_slot * SLOTS + used] =
            VisiblePoint(vec4(0.0, 0.0, 0.0, uintBitsToFloat(NO_OBJECT)), vec4(0.0), vec4(0.0));
    }
}
