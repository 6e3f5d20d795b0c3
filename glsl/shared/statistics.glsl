// What is kept for each visible point from iteration to iteration.

struct Statistics {
    float radius2_high; // R², two-float
    float radius2_low;
    uint accepted_low;  // photons accepted so far, 64 bits; eq. 2's N is α times this
    uint accepted_high;
    vec4 flux_high;     // τ, two-float; w: unused
    vec4 flux_low;
};

// A visible point's share of the iteration: rgb: Σ flux of the accepted photons; w: uint bits, M.
struct Gathered {
    vec4 flux_count;
};

// Radiance that a visible point's path saw directly, summed over the iterations, two-float; w: unused.
struct DirectSum {
    vec4 high;
    vec4 low;
};

// Sums over radii: the grid's cell size follows from them.
struct RadiusSum {
    float radius2;  // Σ R²
    float inverse2; // Σ 1/R²
    uint count;
    uint padding;
};
