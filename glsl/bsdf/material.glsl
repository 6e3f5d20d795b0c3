// A material's record, and what it is at a place of a triangle: textures and the corners' colours. What a material is made of is
// known in this room alone.
#ifndef BSDF_MATERIAL
#define BSDF_MATERIAL

#include "layout.glsl"
#include "bsdf/material_features.glsl"
#include "bsdf/reflection.glsl"
#include "common/sampling.glsl"
#include "trace/triangles.glsl"

uniform usamplerBuffer Materials;

#include "bsdf/texture.glsl"

Material material_at(uint i) {
    return MATERIAL(Materials, i);
}

Material no_material() {
    uvec4 zero = uvec4(0u);
    return material_from(zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero);
}

bool is_mirror(Material material) {
    return MIRRORS && material.surface == MIRROR;
}

bool is_dielectric(Material material) {
    return DIELECTRICS && material.surface == DIELECTRIC;
}

bool is_thin(Material material) {
    return THIN_WALLS && material.thin != 0u;
}

// A dielectric with an inside.
bool is_solid(Material material) {
    return is_dielectric(material) && !is_thin(material);
}

// Whether a surface passes a part of the light only.
bool is_mixed(Material material) {
    return PARTLY_CLEAR && is_dielectric(material) && material.transmission * (1.0 - material.metallic) < 1.0;
}

bool is_coated(Material material) {
    return CLEARCOAT && material.coat > 0.0;
}

bool is_glossy(Material material) {
    return GLOSSY && material.surface == GLOSSY_SURFACE;
}

bool is_matte(Material material) {
    return !is_mirror(material) && !is_dielectric(material) && !is_glossy(material);
}

bool is_rough_glass(Material material) {
    return ROUGH_GLASS && material.roughness * material.roughness >= SMOOTH_ALPHA;
}

// The base and the reflection of what isn't a dielectric.
Bsdf bsdf_of(Material material) {
    Bsdf bsdf = lambertian(material.base_color);
    if (is_glossy(material)) {
        bsdf = Bsdf(material.base_color * (1.0 - material.metallic),
                    mix(material.specular_f0, material.base_color, material.metallic),
                    mix(material.specular_f90, 1.0, material.metallic), material.roughness * material.roughness,
                    vec2(largest(material.specular_f0), material.specular_f90), material.coat,
                    Sheen(material.sheen_color, material.sheen_roughness), 0.0, material.anisotropy_direction);
        if (ANISOTROPY && material.anisotropy > 0.0 && bsdf.alpha >= SMOOTH_ALPHA) {
            bsdf.along = mix(bsdf.alpha, 1.0, material.anisotropy * material.anisotropy);
        }
    }
    return bsdf;
}

// A clear coat by itself.
Material coat_of(Material material) {
    float coat = material.coat;
    material.surface = GLOSSY_SURFACE;
    material.base_color = vec3(0.0);
    material.metallic = 0.0;
    material.roughness = material.coat_roughness;
    material.specular_f0 = vec3(COAT_F0 * coat);
    material.specular_f90 = coat;
    material.coat = 0.0;
    material.sheen_color = vec3(0.0);
    material.anisotropy = 0.0;
    return material;
}

// Whether it takes all light.
bool is_black(Material material) {
    return is_matte(material) && largest(material.base_color) == 0.0;
}

// Whether light leaves on the triangle's front, or on its back.
bool emits(Material material, bool front) {
    return front || (material.flags & BACK_EMITS) != 0u;
}

// Whether it is the back of a surface that no camera sees there.
bool hides_back(Material material) {
    return (material.flags & BACK_HIDDEN) != 0u;
}

bool is_textured(ShadingTriangle triangle) {
    return TEXTURED && (triangle.flags & TEXTURED_TRIANGLE) != 0u;
}

// What textures and the corners' colours make of a material: factors, and the values of textures of normals.
struct MaterialPoint {
    vec3 base_color;
    float roughness;
    float metallic;
    vec3 normal;
    vec3 emission;
    float transmission;
    float specular;
    vec3 specular_color;
    float coat;
    float coat_roughness;
    vec3 coat_normal;
    vec3 sheen_color;
    float sheen_roughness;
};

MaterialPoint material_point(Hit hit) {
    MaterialPoint point = MaterialPoint(vec3(1.0), 1.0, 1.0, vec3(0.0), vec3(1.0), 1.0, 1.0, vec3(1.0), 1.0, 1.0, vec3(0.0),
                                        vec3(1.0), 1.0);
    ShadingTriangle triangle = shading_triangle(hit.triangle);
    if (is_textured(triangle)) {
        vec4 sets = texture_coordinates(hit);
        // One loop, so that the code that looks a texture up is there once. What is loaded in it holds no registers outside.
        uint count = 7u;
        if (CLEARCOAT) {
            count = 10u;
        }
        if (SHEEN) {
            count = 12u;
        }
        for (uint i = 0u; i < count; i++) {
            Material maps = material_at(triangle.material);
            uvec4 first = uvec4(maps.color_texture, maps.metal_texture, maps.normal_texture, maps.emission_texture);
            uvec3 second = uvec3(maps.transmission_texture, maps.specular_texture, maps.specular_color_texture);
            uint index = i < 4u ? first[i] : second[min(i - 4u, 2u)];
            if (CLEARCOAT) {
                uvec3 third = uvec3(maps.coat_texture, maps.coat_roughness_texture, maps.coat_normal_texture);
                index = i < 7u ? index : third[min(i - 7u, 2u)];
            }
            if (SHEEN) {
                uvec2 fourth = uvec2(maps.sheen_texture, maps.sheen_roughness_texture);
                if (i >= 10u) {
                    index = fourth[i - 10u];
                } else if (i >= 7u) {
                    index = CLEARCOAT ? index : NO_TEXTURE;
                }
            }
            if (index != NO_TEXTURE) {
                vec4 value = texture_value(index, sets);
                if (i == 0u) {
                    point.base_color = value.rgb;
                } else if (i == 1u) {
                    point.roughness = value.g;
                    point.metallic = value.b;
                } else if (i == 2u) {
                    point.normal = value.rgb;
                } else if (i == 3u) {
                    point.emission = value.rgb;
                } else if (i == 4u) {
                    point.transmission = value.r;
                } else if (i == 5u) {
                    point.specular = value.a;
                } else if (i == 6u) {
                    point.specular_color = value.rgb;
                } else if (i == 7u) {
                    point.coat = value.r;
                } else if (i == 8u) {
                    point.coat_roughness = value.g;
                } else if (i == 9u) {
                    point.coat_normal = value.rgb;
                } else if (i == 10u) {
                    point.sheen_color = value.rgb;
                } else {
                    point.sheen_roughness = value.a;
                }
            }
        }
        point.base_color *= corner_color(hit).rgb;
    }
    return point;
}

// A material at a place.
Material textured_material(uint index, MaterialPoint point) {
    Material material = material_at(index);
    if (TEXTURED) {
        material.base_color = min(material.base_color * point.base_color, 1.0);
        material.roughness *= point.roughness;
        material.metallic *= point.metallic;
        material.emission *= point.emission;
        material.transmission *= point.transmission;
        material.specular_f0 *= point.specular * point.specular_color;
        material.specular_f90 *= point.specular;
        if (CLEARCOAT) {
            material.coat *= point.coat;
            material.coat_roughness *= point.coat_roughness;
        }
        if (SHEEN) {
            material.sheen_color *= point.sheen_color;
            material.sheen_roughness *= point.sheen_roughness;
        }
    }
    return material;
}

// Turns a surface's shading normals as textures say.
void lean_normals(Hit hit, MaterialPoint point, inout Surface surface) {
    if (is_textured(shading_triangle(hit.triangle))) {
        Material maps = material_at(surface.material);
        bool leans = maps.normal_texture != NO_TEXTURE;
        bool coat_leans = CLEARCOAT && maps.coat_normal_texture != NO_TEXTURE;
        if (leans || coat_leans) {
            vec4 tangent = tangent_at(hit);
            vec3 n = surface.shading_normal;
            if (leans) {
                surface.shading_normal =
                    leaning_normal(n, surface.geometric_normal, tangent, point.normal, maps.normal_scale);
            }
            if (coat_leans) {
                surface.coat_normal = leaning_normal(surface.coat_normal, surface.geometric_normal, tangent,
                                                     point.coat_normal, maps.coat_normal_scale);
            }
        }
    }
}

// Turns a material's direction of anisotropy into render space. Without a tangent the material is isotropic.
void turn_anisotropy(Hit hit, Surface surface, inout Material material) {
    vec2 turn = vec2(cos(material.anisotropy_rotation), sin(material.anisotropy_rotation));
    if (material.anisotropy_texture != NO_TEXTURE) {
        vec3 value = texture_value(material.anisotropy_texture, texture_coordinates(hit)).rgb;
        vec2 local = 2.0 * value.rg - 1.0;
        turn = vec2(turn.x * local.x - turn.y * local.y, turn.y * local.x + turn.x * local.y);
        material.anisotropy *= value.b;
    }
    vec4 tangent = tangent_at(hit);
    vec3 n = surface.shading_normal;
    vec3 t = tangent.xyz - dot(tangent.xyz, n) * n;
    float length2 = dot(t, t);
    t *= inversesqrt(max(length2, 1e-12));
    vec3 direction = turn.x * t + turn.y * sign(tangent.w) * cross(n, t);
    bool has_direction = length2 >= 1e-12 && tangent.w != 0.0 && dot(turn, turn) > 1e-6;
    if (has_direction && material.anisotropy > 0.0) {
        material.anisotropy_direction = encode_direction(direction);
        // Across its direction too the lobe is no mirror's; what transmits light is isotropic and may be smooth.
        material.roughness = is_dielectric(material) ? material.roughness : max(material.roughness, LEAST_ROUGHNESS);
    } else {
        material.anisotropy = 0.0;
    }
}

// The material at a place, whose shading normals are turned.
Material material_of(Hit hit, MaterialPoint point, inout Surface surface) {
    Material material = textured_material(surface.material, point);
    lean_normals(hit, point, surface);
    if (ANISOTROPY && material.anisotropy > 0.0) {
        turn_anisotropy(hit, surface, material);
    }
    return material;
}

// Of a material what its emission depends on, at a place.
Material emitter_at(Hit hit) {
    ShadingTriangle triangle = shading_triangle(hit.triangle);
    Material material = material_at(triangle.material);
    if (is_textured(triangle)) {
        vec4 sets = texture_coordinates(hit);
        if (material.emission_texture != NO_TEXTURE) {
            material.emission *= texture_value(material.emission_texture, sets).rgb;
        }
        bool coated = CLEARCOAT && material.coat_texture != NO_TEXTURE;
        if (coated) {
            material.coat *= texture_value(material.coat_texture, sets).r;
        }
    }
    return material;
}

// How much of a surface is there, at a place.
float opacity_at(Hit hit) {
    ShadingTriangle triangle = shading_triangle(hit.triangle);
    Material material = material_at(triangle.material);
    float alpha = material.alpha;
    if (is_textured(triangle)) {
        alpha *= corner_color(hit).a;
        if (material.color_texture != NO_TEXTURE) {
            alpha *= texture_value(material.color_texture, texture_coordinates(hit)).a;
        }
    }
    return material.alpha_mode == MASK ? (alpha < material.alpha_cutoff ? 0.0 : 1.0) : clamp(alpha, 0.0, 1.0);
}

#endif
