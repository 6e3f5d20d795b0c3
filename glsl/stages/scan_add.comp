#version 460
// Exclusive prefix sums, last of three stages: adds to each block what lies before it.

layout(local_size_x = 128) in;

const uint BLOCK = 2048u;

layout(push_constant) uniform Push {
    uint count;
} push;

layout(std430) buffer Scan { uint scan[]; };
layout(std430) readonly buffer ScanSums { uint scan_sums[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count) {
        scan[i] += scan_sums[i / BLOCK];
    }
}
