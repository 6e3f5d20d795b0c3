#version 460
#extension GL_GOOGLE_include_directive : require
// k-means: each visible point joins the nearest cluster of its mesh.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "ladder/clusters.glsl"

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer Centroids;
layout(std430) readonly buffer MeshOrder { uint mesh_order[]; };
layout(std430) writeonly buffer ClusterOf { uint cluster_of[]; }; // of each position; NO_SLOT for a filler

void main() {
    uint place = invocation_index();
    if (place >= push.runs * GROUP) {
        return;
    }
    uint slot = mesh_order[place];
    uint nearest = NO_SLOT;
    if (slot != NO_SLOT) {
        VisiblePoint point = VISIBLE_POINT(VisiblePoints, slot);
        float least = 1e30;
        uvec2 window = window_of(place / GROUP);
        for (uint run = window.x; run < window.y; run++) {
            Centroid cluster = CENTROID(Centroids, run);
            vec3 d = cluster.position - point.position;
            float d2 = dot(d, d);
            if (cluster.object == point.object && d2 < least) {
                least = d2;
                nearest = run;
            }
        }
    }
    cluster_of[place] = nearest;
}
