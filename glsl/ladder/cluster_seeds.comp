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
layout(std430) writeonly buffer Centroids { vec4 centroids[]; }; // w: uint bits, mesh; NO_OBJECT for an empty run

void main() {
    uint run = invocation_index();
    if (run >= push.runs) {
        return;
    }
    vec4 first = vec4(0.0, 0.0, 0.0, uintBitsToFloat(NO_OBJECT));
    vec3 offset = vec3(0.0); // from the first point: a sum of positions would cancel
    uint count = 0u;
    for (uint i = run * GROUP; i < (run + 1u) * GROUP; i++) {
        uint slot = mesh_order[i];
        if (slot != NO_SLOT) {
            vec4 position = VISIBLE_POINT(VisiblePoints, slot).position_object;
            first = count == 0u ? position : first;
            offset += position.xyz - first.xyz;
            count += 1u;
        }
    }
    centroids[run] = vec4(first.xyz + offset / float(max(count, 1u)), first.w);
}
