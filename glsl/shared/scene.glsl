// The scene as the rays see it. Include after settings.glsl, sampling.glsl and gloss.glsl.

#include "layout.glsl"

// What the scene has, see packing::SceneFeatures: there is no code for the rest.
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

const uint NO_INSTANCE = 0xffffffffu;

const uint RANK_BELOW = 0xffffu; // bits of flags below RANK

// A triangle, and the instance that puts it where it is.
struct PlacedTriangle {
    uint triangle; // MISS for none
    uint instance; // NO_INSTANCE of one in render space
};

const PlacedTriangle NO_TRIANGLE = PlacedTriangle(MISS, NO_INSTANCE);

uniform usamplerBuffer Bvh;
uniform usamplerBuffer HavelTriangles;
uniform usamplerBuffer ShadingTriangles;
uniform usamplerBuffer Instances;
uniform usamplerBuffer Materials;

HavelTriangle havel_triangle(uint i) {
    return HAVEL_TRIANGLE(HavelTriangles, i);
}

ShadingTriangle shading_triangle(uint i) {
    return SHADING_TRIANGLE(ShadingTriangles, i);
}

Instance instance_at(uint i) {
    return INSTANCE(Instances, i);
}

// Whether fronts become backs.
bool is_mirrored(Instance instance) {
    return (instance.flags & MIRRORED) != 0u;
}

// Where a map puts a point: the same for all triangles that share a corner, and `Placement::point` in src/scene/placement.rs.
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
    return MATERIAL(Materials, i);
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
    return is_coated(material_at(material));
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
vec3 offset_origin(vec3 p, vec3 n, vec3 reach) {
    return p + ROUNDINGS * dot(abs(n), reach) * n;
}

// A ray that leaves the surface starts on the side that it flies to.
vec3 origin_towards(Surface surface, vec3 direction) {
    vec3 n = surface.geometric_normal;
    return offset_origin(surface.position, dot(direction, n) >= 0.0 ? n : -n, surface.reach);
}
