#version 460
#extension GL_GOOGLE_include_directive : require
// The share of each visible point's disc that can receive photons: beyond the edge of the object, or inside an opaque object that
// stands on it, there are none. Random points of the disc are tested; their share corrects equation 4, which assumes the whole
// disc. While a point has received no photon, a ray into its hemisphere tests whether it lies in the open, where none is
// expected.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "trace/interaction.glsl"
#include "trace/object_grid.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "common/status.glsl"

layout(push_constant) uniform CoveragePush {
    uint iteration;
    uint points; // a power of two up to COVERAGE_WHOLE
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
uniform usamplerBuffer GatheredOf;
layout(std430) readonly buffer Radii2 { float radii2[]; };
layout(std430) buffer CoverageOf { Coverage coverage[]; };

// The side of an object that a ray hits.
struct Side {
    uint object;
    bool front;
};

Side side_of(Surface surface, vec3 direction) {
    return Side(surface.object, dot(surface.geometric_normal, direction) < 0.0);
}

// Whether a ray leaves the object that it entered at that side.
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
    uint object = visible_point.object;
    vec3 n = decode_direction(visible_point.geometric_normal);
    vec3 origin = offset_origin(visible_point.position, n, reach_of(object));
    vec3 along = basis(n) * vec3(radius * disc_point(u), 0.0);
    // Along the surface, into other objects and out of them again.
    bool inside = false;
    Side entered;
    PlacedTriangle ignored = NO_TRIANGLE;
    Progress progress = AT_ORIGIN;
    for (uint i = 0u; i < COVERAGE_CROSSINGS; i++) {
        Hit hit = trace_from(origin, along, progress, 1.0, NO_TRIANGLE, false);
        if (hit.triangle == MISS) {
            break;
        }
        Surface surface = surface_at(hit);
        if (surface.object == object) {
            return true; // the surface bends up
        }
        // Light passes glass and partly transparent faces.
        if (!lets_light_pass(surface)) {
            inside = !inside;
            entered = side_of(surface, along);
        }
        progress = past(hit);
        ignored = triangle_of(hit);
    }
    // An open sheet was crossed; it encloses nothing.
    if (inside && leaves(origin + along, along, ignored, entered) && leaves(origin + along, n, ignored, entered)) {
        return false;
    }
    // Then down: the surface may bend, but it must exist, also below glass that lies on it and coincident faces.
    vec3 down = -radius * n;
    Hit below = trace(origin + along, down, 1.0, NO_TRIANGLE, false);
    if (faces_coincide()) {
        for (uint i = 1u; i < COVERAGE_CROSSINGS && below.triangle != MISS && !loops_cut; i++) {
            Surface met = surface_at(below);
            if (met.object == object || !may_lie_on_others(met)) {
                break;
            }
            below = trace_from(origin + along, down, past(below), 1.0, NO_TRIANGLE, false);
        }
    }
    if (below.triangle == MISS) {
        return false;
    }
    Surface there = surface_at(below);
    return there.object == object && opacity(below) > 0.0;
}

// Whether a ray hits a surface behind glass that may scatter or reflect light.
bool is_surrounded(VisiblePoint visible_point, vec2 u) {
    vec3 n = decode_direction(visible_point.geometric_normal);
    vec3 origin = offset_origin(visible_point.position, n, reach_of(visible_point.object));
    vec3 direction = cosine_direction(n, u);
    PlacedTriangle ignored = NO_TRIANGLE;
    bool scatters = false;
    for (uint i = 0u; i <= COVERAGE_CROSSINGS && !scatters; i++) {
        Hit hit = trace(origin, direction, 1e30, ignored, false);
        if (hit.triangle == MISS) {
            break;
        }
        Surface surface = surface_at(hit);
        if (!lets_light_pass(surface)) {
            scatters = !is_black(material_at(surface.material));
            break;
        }
        origin = origin_towards(surface, direction);
        ignored = triangle_of(hit);
    }
    return scatters;
}

// 0 where no photon was accepted.
uint accepted_by(uint receiver) {
    Statistics statistics = STATISTICS(StatisticsOf, receiver);
    return statistics.accepted_low | statistics.accepted_high;
}

bool has_caustic_photons(uint slot) {
    uint accepted = 0u;
    if (settings.photon_maps > 1u) {
        accepted = accepted_by(slots() + slot);
    }
    return accepted != 0u;
}

void main() {
    uint receiver = invocation_index();
    if (receiver >= receiver_count() || status.retry != 0u) {
        return;
    }
    uint slot = receiver % slots();
    VisiblePoint visible_point = VISIBLE_POINT(VisiblePoints, slot);
    if (visible_point.object == NO_OBJECT) {
        return;
    }
    // Without photons nothing needs a correction.
    bool has_photons = (accepted_by(receiver) | GATHERED(GatheredOf, receiver).count) != 0u;
    Coverage before = coverage[receiver];
    bool trusted = before.covered == before.samples && before.samples >= COVERAGE_TRUSTED * COVERAGE_WHOLE;
    uint in_whole = slot_in_whole(slot);
    Random random = random_of_disc(in_whole, push.iteration, push.points, settings.seed);
    if (!has_photons && receiver < slots() && before.surrounded == 0u && !has_caustic_photons(slot)) {
        Random behind = random;
        behind.dimension = COVERAGE_WHOLE; // those of the disc
        bool surrounded = is_surrounded(visible_point, next4(behind).xy) && !loops_cut;
        coverage[receiver].surrounded = surrounded ? 1u : 0u;
    }
    if (!has_photons || (trusted && (push.iteration + in_whole / 64u) % 8u != 0u)) {
        return;
    }
    float radius = sqrt(radii2[receiver]);
    uint covered = 0u;
    for (uint i = 0u; i < push.points; i++) {
        Random sample_random = sample_of(random, i, push.points);
        covered += can_have_photons(visible_point, radius, next4(sample_random).xy) ? 1u : 0u;
    }
    // If the driver allows too few loop iterations (a thousand coincident triangles), equation 4 is not corrected.
    if (loops_cut) {
        covered = push.points;
    }
    coverage[receiver].covered = before.covered + covered * (COVERAGE_WHOLE / push.points);
    coverage[receiver].samples = before.samples + COVERAGE_WHOLE;
}
