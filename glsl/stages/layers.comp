#version 460
#extension GL_GOOGLE_include_directive : require
// Adds what layers show of an iteration's camera paths: albedo and normal of the visible points, and which object and material
// each path meets first. The first iteration's paths pass the centres of pixels and of the lens: position and depth are theirs,
// because a mean over the edge of an object would be a place where nothing is.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "common/sampling.glsl"
#include "common/camera.glsl"
#include "trace/interaction.glsl"
#include "bsdf/reflection.glsl"
#include "gather/visible_point.glsl"
#include "common/status.glsl"

layout(push_constant) uniform CameraTurnPush {
    uint iteration;
    uint path;  // index of the camera path among those of the pixel in this iteration
    uint paths;
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer PackedBsdfs;
layout(std430) buffer SurfaceSums { SurfaceSum surface_sums[]; }; // row-major, from the top left
layout(std430) buffer IdCounts { IdCount id_counts[]; };          // of each pixel: objects, then materials

// What the surface reflects of white light from all sides, without the spread of its lobes.
vec3 albedo_of(VisibleBsdf visible) {
    vec3 reflected = fresnel(visible.bsdf, max(dot(visible.normal, visible.viewer), 0.0));
    return reflected + (1.0 - largest(reflected)) * visible.bsdf.diffuse;
}

// Albedo of the visible points, with what the path to them lets pass, and their mean normal. A path that glass has split has
// several.
void add_visible_points(uint pixel_slot, inout SurfaceSum sum) {
    vec3 albedo = vec3(0.0);
    vec3 normals = vec3(0.0);
    uint found = 0u;
    for (uint i = 0u; i < settings.slots_per_pixel; i++) {
        uint slot = pixel_slot * settings.slots_per_pixel + i;
        VisiblePoint visible_point = VISIBLE_POINT(VisiblePoints, slot);
        if (visible_point.object != NO_OBJECT) {
            vec3 normal = decode_direction(visible_point.shading_normal);
            if (carries_bsdf()) {
                albedo += visible_point.weight * albedo_of(LOAD_BSDF(PackedBsdfs, slot, normal));
            } else {
                albedo += visible_point.weight * PI;
            }
            normals += normal;
            found += 1u;
        }
    }
    sum.albedo += clamp(albedo, 0.0, 1.0);
    sum.normal += normals / float(max(found, 1u));
}

// Counts a path that meets this id in a table of a few; what doesn't fit is missing from the sum of counts.
void count_id(uint first, uint id) {
    for (uint i = 0u; i < IDS_OF_PIXEL; i++) {
        IdCount entry = id_counts[first + i];
        if (entry.count == 0u || entry.id == id) {
            id_counts[first + i] = IdCount(id, entry.count + 1u);
            return;
        }
    }
}

void main() {
    uint pixel_slot = invocation_index();
    if (pixel_slot >= region_slots() || status.retry != 0u) {
        return;
    }
    uvec2 pixel;
    if (!has_pixel(pixel_slot, pixel)) {
        return;
    }
    uint index = number_on_film(pixel_slot, pixel);
    CameraTurn turn = CameraTurn(push.iteration, push.path, push.paths);
    Random random = random_of_pixel(CAMERA_PATH, number_in_picture(pixel), turn, settings.seed);
    vec2 u = next4(random).xy;
    vec3 origin;
    vec3 direction;
    bool first = push.iteration == 0u;
    if (first) {
        camera_ray(vec2(pixel) + 0.5, vec2(0.0), origin, direction);
    } else {
        sample_camera_ray(pixel, u, random, origin, direction);
    }

    Progress progress = AT_ORIGIN; // past culled back faces
    Media media = media_from(settings.camera_media);
    bool meets = false;
    bool alive = true;
    SurfaceInteraction met = no_interaction();
    while (alive) {
        loop_count += 1u;
        Hit hit = trace_visible(origin, direction, progress, 1e30, NO_TRIANGLE, false, random);
        alive = hit.triangle != MISS && !loops_cut;
        if (alive) {
            met = interact(hit, direction, media, true, random);
            alive = is_hidden_back(met.surface, met.material, direction);
            meets = !alive;
            progress = past(hit);
        }
    }
    if (loops_cut) {
        atomicAdd(status.cut_paths, 1u);
    }

    SurfaceSum sum = surface_sums[index];
    add_visible_points(pixel_slot, sum);
    sum.paths += 1u;
    if (meets) {
        sum.hits += 1u;
        count_id(2u * IDS_OF_PIXEL * index, met.surface.object);
        count_id(2u * IDS_OF_PIXEL * index + IDS_OF_PIXEL, met.surface.material);
    }
    if (first) {
        sum.position = meets ? met.surface.position : vec3(0.0);
        // Along the camera's axis, as Blender has it.
        sum.depth = meets ? dot(met.surface.position - origin, camera_axis()) : 0.0;
    }
    surface_sums[index] = sum;
}
