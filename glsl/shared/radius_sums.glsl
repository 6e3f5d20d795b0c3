// The sum of a workgroup's radii. Include after statistics.glsl.

shared float shared_radius[gl_WorkGroupSize.x];
shared float shared_radius2[gl_WorkGroupSize.x];
shared uint shared_count[gl_WorkGroupSize.x];

// Adds up one term of each invocation; right in the first one. Every invocation has to call it.
RadiusSum reduce(RadiusSum term) {
    uint me = gl_LocalInvocationID.x;
    shared_radius[me] = term.radius;
    shared_radius2[me] = term.radius2;
    shared_count[me] = term.count;
    for (uint half_size = gl_WorkGroupSize.x / 2u; half_size > 0u; half_size /= 2u) {
        barrier();
        if (me < half_size) {
            shared_radius[me] += shared_radius[me + half_size];
            shared_radius2[me] = max(shared_radius2[me], shared_radius2[me + half_size]);
            shared_count[me] += shared_count[me + half_size];
        }
    }
    return RadiusSum(shared_radius[0], shared_radius2[0], shared_count[0], 0u);
}

RadiusSum sum_of_radii(bool counts, float radius2) {
    return reduce(counts ? RadiusSum(sqrt(radius2), radius2, 1u, 0u) : RadiusSum(0.0, 0.0, 0u, 0u));
}
