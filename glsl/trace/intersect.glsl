// Rays against triangles. Include after settings.glsl and texel.glsl.
#ifndef TRACE_INTERSECT
#define TRACE_INTERSECT

#include "trace/triangles.glsl"

layout(constant_id = 0) const bool BRUTE_FORCE = false;
layout(constant_id = 4) const bool HAVEL = false; // the paper's triangle test instead of the watertight one
layout(constant_id = 26) const bool COINCIDENT_FACES = false;

uniform usamplerBuffer Bvh;
uniform usamplerBuffer HavelTriangles;

// Loop iterations of this invocation. Some drivers silently end every loop of an invocation after 65,535 of them: the stages stop
// earlier and count the paths that they cut short.
uint loop_count = 0u;
bool loops_cut = false; // a traversal of this invocation was ended early

bool loops_left() {
    return loop_count < settings.loop_limit;
}

// The position of a search along a ray: only later hits count, at the same distance in the order of instances and triangles. So a
// ray that passes a face continues behind it and misses no coincident face.
struct Progress {
    float t;
    PlacedTriangle at;
};

const Progress AT_ORIGIN = Progress(0.0, PlacedTriangle(MISS, NO_INSTANCE));

Progress past(Hit hit) {
    return Progress(hit.t, triangle_of(hit));
}

bool comes_first(PlacedTriangle a, PlacedTriangle b) {
    return a.instance == b.instance ? a.triangle < b.triangle : a.instance < b.instance;
}

// Whether a hit at this distance counts and is nearer than the nearest one so far.
bool is_nearer(float t, PlacedTriangle at, Progress progress, Hit hit) {
    bool later = t > progress.t;
    bool nearer = t < hit.t;
    if (COINCIDENT_FACES) {
        later = later || (t == progress.t && comes_first(progress.at, at));
        nearer = nearer || (t == hit.t && hit.triangle != MISS && comes_first(at, triangle_of(hit)));
    }
    return later && nearer;
}

// A ray, and coordinates in which it is an axis: `across` and `up` are 0 along it.
struct Ray {
    vec3 origin;
    vec3 direction;
    vec3 across;
    vec3 up;
};

Ray ray_frame(vec3 origin, vec3 direction) {
    vec3 size = abs(direction);
    Ray ray;
    ray.origin = origin;
    ray.direction = direction;
    // Sheared along the dominant axis of the ray.
    if (size.x >= size.y && size.x >= size.z) {
        float inverse = 1.0 / direction.x;
        ray.across = vec3(-direction.y * inverse, 1.0, 0.0);
        ray.up = vec3(-direction.z * inverse, 0.0, 1.0);
    } else if (size.y >= size.z) {
        float inverse = 1.0 / direction.y;
        ray.across = vec3(1.0, -direction.x * inverse, 0.0);
        ray.up = vec3(0.0, -direction.z * inverse, 1.0);
    } else {
        float inverse = 1.0 / direction.z;
        ray.across = vec3(1.0, 0.0, -direction.x * inverse);
        ray.up = vec3(0.0, 1.0, -direction.y * inverse);
    }
    return ray;
}

// The position of a corner relative to the ray: a function of the corner alone, the same for all triangles that share it.
vec2 beside(Ray ray, vec3 corner) {
    precise vec3 from = corner - ray.origin;
    precise vec2 result = vec2(dot(ray.across, from), dot(ray.up, from));
    return result;
}

// On which side of the edge from a to b the ray passes. Rounding is monotonous, so that the sign is right or the value 0,
// and the edge's other triangle finds the same with the opposite sign.
float side_of(vec2 a, vec2 b) {
    precise float result = a.x * b.y - a.y * b.x;
    return result;
}

// Woop, Benthin and Wald, «Watertight Ray/Triangle Intersection», JCGT 2(1), 2013: no ray passes between triangles that
// share an edge or a corner. The distance is that of the plane: unlike one interpolated from the corners', it is as right
// for a ray that starts on the triangle as `offset_origin` counts on. Accepts what `is_nearer` does.
bool intersect_watertight(Ray ray, vec3 corner0, vec3 corner1, vec3 corner2, PlacedTriangle at,
                          Progress progress, inout Hit hit) {
    vec2 a = beside(ray, corner0);
    vec2 b = beside(ray, corner1);
    vec2 c = beside(ray, corner2);
    vec3 sides = vec3(side_of(b, c), side_of(c, a), side_of(a, b));
    bool accepted = !(any(lessThan(sides, vec3(0.0))) && any(greaterThan(sides, vec3(0.0))));
    if (accepted) {
        vec3 n = cross(corner1 - corner0, corner2 - corner0);
        float t = dot(n, corner0 - ray.origin) / dot(n, ray.direction);
        float sum = sides.x + sides.y + sides.z;
        // The sum is 0 if the ray lies in the triangle's plane.
        accepted = is_nearer(t, at, progress, hit) && sum != 0.0;
        if (accepted) {
            float inverse = 1.0 / sum;
            hit = Hit(t, sides.y * inverse, sides.z * inverse, at.triangle, at.instance);
        }
    }
    return accepted;
}

// Havel and Herout, «Yet faster ray-triangle intersection (using SSE4)», 2010: the test with precomputed planes.
// The ray is that of the triangle's own space. Accepts what `is_nearer` does.
bool intersect_havel(vec3 origin, vec3 direction, PlacedTriangle at, Progress progress, inout Hit hit) {
    HavelTriangle triangle = HAVEL_TRIANGLE(HavelTriangles, at.triangle);
    float det = dot(direction, triangle.n0.xyz);
    float det_t = triangle.n0.w - dot(origin, triangle.n0.xyz);
    float inverse = 1.0 / det;
    float t = det_t * inverse;
    bool accepted = is_nearer(t, at, progress, hit);
    if (accepted) {
        vec3 point = origin + t * direction;
        float u = dot(point, triangle.n1.xyz) + triangle.n1.w;
        float v = dot(point, triangle.n2.xyz) + triangle.n2.w;
        accepted = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if (accepted) {
            hit = Hit(t, u, v, at.triangle, at.instance);
        }
    }
    return accepted;
}

// A ray for the boxes of a hierarchy, in the space of its triangles. If that is not render space, the ray and the triangles'
// positions are rounded: `low` and `high` are the origin, minus and plus the margin of the boxes.
struct LocalRay {
    vec3 origin;
    vec3 direction;
    vec3 low;
    vec3 high;
    vec3 inverse_direction;
};

// A component of 0 gives infinite slabs; ±1e-20 keeps 0 · ∞ out of them.
vec3 inverse_of(vec3 direction) {
    vec3 safe = vec3(abs(direction.x) < 1e-20 ? 1e-20 : direction.x, abs(direction.y) < 1e-20 ? 1e-20 : direction.y,
                     abs(direction.z) < 1e-20 ? 1e-20 : direction.z);
    return 1.0 / safe;
}

LocalRay in_render_space(Ray ray) {
    return LocalRay(ray.origin, ray.direction, ray.origin, ray.origin, inverse_of(ray.direction));
}

// A few roundings of 2^-24: of a row's factors, its products, their sum, and the sum with the margin of the boxes.
const float ROW_ROUNDINGS = 8.0 / 16777216.0;

// The ray in the space of an instance's triangles, given the rows of the map to that space and the rounding error of the
// triangles' positions there. t stays the same.
LocalRay in_instance(Ray ray, mat3x4 rows, float widening) {
    vec3 d = vec3(dot(rows[0].xyz, ray.direction), dot(rows[1].xyz, ray.direction), dot(rows[2].xyz, ray.direction));
    vec3 o = vec3(dot(rows[0].xyz, ray.origin), dot(rows[1].xyz, ray.origin), dot(rows[2].xyz, ray.origin)) +
             vec3(rows[0].w, rows[1].w, rows[2].w);
    // The magnitudes of the terms bound the rounding. At t = `last` the ray has left the triangles, which lie within ±1.
    vec3 of_d = vec3(dot(abs(rows[0].xyz), abs(ray.direction)), dot(abs(rows[1].xyz), abs(ray.direction)),
                     dot(abs(rows[2].xyz), abs(ray.direction)));
    vec3 of_o = vec3(dot(abs(rows[0]), vec4(abs(ray.origin), 1.0)), dot(abs(rows[1]), vec4(abs(ray.origin), 1.0)),
                     dot(abs(rows[2]), vec4(abs(ray.origin), 1.0)));
    vec3 size = abs(d);
    vec3 distance = abs(o);
    float last = (max(max(distance.x, distance.y), distance.z) + 2.0) / max(max(size.x, size.y), size.z);
    vec3 wider = vec3(widening) + ROW_ROUNDINGS * (of_o + last * of_d);
    return LocalRay(o, d, o + wider, o - wider, inverse_of(d));
}

bool intersect_triangle(Ray ray, LocalRay local, vec3 corner0, vec3 corner1, vec3 corner2, PlacedTriangle at,
                        Progress progress, inout Hit hit) {
    bool accepted = false;
    if (HAVEL) {
        accepted = intersect_havel(local.origin, local.direction, at, progress, hit);
    } else {
        accepted = intersect_watertight(ray, corner0, corner1, corner2, at, progress, hit);
    }
    return accepted;
}

// Entry distance of the ray into a box, or a value above `limit` where it misses.
float enter_box(vec3 box_min, vec3 box_max, LocalRay ray, float limit) {
    vec3 t0 = (box_min - ray.low) * ray.inverse_direction;
    vec3 t1 = (box_max - ray.high) * ray.inverse_direction;
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    float enter = max(max(near.x, near.y), max(near.z, 0.0));
    // The factor covers the rounding of the slab test: Ize, «Robust BVH Ray Traversal», JCGT 2(2), 2013.
    float leave = min(min(far.x, far.y), min(far.z, limit)) * 1.00000048;
    return enter <= leave ? enter : 1e30;
}

// No hierarchy is deeper than 64. One entry more, since compilers that turn arrays of up to 256 bytes into registers spill here.
const uint STACK_SIZE = 65u;
const uint FIRST_KEPT_BY_KERNEL = 34u; // those before belong to glsl/trace
const uint KEPT_SIZE = 47u;

// Private memory of an invocation: the stack of a traversal, and behind it values that are needed after the traversal, because
// registers are scarce during it.
uint private_memory[STACK_SIZE + KEPT_SIZE];

// Where the kept values start. With ray queries no stack is indexed, and compilers turn an array whose indices are all constant
// into registers. So the index depends on the settings there, although every driver's loops are longer than the stack.
uint kept_from() {
    uint from = STACK_SIZE;
#ifdef RAY_QUERY
    from = min(settings.loop_limit, from);
#endif
    return from;
}

void keep(uint at, uint value) {
    private_memory[kept_from() + at] = value;
}

void keep(uint at, vec3 value) {
    keep(at, floatBitsToUint(value.x));
    keep(at + 1u, floatBitsToUint(value.y));
    keep(at + 2u, floatBitsToUint(value.z));
}

void keep(uint at, uvec4 value) {
    keep(at, value.x);
    keep(at + 1u, value.y);
    keep(at + 2u, value.z);
    keep(at + 3u, value.w);
}

uint kept_word(uint at) {
    return private_memory[kept_from() + at];
}

vec3 kept(uint at) {
    return uintBitsToFloat(uvec3(kept_word(at), kept_word(at + 1u), kept_word(at + 2u)));
}

uvec4 kept_bits(uint at) {
    return uvec4(kept_word(at), kept_word(at + 1u), kept_word(at + 2u), kept_word(at + 3u));
}

const float TIE = 16.0 / 16777216.0; // relative error of distances by rounding

// Rows of the inverse map.
mat3x4 inverse_rows(mat3x4 rows) {
    mat3 inverse = inverse(mat3(rows[0].xyz, rows[1].xyz, rows[2].xyz));
    vec3 from = vec3(rows[0].w, rows[1].w, rows[2].w);
    return mat3x4(vec4(inverse[0], -dot(inverse[0], from)), vec4(inverse[1], -dot(inverse[1], from)),
                  vec4(inverse[2], -dot(inverse[2], from)));
}

const mat3x4 UNPLACED = mat3x4(1.0);

// Every triangle, as `trace`: those in render space, then those of each instance.
Hit trace_all(Ray ray, Progress progress, float limit, PlacedTriangle ignored, bool any_hit) {
    Hit hit = Hit(limit, 0.0, 0.0, MISS, NO_INSTANCE);
    LocalRay local = in_render_space(ray);
    mat3x4 rows = UNPLACED;
    PlacedTriangle at = PlacedTriangle(0u, NO_INSTANCE);
    uint left = settings.triangle_count;
    uint next = 0u;
    bool complete = false;
    bool over = false;
    while (!complete && !over && loops_left()) {
        loop_count += 1u;
        bool tests = left > 0u;
        if (tests) {
            ShadingTriangle triangle = shading_triangle(at.triangle);
            vec3 corner0 = triangle.p0;
            vec3 corner1 = triangle.p1;
            vec3 corner2 = triangle.p2;
            if (INSTANCED) {
                corner0 = placed(rows, corner0);
                corner1 = placed(rows, corner1);
                corner2 = placed(rows, corner2);
            }
            over = at != ignored && intersect_triangle(ray, local, corner0, corner1, corner2, at, progress, hit) && any_hit;
            at.triangle += 1u;
            left -= 1u;
        }
        bool enters = INSTANCED && !tests && next < settings.instance_count;
        if (enters) {
            Instance instance = instance_at(next);
            rows = instance.rows;
            at = PlacedTriangle(instance.first_triangle, next);
            left = instance.triangle_count;
            next += 1u;
            if (HAVEL) {
                local = in_instance(ray, inverse_rows(rows), 0.0);
            }
        }
        complete = !tests && !enters;
    }
    loops_cut = loops_cut || !(complete || over);
    return hit;
}

#ifdef RAY_QUERY
layout(constant_id = 63) const bool BY_HIERARCHY = false;
#include "trace/ray_query.glsl"
#endif

// As `trace_from`, by the hierarchy.
Hit trace_hierarchy(Ray ray, Progress progress, float limit, PlacedTriangle ignored, bool any_hit) {
    Hit hit = Hit(limit, 0.0, 0.0, MISS, NO_INSTANCE);
    LocalRay local = in_render_space(ray);
    uint instance = NO_INSTANCE; // of the current node
    uint outside = STACK_SIZE;   // depth of the stack at which the instance is left
    uint depth = 0u;
    uint limit_of_loops = settings.loop_limit; // a copy, because some drivers load settings again in each step
    uint reference = 0u;
    bool complete = false;
    bool over = false; // any hit was requested and found
    // A step processes a node or a triangle, so that no invocation of a subgroup waits for another's leaf.
    do {
        loop_count += 1u;
        bool is_leaf = (reference & LEAF) != 0u;
        BvhRecord record = BVH_RECORD(Bvh, reference & ~LEAF);
        uint far_child = 0u;
        bool push = false;
        bool pop = false;
        if (is_leaf) {
            BvhTriangle triangle = bvh_triangle_from(record.t0, record.t1, record.t2, record.t3);
            vec3 corner0 = triangle.p0;
            vec3 corner1 = triangle.p1;
            vec3 corner2 = triangle.p2;
            bool tests = triangle.index != ignored.triangle;
            if (INSTANCED) {
                if (instance != NO_INSTANCE) {
                    // Loaded again for each triangle: otherwise they would take twelve registers.
                    mat3x4 rows = instance_at(instance).rows;
                    corner0 = placed(rows, corner0);
                    corner1 = placed(rows, corner1);
                    corner2 = placed(rows, corner2);
                }
                tests = triangle.kind == 0u && (tests || instance != ignored.instance);
            }
            PlacedTriangle at = PlacedTriangle(triangle.index, instance);
            over = tests && intersect_triangle(ray, local, corner0, corner1, corner2, at, progress, hit) && any_hit;
            pop = triangle.last == 1u;
            reference += 1u;
            if (INSTANCED) {
                BvhInstance entered = bvh_instance_from(record.t0, record.t1, record.t2, record.t3);
                if (entered.kind == PLACEMENT_RECORD) {
                    instance = entered.index;
                } else if (entered.kind == RAY_RECORD) {
                    local = in_instance(ray, entered.rows, entered.widening);
                    reference = entered.index;
                    outside = depth;
                }
            }
        } else {
            // Rounding changes the order of coincident faces.
            float reached = COINCIDENT_FACES ? hit.t * (1.0 + TIE) : hit.t;
            BvhNode node = bvh_node_from(record.t0, record.t1, record.t2, record.t3);
            float enter_left = enter_box(node.left_low, node.left_high, local, reached);
            float enter_right = enter_box(node.right_low, node.right_high, local, reached);
            bool left_first = enter_left <= enter_right;
            reference = left_first ? node.left : node.right;
            far_child = left_first ? node.right : node.left;
            push = max(enter_left, enter_right) < 1e30;
            pop = min(enter_left, enter_right) >= 1e30;
        }
        // Written unconditionally: conditional stores are expensive on drivers that run invocations in SIMD.
        private_memory[depth] = far_child;
        depth += push ? 1u : 0u;
        if (pop) {
            if (INSTANCED) {
                if (depth == outside) {
                    local = in_render_space(ray);
                    instance = NO_INSTANCE;
                    outside = STACK_SIZE;
                }
            }
            complete = depth == 0u;
            depth = max(depth, 1u) - 1u;
            reference = private_memory[depth];
        }
    } while (!complete && !over && loop_count < limit_of_loops);
    loops_cut = loops_cut || !(complete || over);
    return hit;
}

// The nearest triangle except `ignored` after `progress` and before t = limit; with any_hit, any such triangle.
Hit trace_from(vec3 origin, vec3 direction, Progress progress, float limit, PlacedTriangle ignored, bool any_hit) {
    Ray ray = ray_frame(origin, direction);
    Hit hit = NO_HIT;
    if (BRUTE_FORCE) {
        hit = trace_all(ray, progress, limit, ignored, any_hit);
    } else {
#ifdef RAY_QUERY
        // The hierarchy stays reachable, so that bindings are numbered as in the other module.
        if (BY_HIERARCHY) {
            hit = trace_hierarchy(ray, progress, limit, ignored, any_hit);
        } else {
            hit = trace_by_query(ray, progress, limit, ignored, any_hit);
        }
#else
        hit = trace_hierarchy(ray, progress, limit, ignored, any_hit);
#endif
    }
    return hit;
}

// The same from the ray's origin on.
Hit trace(vec3 origin, vec3 direction, float limit, PlacedTriangle ignored, bool any_hit) {
    return trace_from(origin, direction, AT_ORIGIN, limit, ignored, any_hit);
}

#endif
