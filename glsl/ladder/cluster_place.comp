#version 460
#extension GL_GOOGLE_include_directive : require
// Orders the visible points by cluster, stably, with fillers in between.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "ladder/clusters.glsl"

layout(std430) readonly buffer MeshOrder { uint mesh_order[]; };
layout(std430) readonly buffer ClusterOf { uint cluster_of[]; };
layout(std430) readonly buffer ClusterStarts { uint cluster_starts[]; };
layout(std430) writeonly buffer PointOrder { uint point_order[]; }; // filled with NO_SLOT before

void main() {
    uint cluster = invocation_index();
    if (cluster >= push.runs) {
        return;
    }
    uint next = cluster_starts[cluster];
    uvec2 window = window_of(cluster);
    for (uint place = window.x * GROUP; place < window.y * GROUP; place++) {
        if (cluster_of[place] == cluster) {
            point_order[next] = mesh_order[place];
            next += 1u;
        }
    }
}
