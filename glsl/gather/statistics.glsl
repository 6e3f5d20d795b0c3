// Statistics of a visible point over all iterations.
#include "layout.glsl"

float mean_of(vec3 v) {
    return (v.r + v.g + v.b) * (1.0 / 3.0);
}

// Σ flux · (1 − 2 distance²/R²): 0 on average for a uniform photon density. For a density with a term in r², it is −1/3 of the
// excess flux within R.
float curvature(Gathered gathered, float radius2) {
    return mean_of(gathered.flux) - 2.0 * gathered.moment / radius2;
}

// Photons that a visible point has accepted, clamped to 32 bits. Light from behind glass can be in those of the last photon map:
// the caustic photons, or all photons if there is one map.
uint photons_of(uint accepted_low, uint accepted_high) {
    return accepted_high != 0u ? 0xffffffffu : accepted_low;
}

// Direct light behind glass without refraction: the mean of the iterations that estimated it.
float unbent_of(DirectSum sum) {
    return sum.low.w > 0.0 ? sum.high.w / sum.low.w : 0.0;
}

// The covered share of the disc; 1 if it has not been tested.
float share_of(Coverage coverage) {
    return coverage.covered > 0u ? float(coverage.covered) / float(coverage.samples) : 1.0;
}

// log2 of a radius, offset, in units of 1/256: sums of integers do not depend on their order.
uint radius_log(float radius2) {
    return uint(clamp(0.5 * log2(max(radius2, 1e-37)) + 64.0, 0.0, 127.0) * 256.0 + 0.5);
}

float mean_radius(ShellRadii radii) {
    return exp2(float(radii.logs) / float(radii.count) / 256.0 - 64.0);
}
