// Rays past what isn't there. Include after texture.glsl, intersect.glsl and random.glsl.

// As `trace`, by chance through what is there in part: a pure function of the ray's place in its path.
Hit trace_visible(vec3 origin, vec3 direction, float t_max, uint ignored, bool any, Random random) {
    if (ALPHA) {
        any = false;
    }
    float passed = 0.0;
    uint number = 0u;
    bool goes_on = true;
    Hit hit;
    while (goes_on) {
        hit = trace(origin + passed * direction, direction, t_max - passed, ignored, any);
        goes_on = ALPHA && hit.triangle != MISS && !loops_cut;
        if (goes_on) {
            ShadingTriangle met = shading_triangle(hit.triangle);
            goes_on = (met.flags & SEE_THROUGH) != 0u;
            if (goes_on) {
                float alpha = alpha_at(hit.triangle, met.material, met.flags, vec2(hit.u, hit.v));
                uvec4 bits = pcg4d(uvec4(random.path ^ 0x616c7068u, random.iteration, random.seed,
                                         random.dimension + (number << 16u)));
                goes_on = float(bits.x >> 8u) * (1.0 / 16777216.0) >= alpha;
            }
        }
        hit.t += passed;
        passed = hit.t;
        number += 1u;
        ignored = hit.triangle;
    }
    return hit;
}
