// Textures, and what else the corners of a triangle have for a place of it.
#ifndef BSDF_TEXTURE
#define BSDF_TEXTURE

#include "layout.glsl"
#include "trace/triangles.glsl"

uniform usamplerBuffer Corners;
uniform usamplerBuffer Textures;
uniform usamplerBuffer Texels;

Corner corner_of(Hit hit, uint i) {
    return CORNER(Corners, 3u * hit.triangle + i);
}

float weight_of_corner(Hit hit, uint i) {
    return i == 0u ? 1.0 - hit.u - hit.v : (i == 1u ? hit.u : hit.v);
}

// Of both sets.
vec4 texture_coordinates(Hit hit) {
    vec4 sets = vec4(0.0);
    for (uint i = 0u; i < 3u; i++) {
        Corner corner = corner_of(hit, i);
        sets += weight_of_corner(hit, i) * vec4(corner.first, corner.second);
    }
    return sets;
}

// A factor of the base colour, with alpha.
vec4 corner_color(Hit hit) {
    vec4 color = vec4(0.0);
    for (uint i = 0u; i < 3u; i++) {
        Corner corner = corner_of(hit, i);
        color += weight_of_corner(hit, i) * vec4(unpackHalf2x16(corner.color.x), unpackHalf2x16(corner.color.y));
    }
    return color;
}

// w: the bitangent's side, 0 where there is no tangent.
vec4 tangent_at(Hit hit) {
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < 3u; i++) {
        Corner corner = corner_of(hit, i);
        vec3 tangent = decode_direction(corner.tangent);
        if (is_placed(hit.instance)) {
            // It follows the surface as its edges do. Mirroring turns normal × tangent round, but not the bitangent.
            Instance instance = instance_at(hit.instance);
            vec4 direction = vec4(tangent, 0.0);
            tangent = normalize(vec3(dot(instance.rows[0], direction), dot(instance.rows[1], direction),
                                     dot(instance.rows[2], direction)));
            corner.bitangent *= is_mirrored(instance) ? -1.0 : 1.0;
        }
        sum += weight_of_corner(hit, i) * vec4(tangent * abs(corner.bitangent), corner.bitangent);
    }
    return sum;
}

// The texel of an image of so many along one side that stands at a place.
uint wrapped(float place, uint count, uint mode) {
    float n = float(count);
    mode &= 3u;
    // Whole numbers: exact up to 2^24.
    float period = mode == MIRROR_REPEAT ? 2.0 * n : n;
    float rest = clamp(place - period * floor(place / period), 0.0, period - 1.0);
    float repeated = min(rest, mode == MIRROR_REPEAT ? period - 1.0 - rest : rest);
    return uint(mode == CLAMP ? clamp(place, 0.0, n - 1.0) : repeated);
}

vec4 texel_at(TextureLookup lookup, float x, float y) {
    uint width = lookup.size & 0xffffu;
    uint column = wrapped(x, width, lookup.flags >> WRAP_U);
    uint row = wrapped(y, lookup.size >> 16u, lookup.flags >> WRAP_V);
    uint index = lookup.first_texel + row * width + column;
    uvec4 four = TEXEL_BITS(Texels, index >> 2u);
    vec4 texel = unpackUnorm4x8(four[index & 3u]);
    if ((lookup.flags & SRGB) != 0u) {
        // IEC 61966-2-1.
        vec3 dark = texel.rgb / 12.92;
        vec3 bright = pow((texel.rgb + 0.055) / 1.055, vec3(2.4));
        texel.rgb = mix(bright, dark, lessThanEqual(texel.rgb, vec3(0.04045)));
    }
    return texel;
}

// The value of a texture, RGBA, linear. There are no mip levels: a pixel is the mean of many places.
vec4 texture_value(uint index, vec4 sets) {
    TextureLookup lookup = TEXTURE_LOOKUP(Textures, index);
    vec3 set = vec3((lookup.flags & SECOND_SET) != 0u ? sets.zw : sets.xy, 1.0);
    vec2 at = vec2(dot(lookup.row_u, set), dot(lookup.row_v, set)) * vec2(lookup.size & 0xffffu, lookup.size >> 16u);
    // Past that, floats have no texels apart; NaN fails the comparison.
    at = vec2(abs(at.x) < 8388608.0 ? at.x : 0.0, abs(at.y) < 8388608.0 ? at.y : 0.0);
    bool nearest = (lookup.flags & NEAREST) != 0u;
    at -= nearest ? vec2(0.0) : vec2(0.5);
    vec2 low = floor(at);
    vec2 part = nearest ? vec2(0.0) : at - low;
    vec4 value = vec4(0.0);
    for (uint i = 0u; i < (nearest ? 1u : 4u); i++) {
        vec2 corner = vec2(i & 1u, i >> 1u);
        vec2 weight = mix(1.0 - part, part, corner);
        value += weight.x * weight.y * texel_at(lookup, low.x + corner.x, low.y + corner.y);
    }
    return value;
}

// The normal that a texture's value leans n to, on the side of the geometric one.
vec3 leaning_normal(vec3 n, vec3 geometric_normal, vec4 tangent, vec3 value, float scale) {
    vec3 t = tangent.xyz - dot(tangent.xyz, n) * n;
    float length2 = dot(t, t);
    t *= inversesqrt(max(length2, 1e-12));
    vec3 b = sign(tangent.w) * cross(n, t);
    vec3 local = value * 2.0 - 1.0;
    vec3 leaning = local.x * scale * t + local.y * scale * b + local.z * n;
    float leaning2 = dot(leaning, leaning);
    bool has_tangent = length2 >= 1e-12 && tangent.w != 0.0;
    bool fits = has_tangent && leaning2 > 1e-12 && dot(leaning, geometric_normal) > 0.0;
    return fits ? leaning * inversesqrt(leaning2) : n;
}

#endif
