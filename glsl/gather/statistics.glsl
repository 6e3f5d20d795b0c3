// What is kept for each visible point from iteration to iteration.
#include "layout.glsl"

float mean_of(vec3 v) {
    return (v.r + v.g + v.b) * (1.0 / 3.0);
}

// Σ flux · (1 − 2 distance²/R²): 0 on average where photons lie evenly. Where their density bends, as r², it is −1/3 of
// the flux that R makes too many.
float curvature(Gathered gathered, float radius2) {
    return mean_of(gathered.flux) - 2.0 * gathered.moment / radius2;
}

// Photons that a visible point has accepted, as far as 32 bits hold. What may have brought light behind glass are those of the
// last photon map: the caustic ones, or all where nothing tells them apart.
uint photons_of(uint accepted_low, uint accepted_high) {
    return accepted_high != 0u ? 0xffffffffu : accepted_low;
}

// Of what lies behind glass, the mean of the iterations that asked.
float unbent_of(DirectSum sum) {
    return sum.low.w > 0.0 ? sum.high.w / sum.low.w : 0.0;
}

// Their share; 1 where nothing is known of it.
float share_of(Coverage coverage) {
    return coverage.covered > 0u ? float(coverage.covered) / float(coverage.asked) : 1.0;
}

// log2 of a radius, offset, in parts of 256: sums of integers don't depend on their order.
uint radius_log(float radius2) {
    return uint(clamp(0.5 * log2(max(radius2, 1e-37)) + 64.0, 0.0, 127.0) * 256.0 + 0.5);
}

float mean_radius(ShellRadii radii) {
    return exp2(float(radii.logs) / float(radii.count) / 256.0 - 64.0);
}
