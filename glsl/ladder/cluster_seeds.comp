#version 460
#extension GL_GOOGLE_include_directive : require
// k-means: each cluster begins at the mean of its run of visible points.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "ladder/clusters.glsl"

uniform usamplerBuffer VisiblePoints;
layout(std430) readonly buffer MeshOrder { uint mesh_order[]; };
layout(std430) writeonly buffer Centroids { Centroid centroids[]; };

void main() {
    uint run = invocation_index();
    if (run >= push.runs) {
        return;
    }
    Centroid first = Centroid(vec3(0.0), NO_OBJECT);
    vec3 offset = vec3(0.0); // from the first point: a sum of positions would cancel
    uint count = 0u;
    for (uint i = run * GROUP; i < (run + 1u) * GROUP; i++) {
        uint slot = mesh_order[i];
        if (slot != NO_SLOT) {
            VisiblePoint point = VISIBLE_POINT(VisiblePoints, slot);
            if (count == 0u) {
                first = Centroid(point.position, point.object);
            }
            offset += point.position - first.position;
            count += 1u;
        }
    }
    centroids[run] = Centroid(first.position + offset / float(max(count, 1u)), first.object);
}
