#version 460
#extension GL_GOOGLE_include_directive : require
// Radix sort, second stage of a pass: each workgroup replaces a digit's counts in the tiles by their exclusive prefix sums, and
// stores the digit's total.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "common/sort.glsl"

layout(std430) buffer Histograms { uint histograms[]; };

#include "common/workgroup_scan.glsl"

void main() {
    uint me = gl_LocalInvocationID.x;
    uint digit = workgroup_index();
    if (digit >= digits()) {
        return;
    }
    uint tiles = (sort_count + SORT_TILE - 1u) / SORT_TILE;
    uint per_thread = (tiles + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
    uint first = histogram_of(digit, min(me * per_thread, tiles));
    uint end = histogram_of(digit, min((me + 1u) * per_thread, tiles));
    uint sum = 0u;
    for (uint i = first; i < end; i++) {
        sum += histograms[i];
    }
    uint total;
    uint before = workgroup_exclusive_scan(sum, total);
    for (uint i = first; i < end; i++) {
        uint count = histograms[i];
        histograms[i] = before;
        before += count;
    }
    if (me == 0u) {
        histograms[histogram_of(digit, push.tiles)] = total;
    }
}
