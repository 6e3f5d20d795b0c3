#ifndef COMMON_SAMPLING
#define COMMON_SAMPLING

const float PI = 3.14159265358979;

// An orthonormal basis around the unit vector n: Duff and others, «Building an Orthonormal Basis, Revisited», 2017.
mat3 basis(vec3 n) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

// Cosine and sine of an angle, in turns from −2 to 2. By polynomials within an eighth of a turn (Cephes' sinf and cosf): the
// built-in functions may be wrong by 2^-11, and on some devices they are.
vec2 unit_vector_at(float turns) {
    float quarters = roundEven(4.0 * turns);
    float x = 2.0 * PI * (turns - 0.25 * quarters);
    float xx = x * x;
    float s = x + x * xx * (-1.6666654611e-1 + xx * (8.3321608736e-3 - xx * 1.9515295891e-4));
    float c = 1.0 - 0.5 * xx + xx * xx * (4.166664568298827e-2 + xx * (-1.388731625493765e-3 + xx * 2.443315711809948e-5));
    int quarter = int(quarters);
    vec2 unit = (quarter & 1) == 0 ? vec2(c, s) : vec2(-s, c);
    return (quarter & 2) == 0 ? unit : -unit;
}

// A point uniform on the unit disc: Shirley and Chiu, «A Low Distortion Map Between Disk and Square», Journal of Graphics
// Tools 2(3), 1997. A small square of numbers stays compact.
vec2 disc_point(vec2 u) {
    vec2 p = 2.0 * u - 1.0;
    bool wide = abs(p.x) > abs(p.y);
    float radius = wide ? p.x : p.y;
    float other = wide ? p.y : p.x;
    float turns = 0.125 * (other / (radius == 0.0 ? 1.0 : radius));
    return radius * unit_vector_at(wide ? turns : 0.25 - turns);
}

// A direction around the unit vector n with density cos θ / π (Malley's method).
vec3 cosine_direction(vec3 n, vec2 u) {
    vec2 p = disc_point(u);
    return normalize(basis(n) * vec3(p, sqrt(max(0.0, 1.0 - dot(p, p)))));
}

// A direction uniform in a cone around an axis, with 1 − cos of the angle between its sides and the axis.
vec3 direction_in_cone(vec3 axis, float versine, vec2 u) {
    vec2 p = disc_point(u);
    float off = dot(p, p) * versine;
    return normalize(basis(axis) * vec3(p * sqrt(max(0.0, versine * (2.0 - off))), 1.0 - off));
}

// Barycentric coordinates (u, v) of a point uniform on a triangle.
vec2 triangle_point(vec2 u) {
    float s = sqrt(u.x);
    return vec2(1.0 - s, u.y * s);
}

vec2 sign_not_zero(vec2 v) {
    return vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
}

// Unit vector to two 16-bit numbers by the octahedral map: Cigolle and others, «A Survey of Efficient Representations
// for Independent Unit Vectors», JCGT 3(2), 2014. The largest error is 6.4e-5 rad.
uint encode_direction(vec3 d) {
    vec2 p = d.xy / (abs(d.x) + abs(d.y) + abs(d.z));
    if (d.z < 0.0) {
        p = (1.0 - abs(p.yx)) * sign_not_zero(p);
    }
    return packSnorm2x16(p);
}

// A vector along the encoded direction, of length 1/√3 to 1: sufficient if only the sign of a cosine matters.
vec3 decode_octahedral(uint code) {
    vec2 p = unpackSnorm2x16(code);
    float z = 1.0 - abs(p.x) - abs(p.y);
    float fold = max(-z, 0.0);
    return vec3(p.x + (p.x >= 0.0 ? -fold : fold), p.y + (p.y >= 0.0 ? -fold : fold), z);
}

vec3 decode_direction(uint code) {
    return normalize(decode_octahedral(code));
}

float largest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

#endif
