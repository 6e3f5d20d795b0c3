// What a surface's material is at a place: textures and the corners' colours. Include after texel.glsl and scene.glsl.

uniform usamplerBuffer Corners;
uniform usamplerBuffer Textures;
uniform usamplerBuffer Texels;

// What a place of a triangle has for textures.
struct Place {
    vec4 sets; // texture coordinates of both sets
    vec4 color;
    vec4 tangent; // w: the bitangent's side, 0 where there is none
};

Place place_at(PlacedTriangle at, vec2 uv) {
    Place place = Place(vec4(0.0), vec4(0.0), vec4(0.0));
    bool is_placed = is_placed(at.instance);
    Instance instance;
    if (is_placed) {
        instance = instance_at(at.instance);
    }
    for (uint i = 0u; i < 3u; i++) {
        Corner corner = CORNER(Corners, 3u * at.triangle + i);
        float weight = i == 0u ? 1.0 - uv.x - uv.y : (i == 1u ? uv.x : uv.y);
        place.sets += weight * vec4(corner.first, corner.second);
        place.color += weight * vec4(unpackHalf2x16(corner.color.x), unpackHalf2x16(corner.color.y));
        vec3 tangent = decode_direction(corner.tangent);
        if (is_placed) {
            // It follows the surface as its edges do. Mirroring turns normal × tangent round, but not the bitangent.
            vec4 direction = vec4(tangent, 0.0);
            tangent = normalize(vec3(dot(instance.rows[0], direction), dot(instance.rows[1], direction),
                                     dot(instance.rows[2], direction)));
            corner.bitangent *= is_mirrored(instance) ? -1.0 : 1.0;
        }
        place.tangent += weight * vec4(tangent * abs(corner.bitangent), corner.bitangent);
    }
    return place;
}

// The texel of an image of so many along one side that stands at a place.
uint wrapped(float place, uint count, uint mode) {
    float n = float(count);
    mode &= 3u;
    if (mode == CLAMP) {
        return uint(clamp(place, 0.0, n - 1.0));
    }
    // Whole numbers: exact up to 2^24.
    float period = mode == MIRROR_REPEAT ? 2.0 * n : n;
    float rest = clamp(place - period * floor(place / period), 0.0, period - 1.0);
    return uint(min(rest, mode == MIRROR_REPEAT ? period - 1.0 - rest : rest));
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
vec4 texture_value(uint index, Place place) {
    TextureLookup lookup = TEXTURE_LOOKUP(Textures, index);
    vec3 set = vec3((lookup.flags & SECOND_SET) != 0u ? place.sets.zw : place.sets.xy, 1.0);
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

// The normal that a texture leans n to, on the side of the geometric one.
vec3 leaning_normal(vec3 n, Surface surface, Place place, vec3 value, float scale) {
    vec3 t = place.tangent.xyz - dot(place.tangent.xyz, n) * n;
    float length2 = dot(t, t);
    if (length2 < 1e-12 || place.tangent.w == 0.0) {
        return n;
    }
    t *= inversesqrt(length2);
    vec3 b = sign(place.tangent.w) * cross(n, t);
    vec3 local = value * 2.0 - 1.0;
    vec3 leaning = local.x * scale * t + local.y * scale * b + local.z * n;
    float leaning2 = dot(leaning, leaning);
    bool fits = leaning2 > 1e-12 && dot(leaning, surface.geometric_normal) > 0.0;
    return fits ? leaning * inversesqrt(leaning2) : n;
}

// A surface's material at its place. A texture of normals turns its shading normal.
Material material_of(inout Surface surface) {
    Material material = material_at(surface.material);
    bool textured = TEXTURED && (surface.flags & TEXTURED_TRIANGLE) != 0u;
    if (!textured) {
        return material;
    }
    Place place = place_at(surface.triangle, surface.uv);
    // Loaded where they are used: from before `place_at` on they would hold registers.
    Material maps = material_at(surface.material);
    uvec4 first = uvec4(maps.color_texture, maps.metal_texture, maps.normal_texture, maps.emission_texture);
    uvec3 second = uvec3(maps.transmission_texture, maps.specular_texture, maps.specular_color_texture);
    uvec3 third = uvec3(maps.coat_texture, maps.coat_roughness_texture, maps.coat_normal_texture);
    material.base_color *= place.color.rgb;
    // One loop, so that the code that looks a texture up is there once.
    for (uint i = 0u; i < 7u || (CLEARCOAT && i < 10u); i++) {
        uint index = i < 4u ? first[i] : (i < 7u ? second[i - 4u] : third[i - 7u]);
        if (index == NO_TEXTURE) {
            continue;
        }
        vec4 value = texture_value(index, place);
        if (i == 0u) {
            material.base_color *= value.rgb;
        } else if (i == 1u) {
            material.roughness *= value.g;
            material.metallic *= value.b;
        } else if (i == 2u) {
            surface.shading_normal =
                leaning_normal(surface.shading_normal, surface, place, value.rgb, maps.normal_scale);
        } else if (i == 3u) {
            material.emission *= value.rgb;
        } else if (i == 4u) {
            material.transmission *= value.r;
        } else if (i == 5u) {
            material.specular_f0 *= value.a;
            material.specular_f90 *= value.a;
        } else if (i == 6u) {
            material.specular_f0 *= value.rgb;
        } else if (CLEARCOAT && i == 7u) {
            material.coat *= value.r;
        } else if (CLEARCOAT && i == 8u) {
            material.coat_roughness *= value.g;
        } else if (CLEARCOAT) {
            surface.coat_normal =
                leaning_normal(surface.coat_normal, surface, place, value.rgb, maps.coat_normal_scale);
        }
    }
    material.base_color = min(material.base_color, 1.0);
    return material;
}

// Of a surface's material what its emission depends on, at its place.
Material emitter_of(Surface surface) {
    Material material = material_at(surface.material);
    bool textured = TEXTURED && (surface.flags & TEXTURED_TRIANGLE) != 0u;
    if (textured) {
        Place place = place_at(surface.triangle, surface.uv);
        Material maps = material_at(surface.material);
        if (maps.emission_texture != NO_TEXTURE) {
            material.emission *= texture_value(maps.emission_texture, place).rgb;
        }
        bool coated = CLEARCOAT && maps.coat_texture != NO_TEXTURE;
        if (coated) {
            material.coat *= texture_value(maps.coat_texture, place).r;
        }
    }
    return material;
}

// The part of a surface that is there, at its place.
float share_there(Surface surface) {
    bool see_through = ALPHA && (surface.flags & SEE_THROUGH) != 0u;
    if (!see_through) {
        return 1.0;
    }
    Material material = material_at(surface.material);
    float alpha = material.alpha;
    bool textured = TEXTURED && (surface.flags & TEXTURED_TRIANGLE) != 0u;
    if (textured) {
        Place place = place_at(surface.triangle, surface.uv);
        alpha *= place.color.a;
        if (material.color_texture != NO_TEXTURE) {
            alpha *= texture_value(material.color_texture, place).a;
        }
    }
    return material.alpha_mode == MASK ? (alpha < material.alpha_cutoff ? 0.0 : 1.0) : clamp(alpha, 0.0, 1.0);
}
