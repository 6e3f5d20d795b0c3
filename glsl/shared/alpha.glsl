// Rays past what isn't there. Include after texture.glsl, intersect.glsl and random.glsl.

// Decides whether a ray finds a face there that isn't there everywhere: a pure function of the ray's place in its path.
float of_face(Random random, PlacedTriangle at) {
    return number_of(random, uvec2(at.triangle, at.instance + 1u));
}

// As `trace_from`, by chance through what is there in part.
Hit trace_visible(vec3 origin, vec3 direction, Progress progress, float t_max, PlacedTriangle ignored, bool any,
                  Random random) {
    if (ALPHA) {
        any = false;
    }
    Hit hit;
    bool goes_on = true;
    while (goes_on) {
        hit = trace_from(origin, direction, progress, t_max, ignored, any);
        goes_on = ALPHA && hit.triangle != MISS && !loops_cut;
        if (goes_on) {
            goes_on = of_face(random, triangle_of(hit)) >= share_there(surface_at(hit));
            progress = past(hit);
        }
    }
    return hit;
}
