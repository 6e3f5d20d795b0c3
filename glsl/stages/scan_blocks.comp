#version 460
#extension GL_GOOGLE_include_directive : require
// Exclusive prefix sums, first of two stages: each workgroup scans a block of numbers in place and stores the block's sum.

layout(local_size_x = 128) in;

#include "common/invocation.glsl"
#include "layout.glsl"

const uint PER_THREAD = SCAN_BLOCK / gl_WorkGroupSize.x;

layout(push_constant) uniform CountPush {
    uint count;
} push;

layout(std430) buffer Scan { uint scan[]; };
layout(std430) writeonly buffer ScanSums { uint scan_sums[]; };

#include "common/workgroup_scan.glsl"

void main() {
    uint first = invocation_index() * PER_THREAD;
    uint values[PER_THREAD];
    uint sum = 0u;
    for (uint i = 0u; i < PER_THREAD; i++) {
        values[i] = first + i < push.count ? scan[first + i] : 0u;
        sum += values[i];
    }
    uint total;
    uint before = workgroup_exclusive_scan(sum, total);
    for (uint i = 0u; i < PER_THREAD; i++) {
        if (first + i < push.count) {
            scan[first + i] = before;
        }
        before += values[i];
    }
    if (gl_LocalInvocationID.x == 0u && first < push.count) {
        scan_sums[workgroup_index()] = total;
    }
}
