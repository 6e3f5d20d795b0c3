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
    bool emission_seen;   // what the next surface emits
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

// The first surface on a ray's way.
struct Glimpse {
    vec3 emission;
    bool dark; // nothing is there that scatters light
};

Glimpse glimpse(vec3 origin, vec3 direction, PlacedTriangle ignored, Media media, bool lamps_seen, Random random) {
    Hit hit = trace_visible(origin, direction, AT_ORIGIN, 1e30, ignored, false, random);
    if (loops_cut) {
        return Glimpse(vec3(0.0), true);
    }
    vec3 lamps = vec3(0.0);
    if (SOFT_LIGHTS && !lamps_seen) {
        lamps = soft_lights_along(origin, direction, way_of(hit), media.first);
    }
    if (hit.triangle == MISS) {
        return Glimpse(radiance_from_afar(direction) + lamps, true);
    }
    Encounter met = encounter(hit, direction, media, false, random);
    bool dark = is_matte(met.material) && largest(met.material.base_color) == 0.0;
    vec3 emission = emits(met.material, met.facing.front)
                        ? emitted_radiance(met.material, -dot(direction, met.facing.geometric_normal))
                        : vec3(0.0);
    if (ABSORPTION) {
        emission *= transmittance(met.through.first, hit.t);
    }
    return Glimpse(emission + lamps, dark);
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
    branch.emission_seen = false;
    branch.lamps_seen = false;

    bool alive = inside;
    bool cut = false;
    bool met_surface = false;
    Progress progress = AT_ORIGIN; // past backs that no camera sees
    VisiblePoint visible_point = VisiblePoint(vec4(0.0, 0.0, 0.0, uintBitsToFloat(NO_OBJECT)), vec4(0.0), vec4(0.0));
    Gloss gloss = Gloss(vec4(0.0), uvec4(0u));
    while (alive) {
        loop_count += 1u;
        bool ended = true;
        visible_point = VisiblePoint(vec4(0.0, 0.0, 0.0, uintBitsToFloat(NO_OBJECT)), vec4(0.0), vec4(0.0));
        Hit hit = trace_visible(branch.origin, branch.direction, progress, 1e30, branch.ignored, false, random);
        if (SOFT_LIGHTS && !loops_cut && !branch.lamps_seen && !branch.emission_seen) {
            vec3 from = branch.origin + progress.t * branch.direction;
            branch.emitted += branch.throughput * soft_lights_along(from, branch.direction, way_of(hit) - progress.t,
                                                                    branch.media.first);
        }
        if (loops_cut) {
            cut = true;
        } else if (hit.triangle != MISS) {
            bool culls = CULLING && branch.depth == 0u;
            Encounter met = encounter(hit, branch.direction, branch.media, culls, random);
            Surface surface = met.surface;
            Material material = met.material;
            Facing facing = met.facing;
            if (culls && is_hidden_back(surface, material, branch.direction)) {
                progress = past(hit);
                continue;
            }
            progress = AT_ORIGIN;
            branch.way += hit.t;
            if (ABSORPTION) {
                branch.throughput *= transmittance(met.through.first, hit.t);
            }
            if (met.hidden) {
                branch.throughput *= met.tint;
                branch.media = met.beyond;
                branch.emission_seen = false;
                branch.lamps_seen = false;
                branch.origin = origin_towards(surface, branch.direction);
                branch.ignored = surface.triangle;
                continue;
            }
            met_surface = true;
            if (emits(material, facing.front)) {
                vec3 emission = emitted_radiance(material, -dot(branch.direction, facing.geometric_normal));
                branch.emitted += branch.emission_seen ? vec3(0.0) : branch.throughput * emission;
            }
            branch.emission_seen = false;
            if (is_mixed(material)) {
                u = next4(random);
                choose_part(material, u.x);
            }
            if (is_coated(material)) {
                u = next4(random);
                branch.throughput *= choose_layer(material, facing, surface, branch.direction, u.x);
            }
            // A visible point has the surface's base, and its reflection unless that is so narrow that the path follows it.
            Reflector reflector = NO_REFLECTOR;
            reflector.diffuse = material.base_color;
            if (is_glossy(material)) {
                reflector = reflector_of(material);
            }
            vec3 viewer = -branch.direction;
            bool stops = is_matte(material) || (is_glossy(material) && reflector.alpha >= FOLLOWED_ALPHA);
            if (!stops && branch.depth + 1u >= settings.max_depth) {
                atomicAdd(status.truncated_paths, 1u);
            } else if (!stops) {
                ended = false;
                branch.depth += 1u;
                branch.ignored = surface.triangle;
                branch.lamps_seen = false;
                u = next4(random);
                if (is_mirror(material)) {
                    float cosine = dot(viewer, facing.shading_normal);
                    branch.throughput *= fresnel_schlick(material.base_color, cosine);
                    if (is_coated(material)) {
                        branch.throughput *= coat_passes(material.coat, cosine);
                    }
                    branch.direction = mirror_direction(facing, branch.direction);
                } else if (is_glossy(material)) {
                    if (PUNCTUAL_LIGHTS && reflector.alpha >= SMOOTH_ALPHA) {
                        branch.emitted += branch.throughput * glint(met, material, facing, reflector, viewer, random);
                        branch.lamps_seen = true;
                    }
                    Branch reflected = branch;
                    float p = reflection_probability(reflector, dot(viewer, facing.shading_normal));
                    reflect_branch(reflected, reflector, facing, u.yz);
                    if (p > 0.0 && p < 1.0 && used + pending_count + 1u < SLOTS) {
                        reflected.emitted = vec3(0.0);
                        reflected.origin = origin_towards(surface, reflected.direction);
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
                    ended = stops || largest(branch.throughput) <= 0.0;
                } else if (DIELECTRICS) {
                    if (DISPERSION) {
                        branch.throughput *= disperse(material, branch.wavelength, random);
                    }
                    if (PUNCTUAL_LIGHTS && is_rough_glass(material)) {
                        branch.emitted +=
                            branch.throughput * glint(met, material, facing, reflector, viewer, random);
                        branch.lamps_seen = true;
                    }
                    Boundary boundary = meet_boundary(facing, branch.direction, material, met.outside, u.yz);
                    // Radiance is compressed on its way into the denser medium: Veach, 1997, section 5.2.
                    vec3 transmission = met.tint * (boundary.eta * boundary.eta * boundary.refracted_weight);
                    bool split = used + pending_count + 1u < SLOTS && boundary.reflectance < 1.0;
                    bool reflect_now = u.x < boundary.reflectance;
                    if (split) {
                        Branch other = branch;
                        other.direction = boundary.reflected;
                        other.throughput *= boundary.reflectance * boundary.reflected_weight;
                        other.media = met.through;
                        other.emitted = vec3(0.0);
                        other.origin = origin_towards(surface, other.direction);
                        pending[pending_count] = other;
                        pending_count += 1u;
                        branch.throughput *= 1.0 - boundary.reflectance;
                        reflect_now = false;
                    } else if (!branch.reflection_seen && boundary.reflectance < 1.0) {
                        // A lamp's faint reflection in glass, seen by a rare choice alone, would be a bright speck.
                        branch.reflection_seen = true;
                        vec3 from = origin_towards(surface, boundary.reflected);
                        Glimpse reflection = glimpse(from, boundary.reflected, surface.triangle, met.through,
                                                     branch.lamps_seen, random);
                        branch.emitted += branch.throughput * boundary.reflectance * boundary.reflected_weight *
                                          reflection.emission;
                        if (reflection.dark) {
                            // That was all there is to the reflection.
                            branch.throughput *= 1.0 - boundary.reflectance;
                            reflect_now = false;
                        }
                        branch.emission_seen = reflect_now;
                    }
                    branch.direction = reflect_now ? boundary.reflected : boundary.refracted;
                    branch.throughput *= reflect_now ? boundary.reflected_weight : transmission;
                    branch.media = met.beyond;
                    if (reflect_now) {
                        branch.media = met.through;
                    }
                    ended = largest(branch.throughput) <= 0.0;
                }
                branch.origin = origin_towards(surface, branch.direction);
            }
            if (stops && (largest(reflector.diffuse) > 0.0 || reflector.alpha > 0.0)) {
                vec3 weight = branch.throughput;
                if (GLOSSY) {
                    gloss = gloss_of(reflector, viewer, has_coat(surface.material));
                } else {
                    weight *= reflector.diffuse / PI;
                }
                visible_point.position_object = vec4(surface.position, uintBitsToFloat(surface.object));
                visible_point.weight_normal =
                    vec4(weight, uintBitsToFloat(encode_direction(facing.geometric_normal)));
                visible_point.emitted_normal.w = uintBitsToFloat(encode_direction(facing.shading_normal));
            }
        } else if (!branch.emission_seen) {
            branch.emitted += branch.throughput * radiance_from_afar(branch.direction);
        }
        if (ended) {
            visible_point.emitted_normal.rgb = branch.emitted;
            if (floatBitsToUint(visible_point.position_object.w) == NO_OBJECT) {
                visible_point.weight_normal.w = uintBitsToFloat(met_surface ? 1u : 0u);
            }
            visible_points[pixel_slot * SLOTS + used] = visible_point;
            footprints[pixel_slot * SLOTS + used] = settings.pixel_spread * (parallel ? 1.0 : branch.way);
            if (GLOSSY) {
                gloss_of_slots[pixel_slot * SLOTS + used] = gloss;
            }
            used += 1u;
            alive = pending_count > 0u && !cut;
            if (alive) {
                pending_count -= 1u;
                branch = pending[pending_count];
                progress = AT_ORIGIN;
            }
        }
    }
    if (cut || loops_cut) {
        atomicAdd(status.cut_paths, 1u);
    }
    visible_point = VisiblePoint(vec4(0.0, 0.0, 0.0, uintBitsToFloat(NO_OBJECT)), vec4(0.0), vec4(0.0));
    for (; used < SLOTS; used++) {
        visible_points[pixel_slot * SLOTS + used] = visible_point;
    }
}
