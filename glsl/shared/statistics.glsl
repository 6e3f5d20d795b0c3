// What is kept for each visible point from iteration to iteration.

struct Statistics {
    float radius2_high; // R², two-float
    float radius2_low;
    uint accepted_low;  // photons accepted so far, 64 bits; eq. 2's N is α times this
    uint accepted_high;
    vec4 flux_high;     // τ, two-float; w: what of τ tells the bias, see `curvature`
    vec4 flux_low;
};

// A visible point's share of the iteration.
struct Gathered {
    vec4 flux_count; // rgb: Σ flux of the accepted photons; w: uint bits, M
    float moment;    // Σ flux · distance², flux as the mean of its channels
    uint padding0;
    uint padding1;
    uint padding2;
};

float mean_of(vec3 v) {
    return (v.r + v.g + v.b) * (1.0 / 3.0);
}

// Σ flux · (1 − 2 distance²/R²): 0 on average where photons lie evenly. Where their density bends, as r², it is −1/3 of
// the flux that R makes too many.
float curvature(Gathered gathered, float radius2) {
    return mean_of(gathered.flux_count.rgb) - 2.0 * gathered.moment / radius2;
}

// Radiance that a visible point's path saw directly, summed over the iterations, two-float. high.w: mean of the channels of
// what lights behind glass would have added if the glass didn't bend their light, which photons alone bring, summed over the
// iterations that asked for it; low.w: their number.
struct DirectSum {
    vec4 high;
    vec4 low;
};

// Of the discs around a visible point, how much can have photons, in sixteenths; and in how many iterations a ray from a
// point that had none yet met something that may send it some.
struct Coverage {
    uint covered;
    uint asked;
    uint surrounded;
    uint met; // of the first photon map: camera paths that met a surface
};

// Of a pixel, what tells whether it has its part of the light behind glass.
struct BehindGlass {
    float unbent;   // radiance that it would have of that light if the glass didn't bend it
    float arrived;  // mean of the channels of the radiance that such photons gave it
    float photons;  // their number
    float radius;   // R, in pixels
    float radius2;  // R², render units
};

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

// Of the radii of discs in a shell of a grid, see grid.glsl; its cell size follows from them.
struct ShellRadii {
    uint logs;    // Σ of what `radius_log` makes of a sample of them
    uint count;   // of that sample
    uint largest; // bits of the largest R² of all
    uint padding;
};

// log2 of a radius, offset, in parts of 256: sums of integers don't depend on their order.
uint radius_log(float radius2) {
    return uint(clamp(0.5 * log2(max(radius2, 1e-37)) + 64.0, 0.0, 127.0) * 256.0 + 0.5);
}

float mean_radius(ShellRadii radii) {
    return exp2(float(radii.logs) / float(radii.count) / 256.0 - 64.0);
}
