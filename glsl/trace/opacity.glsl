// Opacity by alpha: rays that pass partly transparent surfaces. Include after common/random.glsl.
#ifndef TRACE_OPACITY
#define TRACE_OPACITY

#include "bsdf/material.glsl"
#include "trace/intersect.glsl"

layout(constant_id = 17) const bool ALPHA = false;

bool is_see_through(uint flags) {
    return ALPHA && (flags & SEE_THROUGH) != 0u;
}

// The probability that a ray hits the surface.
float opacity(Hit hit) {
    float result = 1.0;
    if (is_see_through(shading_triangle(hit.triangle).flags)) {
        result = opacity_at(hit);
    }
    return result;
}

// The random number that decides whether a ray hits a partly transparent face: a pure function of the ray's position in its path.
float opacity_number(Random random, PlacedTriangle at) {
    return number_of(random, uvec2(at.triangle, at.instance + 1u));
}

// As `trace_from`, passing partly transparent faces at random.
Hit trace_visible(vec3 origin, vec3 direction, Progress progress, float t_max, PlacedTriangle ignored, bool any,
                  Random random) {
    Hit hit = NO_HIT;
    if (ALPHA) {
        bool goes_on = true;
        while (goes_on) {
            hit = trace_from(origin, direction, progress, t_max, ignored, false);
            goes_on = hit.triangle != MISS && !loops_cut;
            if (goes_on) {
                goes_on = opacity_number(random, triangle_of(hit)) >= opacity(hit);
                progress = past(hit);
            }
        }
    } else {
        hit = trace_from(origin, direction, progress, t_max, ignored, any);
    }
    return hit;
}

#endif
