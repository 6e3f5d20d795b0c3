// Rays past what isn't there. Include after texture.glsl, intersect.glsl and random.glsl.

// Decides whether a ray finds a face there that isn't there everywhere: a pure function of the ray's place in its path.
float of_face(Random random, PlacedTriangle at) {
    return number_of(random, uvec2(at.triangle, at.instance + 1u));
}

// As `trace`, by chance through what is there in part and, with `culls`, through backs that no camera sees.
Hit trace_visible(vec3 origin, vec3 direction, float t_max, PlacedTriangle ignored, bool any, bool culls, Random random) {
    bool passes = ALPHA;
    if (CULLING) {
        passes = passes || culls;
    }
    any = any && !passes;
    Progress progress = AT_ORIGIN;
    Hit hit;
    bool goes_on = true;
    while (goes_on) {
        hit = trace_from(origin, direction, progress, t_max, ignored, any);
        goes_on = passes && hit.triangle != MISS && !loops_cut;
        if (goes_on) {
            Surface met = surface_at(hit);
            bool culled = false;
            if (CULLING) {
                bool hidden = (material_at(met.material).flags & BACK_HIDDEN) != 0u;
                culled = culls && hidden && dot(direction, met.geometric_normal) > 0.0;
            }
            goes_on = culled || of_face(random, triangle_of(hit)) >= share_there(met);
            progress = past(hit);
        }
    }
    return hit;
}
