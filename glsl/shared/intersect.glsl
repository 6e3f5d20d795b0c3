// Rays against triangles. Include after scene.glsl.

layout(constant_id = 0) const bool BRUTE_FORCE = false;

// Loop iterations that this invocation has made. Some drivers end every loop of an invocation, without a word, once it
// has made 65,535 of them: the stages stop before and count what they cut short.
uint loop_count = 0u;
bool loops_cut = false; // some traversal of this invocation was ended early

bool loops_left() {
    return loop_count < settings.loop_limit;
}

// Havel and Herout, «Yet faster ray-triangle intersection (using SSE4)», 2010: the test with precomputed planes.
// Accepts 0 < t < hit.t.
bool intersect_triangle(uint index, vec3 origin, vec3 direction, inout Hit hit) {
    HavelTriangle triangle = havel_triangle(index);
    float det = dot(direction, triangle.n0.xyz);
    float det_t = triangle.n0.w - dot(origin, triangle.n0.xyz);
    float inverse = 1.0 / det;
    float t = det_t * inverse;
    if (!(t > 0.0 && t < hit.t)) {
        return false;
    }
    vec3 point = origin + t * direction;
    float u = dot(point, triangle.n1.xyz) + triangle.n1.w;
    float v = dot(point, triangle.n2.xyz) + triangle.n2.w;
    if (!(u >= 0.0 && v >= 0.0 && u + v <= 1.0)) {
        return false;
    }
    hit = Hit(t, u, v, index);
    return true;
}

// Entry distance of the ray into a box, or a value above `limit` where it misses.
float enter_box(vec3 box_min, vec3 box_max, vec3 inverse_direction, vec3 scaled_origin, float limit) {
    vec3 t0 = box_min * inverse_direction - scaled_origin;
    vec3 t1 = box_max * inverse_direction - scaled_origin;
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    float enter = max(max(near.x, near.y), max(near.z, 0.0));
    // The factor covers the rounding of the slab test: Ize, «Robust BVH Ray Traversal», JCGT 2(2), 2013.
    float leave = min(min(far.x, far.y), min(far.z, limit)) * 1.00000036;
    return enter <= leave ? enter : 1e30;
}

const uint STACK_SIZE = 64u;

// The nearest triangle but `ignored` before t = limit. With any_hit: some triangle before it.
Hit trace(vec3 origin, vec3 direction, float limit, uint ignored, bool any_hit) {
    Hit hit = Hit(limit, 0.0, 0.0, MISS);
    if (BRUTE_FORCE) {
        uint i = 0u;
        while (i < settings.triangle_count && loops_left()) {
            loop_count += 1u;
            if (i != ignored && intersect_triangle(i, origin, direction, hit) && any_hit) {
                return hit;
            }
            i += 1u;
        }
        loops_cut = loops_cut || i < settings.triangle_count;
        return hit;
    }
    // A component of 0 gives infinite slabs; ±1e-20 keeps 0 · ∞ out of them.
    vec3 safe = vec3(abs(direction.x) < 1e-20 ? 1e-20 : direction.x, abs(direction.y) < 1e-20 ? 1e-20 : direction.y,
                     abs(direction.z) < 1e-20 ? 1e-20 : direction.z);
    vec3 inverse_direction = 1.0 / safe;
    vec3 scaled_origin = origin * inverse_direction;
    uint stack[STACK_SIZE];
    uint depth = 0u;
    uint node_index = 0u;
    bool complete = false;
    while (loops_left()) {
        loop_count += 1u;
        BvhNode node = bvh_node(node_index);
        float enter_left = enter_box(node.left_min.xyz, node.left_max.xyz, inverse_direction, scaled_origin, hit.t);
        float enter_right = enter_box(node.right_min.xyz, node.right_max.xyz, inverse_direction, scaled_origin, hit.t);
        uint left = floatBitsToUint(node.left_min.w);
        uint right = floatBitsToUint(node.right_min.w);
        uint left_count = floatBitsToUint(node.left_max.w);
        uint right_count = floatBitsToUint(node.right_max.w);
        bool go_left = enter_left < 1e30;
        bool go_right = enter_right < 1e30;
        // Leaves are tested at once, so that only inner nodes reach the stack.
        for (uint i = left; go_left && i < left + left_count; i++) {
            loop_count += 1u;
            if (i != ignored && intersect_triangle(i, origin, direction, hit) && any_hit) {
                return hit;
            }
        }
        for (uint i = right; go_right && i < right + right_count; i++) {
            loop_count += 1u;
            if (i != ignored && intersect_triangle(i, origin, direction, hit) && any_hit) {
                return hit;
            }
        }
        go_left = go_left && left_count == 0u && enter_left <= hit.t;
        go_right = go_right && right_count == 0u && enter_right <= hit.t;
        if (go_left && go_right) {
            bool left_first = enter_left <= enter_right;
            stack[depth] = left_first ? right : left;
            depth += 1u;
            node_index = left_first ? left : right;
        } else if (go_left || go_right) {
            node_index = go_left ? left : right;
        } else {
            if (depth == 0u) {
                complete = true;
                break;
            }
            depth -= 1u;
            node_index = stack[depth];
        }
    }
    loops_cut = loops_cut || !complete;
    return hit;
}
