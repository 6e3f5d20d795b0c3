// Sums over the visible points' radii. Include after statistics.glsl.

shared RadiusSum terms[gl_WorkGroupSize.x];

RadiusSum together(RadiusSum a, RadiusSum b) {
    return RadiusSum(a.radius2 + b.radius2, a.inverse2 + b.inverse2, a.count + b.count, 0u);
}

// Adds up one term of each invocation; right in the first one. Every invocation has to call it.
RadiusSum reduce(RadiusSum term) {
    uint me = gl_LocalInvocationID.x;
    terms[me] = term;
    for (uint half_size = gl_WorkGroupSize.x / 2u; half_size > 0u; half_size /= 2u) {
        barrier();
        if (me < half_size) {
            terms[me] = together(terms[me], terms[me + half_size]);
        }
    }
    return terms[0];
}
