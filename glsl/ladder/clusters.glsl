// k-means clusters of visible points. Points lie in MeshOrder along a curve, in runs of a workgroup's size that have one
// mesh each; there is a cluster for each run, and a point may belong to the clusters of its own and the nearest runs.

#include "layout.glsl"

const uint WINDOW = 4u; // runs on either side

layout(push_constant) uniform ClustersPush {
    uint runs;
} push;

// First and end of the runs whose points may join a run's cluster.
uvec2 window_of(uint run) {
    return uvec2(run - min(run, WINDOW), min(run + WINDOW + 1u, push.runs));
}
