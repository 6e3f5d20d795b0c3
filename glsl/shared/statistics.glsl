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

// Radiance that a visible point's path saw directly, summed over the iterations, two-float; w: unused.
struct DirectSum {
    vec4 high;
    vec4 low;
};

// Of the discs around a visible point, how much can have photons, in sixteenths.
struct Coverage {
    uint covered;
    uint asked;
};

// Their share; 1 where nothing is known of it.
float share_of(Coverage coverage) {
    return coverage.covered > 0u ? float(coverage.covered) / float(coverage.asked) : 1.0;
}

// Sums over radii: the grid's cell size follows from them.
struct RadiusSum {
    float radius2;  // Σ R²
    float inverse2; // Σ 1/R²
    uint count;
    uint padding;
};
