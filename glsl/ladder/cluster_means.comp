#version 460
#extension GL_GOOGLE_include_directive : require
// k-means: each cluster moves to the mean of its visible points.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "ladder/clusters.glsl"

uniform usamplerBuffer VisiblePoints;
layout(std430) readonly buffer MeshOrder { uint mesh_order[]; };
layout(std430) readonly buffer ClusterOf { uint cluster_of[]; };
layout(std430) buffer Centroids { Centroid centroids[]; };
layout(std430) writeonly buffer ClusterSizes { uint cluster_sizes[]; };
layout(std430) writeonly buffer ClusterStarts { uint padded_sizes[]; };

void main() {
    uint cluster = invocation_index();
    if (cluster >= push.runs) {
        return;
    }
    Centroid before = centroids[cluster];
    vec3 offset = vec3(0.0);
    uint count = 0u;
    uvec2 window = window_of(cluster);
    for (uint place = window.x * GROUP; place < window.y * GROUP; place++) {
        if (cluster_of[place] == cluster) {
            offset += VISIBLE_POINT(VisiblePoints, mesh_order[place]).position - before.position;
            count += 1u;
        }
    }
    centroids[cluster] = Centroid(before.position + offset / float(max(count, 1u)), before.object);
    cluster_sizes[cluster] = count;
    // Including fillers, so that no workgroup has points of two clusters.
    padded_sizes[cluster] = (count + GROUP - 1u) / GROUP * GROUP;
}
