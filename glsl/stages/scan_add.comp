#version 460
#extension GL_GOOGLE_include_directive : require
// Exclusive prefix sums, last of three stages: adds to each block what lies before it.

layout(local_size_x = 128) in;

#include "invocation.glsl"

const uint BLOCK = 2048u;

layout(push_constant) uniform Push {
    uint count;
} push;

layout(std430) buffer Scan { uint scan[]; };
layout(std430) readonly buffer ScanSums { uint scan_sums[]; };

void main() {
    uint i = invocation_index();
    if (i < push.count) {
        scan[i] += scan_sums[i / BLOCK];
    }
}
