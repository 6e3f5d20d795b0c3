// Ray queries (VK_KHR_ray_query). Stages that trace rays are compiled a second time with RAY_QUERY, for devices that can load it.

// Instance 0 has the triangles in render space; the others follow in the order of Instances. The device gets only the box of each
// triangle: it finds the boxes that a ray enters, and the tests of intersect.glsl decide. So hits equal those of the other
// searches to the bit, on every device, and no ray passes between triangles by a device's rounding.
layout(set = 1, binding = 0) uniform accelerationStructureEXT Tlas;

Hit trace_by_query(Ray ray, Progress progress, float limit, PlacedTriangle ignored, bool any_hit) {
    Hit hit = Hit(limit, 0.0, 0.0, MISS, NO_INSTANCE);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, Tlas, gl_RayFlagsNoneEXT, 0xffu, ray.origin, progress.t, ray.direction,
                          min(limit * (1.0 + 2.0 * TIE), 1e30));
    bool over = false;
    while (!over && rayQueryProceedEXT(query)) {
        loop_count += 1u;
        PlacedTriangle at = PlacedTriangle(rayQueryGetIntersectionPrimitiveIndexEXT(query, false), NO_INSTANCE);
        uint instance = rayQueryGetIntersectionInstanceIdEXT(query, false);
        bool is_placed = INSTANCED && instance != 0u;
        mat3x4 rows = UNPLACED;
        if (is_placed) {
            Instance placement = instance_at(instance - 1u);
            rows = placement.rows;
            at.instance = instance - 1u;
            at.triangle += placement.first_triangle;
        }
        ShadingTriangle triangle = shading_triangle(at.triangle);
        vec3 corner0 = triangle.p0;
        vec3 corner1 = triangle.p1;
        vec3 corner2 = triangle.p2;
        LocalRay local = in_render_space(ray);
        if (is_placed) {
            corner0 = placed(rows, corner0);
            corner1 = placed(rows, corner1);
            corner2 = placed(rows, corner2);
            if (HAVEL) {
                local = in_instance(ray, inverse_rows(rows), 0.0);
            }
        }
        if (at != ignored && intersect_triangle(ray, local, corner0, corner1, corner2, at, progress, hit)) {
            over = any_hit;
            // The device continues with boxes that begin before this distance. Rounding changes the order of coincident faces.
            rayQueryGenerateIntersectionEXT(query, min(hit.t * (1.0 + TIE), 1e30));
        }
    }
    return hit;
}
