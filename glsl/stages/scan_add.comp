#version 460
#extension GL_GOOGLE_include_directive : require
// Exclusive prefix sums, last of two stages: each workgroup sums up the blocks before its block and adds that sum to the block.
// There are few block sums: reading them repeatedly takes less time than another launch.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "layout.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

layout(std430) buffer Scan { uint scan[]; };
layout(std430) readonly buffer ScanSums { uint scan_sums[]; };
layout(std430) writeonly buffer ScanTotal { uint scan_total; };

#include "common/workgroup_scan.glsl"

void main() {
    uint me = gl_LocalInvocationID.x;
    uint block = workgroup_index();
    if (block * SCAN_BLOCK >= push.count) {
        return;
    }
    uint part = 0u;
    for (uint i = me; i < block; i += gl_WorkGroupSize.x) {
        part += scan_sums[i];
    }
    uint before;
    workgroup_exclusive_scan(part, before);
    uint end = min(block * SCAN_BLOCK + SCAN_BLOCK, push.count);
    for (uint i = block * SCAN_BLOCK + me; i < end; i += gl_WorkGroupSize.x) {
        scan[i] += before;
    }
    if (me == 0u && end == push.count) {
        scan_total = before + scan_sums[block];
    }
}
