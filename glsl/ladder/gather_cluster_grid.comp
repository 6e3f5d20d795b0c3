#version 460
#extension GL_GOOGLE_include_directive : require
// Gathers from the cells of an object's grid that a cluster of visible points reaches: a workgroup's points have one
// object and lie close together, so all its invocations test the same photons.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/sampling.glsl"
#include "gather/photon.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "gather/gather.glsl"
#include "ladder/point_groups.glsl"
#include "trace/object_grid.glsl"
#include "common/status.glsl"

// The part of the sorted photons that this launch tests.
layout(push_constant) uniform ClusterGridPush {
    uint first;
    uint end;
    uint groups; // of visible points
    uint factor; // see group_of_workgroup
    uint map;    // of photons
} push;

layout(std430) readonly buffer ObjectCells { uint cell_starts[]; };
uniform usamplerBuffer SortedPhotons;

shared vec3 lows[gl_WorkGroupSize.x];
shared vec3 highs[gl_WorkGroupSize.x];

void main() {
    uint me = gl_LocalInvocationID.x;
    uint group = group_of_workgroup(push.groups, push.factor);
    uint slot = group == NO_SLOT ? NO_SLOT : point_order[group * gl_WorkGroupSize.x + me];
    Receiver receiver = no_receiver();
    if (slot != NO_SLOT) {
        receiver = receiver_at(slot, push.map);
    }
    bool filler = receiver.object == NO_OBJECT;
    // A little more than R, so that rounding can't leave out the cell of a photon at distance R.
    float reach = sqrt(max(receiver.radius2, 0.0)) * 1.000001 + 1e-7;
    lows[me] = filler ? vec3(1e30) : receiver.position - reach;
    highs[me] = filler ? vec3(-1e30) : receiver.position + reach;
    for (uint half_size = gl_WorkGroupSize.x / 2u; half_size > 0u; half_size /= 2u) {
        barrier();
        if (me < half_size) {
            lows[me] = min(lows[me], lows[me + half_size]);
            highs[me] = max(highs[me], highs[me + half_size]);
        }
    }
    barrier();
    if (filler) {
        return;
    }
    ObjectGrid grid = object_grid(receiver.object & ~CAUSTIC);
    uvec3 low = cell_in(grid, lows[0]);
    uvec3 high = cell_in(grid, highs[0]);
    Sum sum = NOTHING;
    uint to_test = 0u;
    uint tested = 0u;
    uint rows = 0u;
    for (uint z = low.z; z <= high.z; z++) {
        for (uint y = low.y; y <= high.y; y++) {
            // Cells along x follow each other, and so do their photons.
            uint first = max(cell_starts[cell_number(grid, uvec3(low.x, y, z))], push.first);
            uint end = min(cell_starts[cell_number(grid, uvec3(high.x, y, z)) + 1u], push.end);
            to_test += max(end, first) - first;
            rows += 1u;
            for (uint i = first; i < end; i++) {
                Photon photon = PHOTON(SortedPhotons, i);
                tested += 1u;
                gather(receiver, photon, sum);
            }
        }
    }
    // Loops that did not reach their end were cut by the driver: the gather is repeated in smaller parts.
    if (tested != to_test || rows != (high.y - low.y + 1u) * (high.z - low.z + 1u)) {
        atomicOr(status.retry, GATHERS_TOO_LONG);
    }
    add_gathered(slot, push.map, sum, tested);
}
