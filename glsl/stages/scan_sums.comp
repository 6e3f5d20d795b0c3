#version 460
#extension GL_GOOGLE_include_directive : require
// Exclusive prefix sums, second of three stages: one workgroup scans the blocks' sums, however many, in place.

layout(local_size_x = 128) in;

layout(push_constant) uniform Push {
    uint count;
} push;

layout(std430) buffer ScanSums { uint scan_sums[]; };
layout(std430) writeonly buffer ScanTotal { uint scan_total; };

#include "workgroup_scan.glsl"

void main() {
    uint before = 0u;
    for (uint first = 0u; first < push.count; first += gl_WorkGroupSize.x) {
        uint i = first + gl_LocalInvocationID.x;
        uint value = i < push.count ? scan_sums[i] : 0u;
        uint total;
        uint prefix = workgroup_exclusive_scan(value, total);
        if (i < push.count) {
            scan_sums[i] = before + prefix;
        }
        before += total;
    }
    if (gl_LocalInvocationID.x == 0u) {
        scan_total = before;
    }
}
