// Triangles, their placement by instances, and surfaces.
#ifndef TRACE_TRIANGLES
#define TRACE_TRIANGLES

#include "layout.glsl"
#include "common/sampling.glsl"

layout(constant_id = 20) const bool INSTANCED = false;

const uint MISS = 0xffffffffu;

const uint NO_INSTANCE = 0xffffffffu;

const uint RANK_BELOW = 0xffffu; // bits of flags below RANK

// A triangle of an instance.
struct PlacedTriangle {
    uint triangle; // MISS for none
    uint instance; // NO_INSTANCE if it is in render space
};

const PlacedTriangle NO_TRIANGLE = PlacedTriangle(MISS, NO_INSTANCE);

uniform usamplerBuffer ShadingTriangles;
uniform usamplerBuffer Instances;

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

// Transforms a point: bit for bit the same for all triangles that share a corner, and in `Placement::point` of
// src/scene/placement.rs.
vec3 placed(mat3x4 rows, vec3 p) {
    precise vec3 result = vec3(rows[0].x * p.x + rows[0].y * p.y + rows[0].z * p.z + rows[0].w,
                               rows[1].x * p.x + rows[1].y * p.y + rows[1].z * p.z + rows[1].w,
                               rows[2].x * p.x + rows[2].y * p.y + rows[2].z * p.z + rows[2].w);
    return result;
}

bool is_placed(uint instance) {
    return INSTANCED && instance != NO_INSTANCE;
}

struct Hit {
    float t;
    float u;
    float v;       // u, v: barycentric coordinates of the second and the third corner
    uint triangle; // MISS where nothing was hit
    uint instance; // NO_INSTANCE where the triangle is in render space
};

const Hit NO_HIT = Hit(0.0, 0.0, 0.0, MISS, NO_INSTANCE);

// A point of a triangle, as a ray that hits it there finds it.
Hit hit_at(PlacedTriangle at, vec2 uv) {
    return Hit(0.0, uv.x, uv.y, at.triangle, at.instance);
}

PlacedTriangle triangle_of(Hit hit) {
    return PlacedTriangle(hit.triangle, hit.instance);
}

// The surface at a hit.
struct Surface {
    vec3 position;
    vec3 reach;            // largest absolute coordinates of the triangle's corners, or of the terms that they are sums of
    vec3 geometric_normal; // of the triangle's front
    vec3 shading_normal;   // on the same side
    vec3 coat_normal;      // likewise, of a clear coat
    PlacedTriangle triangle;
    uint object;
    uint material;
    uint light;
    uint flags;
};

// The matrix for normals, up to their length: its rows, as columns.
mat3 normal_rows(Instance instance) {
    vec3 x = instance.rows[0].xyz;
    vec3 y = instance.rows[1].xyz;
    vec3 z = instance.rows[2].xyz;
    // Products of small numbers must not underflow.
    vec3 largest = max(max(abs(x), abs(y)), abs(z));
    float scale = 1.0 / max(max(largest.x, largest.y), largest.z);
    x *= scale;
    y *= scale;
    z *= scale;
    float side = is_mirrored(instance) ? -1.0 : 1.0;
    return side * mat3(cross(y, z), cross(z, x), cross(x, y));
}

// The interpolated normal, by the weights of the corners.
vec3 interpolated_normal(ShadingTriangle triangle, vec2 uv, vec3 geometric_normal, uint instance) {
    vec3 normal = geometric_normal;
    if ((triangle.flags & SMOOTH_SHADED) != 0u) {
        vec3 n0 = decode_direction(triangle.n0);
        vec3 n1 = decode_direction(triangle.n1);
        vec3 n2 = decode_direction(triangle.n2);
        if (is_placed(instance)) {
            mat3 rows = normal_rows(instance_at(instance));
            n0 = normalize(n0 * rows);
            n1 = normalize(n1 * rows);
            n2 = normalize(n2 * rows);
        }
        vec3 n = (1.0 - uv.x - uv.y) * n0 + uv.x * n1 + uv.y * n2;
        float length2 = dot(n, n);
        bool fits = length2 > 1e-12 && dot(n, geometric_normal) > 0.0;
        normal = fits ? n * inversesqrt(length2) : geometric_normal;
    }
    return normal;
}

// The position is computed from the barycentric coordinates: unlike that of origin + t·direction, its error does not grow with t.
Surface surface_at(Hit hit) {
    ShadingTriangle triangle = shading_triangle(hit.triangle);
    vec3 p0 = triangle.p0;
    vec3 p1 = triangle.p1;
    vec3 p2 = triangle.p2;
    vec3 reach = max(max(abs(p0), abs(p1)), abs(p2));
    float side = 1.0;
    if (is_placed(hit.instance)) {
        Instance instance = instance_at(hit.instance);
        p0 = placed(instance.rows, p0);
        p1 = placed(instance.rows, p1);
        p2 = placed(instance.rows, p2);
        // The uncertainty of the corners relative to those of coincident objects.
        reach = vec3(dot(abs(instance.rows[0]), vec4(1.0)), dot(abs(instance.rows[1]), vec4(1.0)),
                     dot(abs(instance.rows[2]), vec4(1.0)));
        side = is_mirrored(instance) ? -1.0 : 1.0;
        triangle.object = instance.object;
        triangle.flags |= instance.flags & ~RANK_BELOW;
    }
    vec3 e1 = p1 - p0;
    vec3 e2 = p2 - p0;
    Surface surface;
    surface.position = p0 + hit.u * e1 + hit.v * e2;
    surface.reach = reach;
    surface.geometric_normal = side * normalize(cross(e1, e2));
    surface.shading_normal =
        interpolated_normal(triangle, vec2(hit.u, hit.v), surface.geometric_normal, hit.instance);
    surface.coat_normal = surface.shading_normal;
    surface.triangle = triangle_of(hit);
    surface.object = triangle.object;
    surface.material = triangle.material;
    surface.light = triangle.light;
    surface.flags = triangle.flags;
    return surface;
}

// Offsets a ray's origin from its surface, to the side of n, by a bound of the rounding errors of the position and of the
// triangle's plane, both a few roundings of the corners' coordinates: Pharr, Jakob and Humphreys, «Physically Based Rendering»,
// 3rd edition, 2016, section 3.9.5. Near the origin of space, where floats are fine, the offset is small as well: it does not
// skip what is a hundred-millionth of the scene away.
vec3 offset_origin(vec3 p, vec3 n, vec3 reach) {
    return p + ROUNDINGS * dot(abs(n), reach) * n;
}

// The origin of a ray that leaves the surface in this direction.
vec3 origin_towards(Surface surface, vec3 direction) {
    vec3 n = surface.geometric_normal;
    return offset_origin(surface.position, dot(direction, n) >= 0.0 ? n : -n, surface.reach);
}

#endif
