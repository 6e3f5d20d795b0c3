// Sums that stay accurate over 10⁹ additions: a value is high + low, two f32 that do not overlap.

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

// Multiplies by 1 − part; `rest` is 1 − part, computed separately. Whichever is small keeps its precision.
void reduce_by(inout float high, inout float low, float part, float rest) {
    if (part < 0.5) {
        add_to(high, low, -(high * part) - low * part);
    } else {
        two_sum(high * rest, low * rest, high, low);
    }
}
