// The scene as the rays see it. Include after settings.glsl, sampling.glsl, gloss.glsl and texel.glsl.

// What the scene has, see scene::SceneFeatures: there is no code for the rest.
layout(constant_id = 6) const bool MIRRORS = true;
layout(constant_id = 7) const bool DIELECTRICS = true;
layout(constant_id = 8) const bool CONTACT = true;
layout(constant_id = 10) const bool ROUGH_GLASS = false;
layout(constant_id = 11) const bool THIN_WALLS = false;
layout(constant_id = 12) const bool PARTLY_CLEAR = false;
layout(constant_id = 13) const bool ABSORPTION = false;
layout(constant_id = 14) const bool PUNCTUAL_LIGHTS = false;
layout(constant_id = 30) const bool SOFT_LIGHTS = false; // some of them have an extent
layout(constant_id = 32) const bool IMMERSED = false; // paths start in dielectrics
layout(constant_id = 15) const bool ENVIRONMENT = false;
layout(constant_id = 16) const bool TEXTURED = false;
layout(constant_id = 17) const bool ALPHA = false;
layout(constant_id = 18) const bool DISPERSION = false;
layout(constant_id = 20) const bool INSTANCED = false;
layout(constant_id = 21) const bool CLEARCOAT = false;
layout(constant_id = 22) const bool SPECULAR_GLASS = false;
layout(constant_id = 23) const bool CULLING = false;
layout(constant_id = 26) const bool COINCIDENCE = false;
layout(constant_id = 27) const bool NESTED = false;

const uint MISS = 0xffffffffu;

const uint NO_LIGHT = 0xffffffffu;

const uint NO_INSTANCE = 0xffffffffu;

// Flags of a triangle.
const uint SMOOTH_SHADED = 1u; // the shading normals differ from the geometric one
const uint TOUCHED = 2u;       // a dielectric's, and it may lie on another face
const uint COINCIDENT = 16u;   // no dielectric's, and it lies on a face of another object that looks or shines to the same side
const uint BACKED = 32u;       // no dielectric's, and its back lies on the back of another object's face
const uint RANK = 16u;         // from this bit on: of dielectrics that overlap, the lowest is there
const uint RANK_BELOW = 0xffffu;

const uint MIRRORED = 1u; // of an instance's flags, which have a rank as well

const uint BACK_EMITS = 1u;
const uint BACK_HIDDEN = 2u;
const uint SPECULAR_CHANGED = 4u;

const uint MIRROR = 1u;
const uint DIELECTRIC = 2u;
const uint GLOSSY_SURFACE = 3u;

// Havel and Herout's precomputed triangle.
struct HavelTriangle {
    vec4 n0; // xyz: normal, w: its plane's offset
    vec4 n1;
    vec4 n2;
};

// A triangle as shading needs it. In each w: the vertex's shading normal, octahedral.
struct ShadingTriangle {
    vec4 p0;
    vec4 p1;
    vec4 p2;
    uint object;
    uint material;
    uint flags; // SMOOTH_SHADED, TOUCHED, COINCIDENT, BACKED, and a rank
    uint light; // NO_LIGHT where it doesn't emit
};

// Where shared triangles are put.
struct Instance {
    mat3x4 rows;         // of the map to render space
    uint object;
    uint flags; // MIRRORED, and a rank
    uint first_triangle;
    uint triangle_count;
};

// A triangle, and the instance that puts it where it is.
struct PlacedTriangle {
    uint triangle; // MISS for none
    uint instance; // NO_INSTANCE of one in render space
};

const PlacedTriangle NO_TRIANGLE = PlacedTriangle(MISS, NO_INSTANCE);

struct Material {
    vec3 base_color;
    uint surface;      // MIRROR, DIELECTRIC, GLOSSY_SURFACE or 0 for matte
    vec3 emission;     // radiance
    float ior;
    uint flags;        // BACK_EMITS, BACK_HIDDEN, SPECULAR_CHANGED
    float metallic;
    float roughness;
    float transmission; // share of a dielectric's part that is no metal that passes light; the rest is glossy
    vec3 specular_f0;   // of a glossy surface's dielectric part, or of glass
    float specular_f90;
    vec3 absorption;    // inside of a dielectric, 1/length
    uint thin;          // a dielectric without an inside
    // For texture.glsl, which reads them by itself.
    uint color_texture;
    uint metal_texture;
    uint normal_texture;
    uint emission_texture;
    uint transmission_texture;
    uint specular_texture;
    uint specular_color_texture;
    float normal_scale;
    uint alpha_mode;
    float alpha_cutoff;
    float alpha;
    float dispersion; // 20 over the Abbe number
    float coat;       // how much of it there is
    float coat_roughness;
    // As the textures above.
    uint coat_texture;
    uint coat_roughness_texture;
    uint coat_normal_texture;
    float coat_normal_scale;
    uint padding0;
    uint padding1;
};

const uint MATERIAL_TEXELS = 10u;

uniform usamplerBuffer Bvh;
uniform usamplerBuffer HavelTriangles;
uniform usamplerBuffer ShadingTriangles;
uniform usamplerBuffer Instances;
uniform usamplerBuffer Materials;

HavelTriangle havel_triangle(uint i) {
    return HavelTriangle(TEXEL(HavelTriangles, 3u * i), TEXEL(HavelTriangles, 3u * i + 1u),
                         TEXEL(HavelTriangles, 3u * i + 2u));
}

ShadingTriangle shading_triangle(uint i) {
    uvec4 rest = TEXEL_BITS(ShadingTriangles, 4u * i + 3u);
    return ShadingTriangle(TEXEL(ShadingTriangles, 4u * i), TEXEL(ShadingTriangles, 4u * i + 1u),
                           TEXEL(ShadingTriangles, 4u * i + 2u), rest.x, rest.y, rest.z, rest.w);
}

Instance instance_at(uint i) {
    uvec4 rest = TEXEL_BITS(Instances, 4u * i + 3u);
    return Instance(mat3x4(TEXEL(Instances, 4u * i), TEXEL(Instances, 4u * i + 1u), TEXEL(Instances, 4u * i + 2u)), rest.x,
                    rest.y, rest.z, rest.w);
}

// Whether fronts become backs.
bool is_mirrored(Instance instance) {
    return (instance.flags & MIRRORED) != 0u;
}

// Where a map puts a point: the same for all triangles that share a corner, and `Placement::point` in src/scene.
vec3 placed(mat3x4 rows, vec3 p) {
    precise vec3 result = vec3(rows[0].x * p.x + rows[0].y * p.y + rows[0].z * p.z + rows[0].w,
                               rows[1].x * p.x + rows[1].y * p.y + rows[1].z * p.z + rows[1].w,
                               rows[2].x * p.x + rows[2].y * p.y + rows[2].z * p.z + rows[2].w);
    return result;
}

bool is_placed(uint instance) {
    return INSTANCED && instance != NO_INSTANCE;
}

Material material_at(uint i) {
    vec4 color = TEXEL(Materials, MATERIAL_TEXELS * i);
    vec4 emission = TEXEL(Materials, MATERIAL_TEXELS * i + 1u);
    uvec4 rest = TEXEL_BITS(Materials, MATERIAL_TEXELS * i + 2u);
    vec4 specular = vec4(0.0);
    uvec4 inside = uvec4(0u);
    if (GLOSSY) {
        specular = TEXEL(Materials, MATERIAL_TEXELS * i + 3u);
    }
    if (SPECULAR_GLASS) {
        specular = TEXEL(Materials, MATERIAL_TEXELS * i + 3u);
    }
    if (DIELECTRICS) {
        inside = TEXEL_BITS(Materials, MATERIAL_TEXELS * i + 4u);
    }
    float dispersion = 0.0;
    if (DISPERSION) {
        dispersion = TEXEL(Materials, MATERIAL_TEXELS * i + 7u).w;
    }
    vec2 coat = vec2(0.0);
    if (CLEARCOAT) {
        coat = TEXEL(Materials, MATERIAL_TEXELS * i + 8u).xy;
    }
    return Material(color.rgb, floatBitsToUint(color.w), emission.rgb, emission.w, rest.x, uintBitsToFloat(rest.y),
                    uintBitsToFloat(rest.z), uintBitsToFloat(rest.w), specular.rgb, specular.w,
                    uintBitsToFloat(inside.xyz), inside.w, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0.0, 0u, 0.0, 0.0, dispersion,
                    coat.x, coat.y, 0u, 0u, 0u, 0.0, 0u, 0u);
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

// Whether a surface passes a part of the light only.
bool is_mixed(Material material) {
    return PARTLY_CLEAR && is_dielectric(material) && material.transmission * (1.0 - material.metallic) < 1.0;
}

// A surface that passes a part of the light only is by chance all clear or all glossy; u is a uniform number again after
// that. Returns whether it has a glossy part.
bool choose_part(inout Material material, inout float u) {
    float t = material.transmission * (1.0 - material.metallic);
    bool mixed = is_mixed(material);
    if (mixed) {
        material.metallic = min(material.metallic / (1.0 - t), 1.0); // of what isn't clear
        bool clear = u < t;
        u = clear ? u / t : (u - t) / (1.0 - t);
        material.surface = clear ? DIELECTRIC : GLOSSY_SURFACE;
    }
    return mixed;
}

bool is_coated(Material material) {
    return CLEARCOAT && material.coat > 0.0;
}

// Whether a material has a coat anywhere: photons on it have their flux across their rays.
bool has_coat(uint material) {
    bool has = false;
    if (CLEARCOAT) {
        has = TEXEL(Materials, MATERIAL_TEXELS * material + 8u).x > 0.0;
    }
    return has;
}

bool is_glossy(Material material) {
    return GLOSSY && material.surface == GLOSSY_SURFACE;
}

bool is_matte(Material material) {
    return !is_mirror(material) && !is_dielectric(material) && !is_glossy(material);
}

Reflector reflector_of(Material material) {
    return Reflector(material.base_color * (1.0 - material.metallic),
                     mix(material.specular_f0, material.base_color, material.metallic),
                     mix(material.specular_f90, 1.0, material.metallic), material.roughness * material.roughness,
                     vec2(largest(material.specular_f0), material.specular_f90), material.coat);
}

struct Hit {
    float t;
    float u;
    float v;
    uint triangle; // MISS where nothing was hit
    uint instance; // NO_INSTANCE where the triangle is in render space
};

const Hit NO_HIT = Hit(0.0, 0.0, 0.0, MISS, NO_INSTANCE);

PlacedTriangle triangle_of(Hit hit) {
    return PlacedTriangle(hit.triangle, hit.instance);
}

// Where a ray met a surface.
struct Surface {
    vec3 position;
    vec3 reach;            // largest coordinates of the triangle's corners, or what those are sums of, without their signs
    vec3 geometric_normal; // of the triangle's front
    vec3 shading_normal;   // on the same side
    vec3 coat_normal;      // likewise, of a clear coat
    vec2 uv;               // barycentric coordinates of the second and the third corner
    PlacedTriangle triangle;
    uint object;
    uint material;
    uint light;
    uint flags;
};

// The matrix that takes normals along, up to their length: its rows, as columns.
mat3 normal_rows(Instance instance) {
    vec3 x = instance.rows[0].xyz;
    vec3 y = instance.rows[1].xyz;
    vec3 z = instance.rows[2].xyz;
    // The products of small numbers shall not vanish.
    vec3 largest = max(max(abs(x), abs(y)), abs(z));
    float scale = 1.0 / max(max(largest.x, largest.y), largest.z);
    x *= scale;
    y *= scale;
    z *= scale;
    float side = is_mirrored(instance) ? -1.0 : 1.0;
    return side * mat3(cross(y, z), cross(z, x), cross(x, y));
}

vec3 interpolated_normal(ShadingTriangle triangle, vec2 uv, vec3 geometric_normal, bool is_placed, mat3 rows) {
    if ((triangle.flags & SMOOTH_SHADED) == 0u) {
        return geometric_normal;
    }
    vec3 n0 = decode_direction(floatBitsToUint(triangle.p0.w));
    vec3 n1 = decode_direction(floatBitsToUint(triangle.p1.w));
    vec3 n2 = decode_direction(floatBitsToUint(triangle.p2.w));
    if (is_placed) {
        n0 = normalize(n0 * rows);
        n1 = normalize(n1 * rows);
        n2 = normalize(n2 * rows);
    }
    vec3 n = (1.0 - uv.x - uv.y) * n0 + uv.x * n1 + uv.y * n2;
    float length2 = dot(n, n);
    return length2 > 1e-12 && dot(n, geometric_normal) > 0.0 ? n * inversesqrt(length2) : geometric_normal;
}

// The point is rebuilt from the barycentric coordinates: unlike origin + t·direction its error doesn't grow with t.
Surface surface_at(PlacedTriangle at, vec2 uv) {
    ShadingTriangle triangle = shading_triangle(at.triangle);
    bool is_placed = is_placed(at.instance);
    Instance instance;
    mat3 rows = mat3(1.0);
    if (is_placed) {
        instance = instance_at(at.instance);
        rows = normal_rows(instance);
        triangle.p0.xyz = placed(instance.rows, triangle.p0.xyz);
        triangle.p1.xyz = placed(instance.rows, triangle.p1.xyz);
        triangle.p2.xyz = placed(instance.rows, triangle.p2.xyz);
        triangle.object = instance.object;
    }
    vec3 e1 = triangle.p1.xyz - triangle.p0.xyz;
    vec3 e2 = triangle.p2.xyz - triangle.p0.xyz;
    Surface surface;
    surface.position = triangle.p0.xyz + uv.x * e1 + uv.y * e2;
    surface.reach = max(max(abs(triangle.p0.xyz), abs(triangle.p1.xyz)), abs(triangle.p2.xyz));
    surface.geometric_normal = normalize(cross(e1, e2));
    if (is_placed) {
        // So much the corners are uncertain by against those of other objects in the same place.
        surface.reach = vec3(dot(abs(instance.rows[0]), vec4(1.0)), dot(abs(instance.rows[1]), vec4(1.0)),
                             dot(abs(instance.rows[2]), vec4(1.0)));
        surface.geometric_normal *= is_mirrored(instance) ? -1.0 : 1.0;
        triangle.flags |= instance.flags & ~RANK_BELOW;
    }
    surface.shading_normal = interpolated_normal(triangle, uv, surface.geometric_normal, is_placed, rows);
    surface.coat_normal = surface.shading_normal;
    surface.uv = uv;
    surface.triangle = at;
    surface.object = triangle.object;
    surface.material = triangle.material;
    surface.light = triangle.light;
    surface.flags = triangle.flags;
    return surface;
}

Surface surface_at(Hit hit) {
    return surface_at(triangle_of(hit), vec2(hit.u, hit.v));
}

// Moves a ray's origin off its surface, to the side of n, by a bound of the rounding errors of the position and of the
// triangle's plane, both a few roundings of the corners' coordinates: Pharr, Jakob and Humphreys, «Physically Based
// Rendering», 3rd edition, 2016, section 3.9.5. Near the origin, where floats are fine, so is the step: what lies a
// hundred-millionth of the scene away isn't jumped over.
const float ROUNDINGS = 16.0 / 16777216.0;

vec3 offset_origin(vec3 p, vec3 n, vec3 reach) {
    return p + ROUNDINGS * dot(abs(n), reach) * n;
}

// A ray that leaves the surface starts on the side that it flies to.
vec3 origin_towards(Surface surface, vec3 direction) {
    vec3 n = surface.geometric_normal;
    return offset_origin(surface.position, dot(direction, n) >= 0.0 ? n : -n, surface.reach);
}
