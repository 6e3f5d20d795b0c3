#version 460
#extension GL_GOOGLE_include_directive : require
// Gathers from blocks of photons that a workgroup stages through its shared memory (the paper's local memory).

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
#include "ladder/exhaustive.glsl"

uniform usamplerBuffer GatheredFrom;

shared Photon block[gl_WorkGroupSize.x];
shared uint receivers; // visible points of the workgroup

void main() {
    uint me = gl_LocalInvocationID.x;
    uint slot = slot_at(me);
    Receiver receiver = no_receiver();
    if (slot != NO_SLOT) {
        receiver = receiver_at(slot, push.map);
    }
    if (me == 0u) {
        receivers = 0u;
    }
    barrier();
    if (receiver.object != NO_OBJECT) {
        atomicAdd(receivers, 1u);
    }
    barrier();
    // The whole workgroup stages the same photons: all, or those of its mesh, which is that of its first visible point.
    uint object = 0u;
    if (BY_MESH) {
        uint first_slot = slot_at(0u);
        object = first_slot == NO_SLOT ? NO_OBJECT : VISIBLE_POINT(VisiblePoints, first_slot).object;
    }
    uvec2 range = receivers > 0u ? photons_to_test(object) : uvec2(0u);
    float radius = sqrt(max(receiver.radius2, 0.0));
    Sum sum = NOTHING;
    for (uint first = range.x; first < range.y; first += gl_WorkGroupSize.x) {
        if (first + me < range.y) {
            block[me] = PHOTON(GatheredFrom, first + me);
        }
        barrier();
        uint count = min(range.y - first, gl_WorkGroupSize.x);
        for (uint i = 0u; i < count; i++) {
            test(receiver, radius, block[i], sum);
        }
        barrier();
    }
    if (receiver.object != NO_OBJECT) {
        add_gathered(slot, push.map, sum, range.y - range.x);
    }
}
