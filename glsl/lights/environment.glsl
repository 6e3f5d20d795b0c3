// What shines from afar.
//
// The picture is equirectangular: its upper edge is +Y, its centre +Z, and -X lies to the right of it. The buffer has its
// size and how far it is rotated about +Y, in turns, then each row's cosines at the upper and the lower edge, then the pixels; w: the probability of a row, or of a
// pixel within its row, and those before it, in multiples of 2⁻²⁴ as random numbers are.
#ifndef LIGHTS_ENVIRONMENT
#define LIGHTS_ENVIRONMENT

#include "lights/light.glsl"


uniform usamplerBuffer Environment;

struct EnvironmentSample {
    vec3 radiance;
    float density; // by which sample_environment chooses the direction, per solid angle
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

// One of `count` entries from `first` on, how far u lies into its part of [0, 1), and its probability.
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
    // In the middle of what the number's last bit stands for.
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

// At a place in the picture, in pixels: between the four nearest centres.
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

// atan has no value at the poles, where there is any.
float angle_of(float y, float x) {
    return x == 0.0 && y == 0.0 ? 0.0 : atan(y, x);
}

// Down from the pole, in pixels.
float rows_below_pole(uvec2 size, float across, float up) {
    return min(angle_of(across, up) * (float(size.y) / PI), float(size.y));
}

// A direction, nearly in proportion to the radiance from there; uniform within a pixel. The pixel is the one that was
// chosen: looked up again from the direction it may be the next one, by rounding, and that one's density much smaller.
EnvironmentSample sample_environment(vec2 u, out vec3 direction) {
    uvec2 size = environment_size();
    Entry row = choose_entry(1u, size.y, u.y);
    Entry column = choose_entry(1u + size.y + row.index * size.x, size.x, u.x);
    vec2 edges = TEXEL(Environment, 1u + row.index).xy;
    float up = mix(edges.x, edges.y, row.within);
    float across = sqrt(max(0.0, (1.0 - up) * (1.0 + up)));
    float turn = float(column.index) + column.within;
    float phi = 2.0 * PI * (turn / float(size.x) - 0.5 - environment_rotation());
    direction = normalize(vec3(-across * sin(phi), up, across * cos(phi)));
    return EnvironmentSample(environment_radiance(size, vec2(turn, rows_below_pole(size, across, up))),
               row.probability * column.probability / solid_angle_of_pixel(size, edges));
}

// What comes from a direction, which is a unit vector, and its density.
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

// What a ray sees that meets no surface.
vec3 radiance_from_afar(vec3 direction) {
    vec3 radiance = vec3(0.0);
    if (ENVIRONMENT) {
        radiance = environment_at(direction).radiance;
    }
    return radiance;
}

#endif
