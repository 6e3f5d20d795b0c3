// Sums that stay right over 10⁹ additions: a value is kept as high + low, two f32 that don't overlap.

// a + b exactly: Knuth's two-sum.
void two_sum(float a, float b, out float sum, out float rest) {
    precise float s = a + b;
    precise float bb = s - a;
    precise float e = (a - (s - bb)) + (b - bb);
    sum = s;
    rest = e;
}

void add_to(inout float high, inout float low, float value) {
    float sum;
    float rest;
    two_sum(high, value, sum, rest);
    two_sum(sum, rest + low, high, low);
}

// Takes the fraction `part` off, for a part that may be far below the precision of an f32 next to 1.
void reduce_by(inout float high, inout float low, float part) {
    add_to(high, low, -(high * part) - low * part);
}
