#version 460
#extension GL_GOOGLE_include_directive : require
// How much of the disc of radius R around each visible point can have photons: past the edge of the object, or inside
// an opaque one that stands on it, there are none. Random points of the disc say whether it can; their share corrects eq. 4,
// which takes the whole disc.

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
#include "object_grid.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "status.glsl"

layout(push_constant) uniform Push {
    uint iteration;
    uint block; // see config::RenderConfig::block_of
    uint points; // a power of two up to WHOLE
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
layout(std430) buffer CoverageOf { Coverage coverage[]; };

// What an iteration counts for, whatever its points.
const uint WHOLE = 16u;
// Surfaces that are crossed on the way at the most.
const uint MOST_CROSSINGS = 4u;

// The side of an object that a ray meets.
struct Side {
    uint object;
    bool front;
};

Side side_of(Surface surface, vec3 direction) {
    return Side(surface.object, dot(surface.geometric_normal, direction) < 0.0);
}

// Whether a ray leaves the object that was entered at that side.
bool leaves(vec3 origin, vec3 direction, PlacedTriangle ignored, Side entered) {
    Hit hit = trace(origin, direction, 1e30, ignored, false);
    bool left = false;
    if (hit.triangle != MISS) {
        Side side = side_of(surface_at(hit), direction);
        left = side.object == entered.object && side.front != entered.front;
    }
    return left;
}

bool can_have_photons(VisiblePoint visible_point, float radius, vec2 u) {
    uint object = floatBitsToUint(visible_point.position_object.w);
    vec3 n = decode_direction(floatBitsToUint(visible_point.weight_normal.w));
    vec3 origin = offset_origin(visible_point.position_object.xyz, n, reach_of(object));
    vec3 along = basis(n) * vec3(radius * disc_point(u), 0.0);
    // Along the surface, into other objects and out of them again.
    bool inside = false;
    Side entered;
    PlacedTriangle ignored = NO_TRIANGLE;
    float done = 0.0;
    for (uint i = 0u; i < MOST_CROSSINGS; i++) {
        Hit hit = trace(origin + done * along, (1.0 - done) * along, 1.0, ignored, false);
        if (hit.triangle == MISS) {
            break;
        }
        Surface surface = surface_at(hit);
        if (surface.object == object) {
            return true; // the surface bends up
        }
        // Light passes glass, and what isn't there everywhere.
        if (!is_dielectric(material_at(surface.material)) && (surface.flags & SEE_THROUGH) == 0u) {
            inside = !inside;
            entered = side_of(surface, along);
        }
        done += hit.t * (1.0 - done);
        ignored = triangle_of(hit);
    }
    // An open sheet has been crossed, but encloses nothing.
    if (inside && leaves(origin + along, along, ignored, entered) && leaves(origin + along, n, ignored, entered)) {
        return false;
    }
    // Then down: it may bend, but it must be there, under glass that lies on it too.
    Hit below = trace(origin + along, -radius * n, 1.0, NO_TRIANGLE, false);
    if (CONTACT && below.triangle != MISS) {
        ShadingTriangle met = shading_triangle(below.triangle);
        if (is_placed(below.instance)) {
            met.object = instance_at(below.instance).object;
        }
        if (met.object != object && is_dielectric(material_at(met.material))) {
            below = trace(origin + along, -radius * n, 1.0, triangle_of(below), false);
        }
    }
    if (below.triangle == MISS) {
        return false;
    }
    Surface there = surface_at(below);
    return there.object == object && share_there(there) > 0.0;
}

void main() {
    uint slot = invocation_index();
    if (slot >= slots() || status.again != 0u) {
        return;
    }
    VisiblePoint visible_point = VISIBLE_POINT(slot);
    if (floatBitsToUint(visible_point.position_object.w) == NO_OBJECT) {
        return;
    }
    Random random = random_of_pixel(COVERAGE_SAMPLE, slot, push.iteration, push.block, settings.seed);
    float radius = sqrt(TEXEL(StatisticsOf, 3u * slot).x);
    uint covered = 0u;
    for (uint i = 0u; i < push.points; i++) {
        Random sample_random = sample_of(random, i, push.points);
        covered += can_have_photons(visible_point, radius, next4(sample_random).xy) ? 1u : 0u;
    }
    // Where a driver has too few loop iterations for it (a thousand triangles in one place), eq. 4 stays as it is.
    if (loops_cut) {
        covered = push.points;
    }
    coverage[slot].covered += covered * (WHOLE / push.points);
    coverage[slot].asked += WHOLE;
}
