// Rays past what isn't there. Include after texture.glsl, intersect.glsl and random.glsl.

// As `trace`, by chance through what is there in part: a pure function of the ray's place in its path. A ray goes on a step
// behind what it has passed: faces in one place are passed as one.
Hit trace_visible(vec3 origin, vec3 direction, float t_max, PlacedTriangle ignored, bool any, Random random) {
    if (ALPHA) {
        any = false;
    }
    vec3 from = origin;
    float passed = 0.0;
    uint number = 0u;
    bool goes_on = true;
    Hit hit;
    while (goes_on) {
        hit = trace(from, direction, t_max - passed, ignored, any);
        goes_on = ALPHA && hit.triangle != MISS && !loops_cut;
        if (goes_on) {
            Surface met = surface_at(hit);
            goes_on = of_passage(random, number) >= share_there(met);
            if (goes_on) {
                from = origin_towards(met, direction);
                passed = dot(from - origin, direction) / dot(direction, direction);
                number += 1u;
                ignored = triangle_of(hit);
            }
        }
    }
    hit.t += passed;
    return hit;
}
