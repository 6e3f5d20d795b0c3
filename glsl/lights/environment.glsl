// Environment lighting.
//
// The picture is equirectangular: its upper edge is +Y, its centre +Z, and -X lies to the right of it. The buffer has the
// picture's size and rotation about +Y, in turns; then each row's cosines at the upper and the lower edge; then the pixels. w:
// the cumulative probability up to and including a row, or a pixel within its row, in multiples of 2⁻²⁴ like random numbers.
#ifndef LIGHTS_ENVIRONMENT
#define LIGHTS_ENVIRONMENT

#include "lights/light.glsl"


uniform usamplerBuffer Environment;

struct EnvironmentSample {
    vec3 radiance;
    float density; // of sample_environment, per solid angle
};

uvec2 environment_size() {
    return TEXEL_BITS(Environment, 0u).xy;
}

float environment_rotation() {
    return TEXEL(Environment, 0u).z;
}

vec3 environment_pixel(uvec2 size, uint x, uint y) {
    return TEXEL(Environment, 1u + size.y + y * size.x + x).rgb;
}

// One of `count` entries from `first` on, the position of u within its part of [0, 1), and its probability.
struct Entry {
    uint index;
    float within;
    float probability;
};

Entry choose_entry(uint first, uint count, float u) {
    uint low = 0u;
    uint high = count - 1u;
    float before = 0.0;
    float end = 1.0;
    while (low < high) {
        uint middle = (low + high) / 2u;
        float cumulative = TEXEL(Environment, first + middle).w;
        if (u < cumulative) {
            high = middle;
            end = cumulative;
        } else {
            low = middle + 1u;
            before = cumulative;
        }
    }
    // In the middle of the interval of the number's last bit.
    return Entry(low, (u - before + 0.5 / 16777216.0) / (end - before), end - before);
}

// The probability of entry `index` of those from `first` on.
float probability_of_entry(uint first, uint index) {
    float before = index == 0u ? 0.0 : TEXEL(Environment, first + index - 1u).w;
    return TEXEL(Environment, first + index).w - before;
}

float solid_angle_of_pixel(uvec2 size, vec2 edges) {
    return 2.0 * PI / float(size.x) * (edges.x - edges.y);
}

// At a position in the picture, in pixels: bilinear between the four nearest centres.
vec3 environment_radiance(uvec2 size, vec2 place) {
    vec2 corner = floor(place - 0.5);
    vec2 part = place - 0.5 - corner;
    uint left = uint(int(corner.x) + int(size.x)) % size.x;
    uint right = (left + 1u) % size.x;
    uint upper = uint(max(corner.y, 0.0));
    uint lower = min(uint(corner.y + 1.0), size.y - 1u);
    return mix(mix(environment_pixel(size, left, upper), environment_pixel(size, right, upper), part.x),
               mix(environment_pixel(size, left, lower), environment_pixel(size, right, lower), part.x), part.y);
}

// atan is undefined at the poles, where every angle is right.
float angle_of(float y, float x) {
    return x == 0.0 && y == 0.0 ? 0.0 : atan(y, x);
}

// Down from the pole, in pixels.
float rows_below_pole(uvec2 size, float across, float up) {
    return min(angle_of(across, up) * (float(size.y) / PI), float(size.y));
}

// A direction, nearly in proportion to its radiance; uniform within a pixel. The density is that of the chosen pixel: by
// rounding, a look-up by direction may find its neighbour, whose density may be much smaller.
EnvironmentSample sample_environment(vec2 u, out vec3 direction) {
    uvec2 size = environment_size();
    Entry row = choose_entry(1u, size.y, u.y);
    Entry column = choose_entry(1u + size.y + row.index * size.x, size.x, u.x);
    vec2 edges = TEXEL(Environment, 1u + row.index).xy;
    float up = mix(edges.x, edges.y, row.within);
    float across = sqrt(max(0.0, (1.0 - up) * (1.0 + up)));
    float turn = float(column.index) + column.within;
    vec2 around = across * unit_vector_at(turn / float(size.x) - 0.5 - environment_rotation());
    direction = normalize(vec3(-around.y, up, around.x));
    return EnvironmentSample(environment_radiance(size, vec2(turn, rows_below_pole(size, across, up))),
               row.probability * column.probability / solid_angle_of_pixel(size, edges));
}

// Radiance from a direction, a unit vector, and the density of sample_environment.
EnvironmentSample environment_at(vec3 direction) {
    uvec2 size = environment_size();
    float turn = fract(0.5 + angle_of(-direction.x, direction.z) / (2.0 * PI) + environment_rotation());
    vec2 place = vec2(turn * float(size.x), rows_below_pole(size, length(direction.xz), direction.y));
    uvec2 pixel = min(uvec2(place), size - 1u);
    vec2 edges = TEXEL(Environment, 1u + pixel.y).xy;
    float probability = probability_of_entry(1u, pixel.y) *
                        probability_of_entry(1u + size.y + pixel.y * size.x, pixel.x);
    return EnvironmentSample(environment_radiance(size, place), probability / solid_angle_of_pixel(size, edges));
}

// Radiance along a ray that hits no surface.
vec3 environment_radiance_along(vec3 direction) {
    vec3 radiance = vec3(0.0);
    if (ENVIRONMENT) {
        radiance = environment_at(direction).radiance;
    }
    return radiance;
}

#endif
