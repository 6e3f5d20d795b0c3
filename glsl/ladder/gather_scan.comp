#version 460
#extension GL_GOOGLE_include_directive : require
// Gathers by testing photons one after the other: all of them (the paper's naive hitpoint illumination), or those of the
// visible point's mesh.

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

void main() {
    uint slot = slot_at(gl_LocalInvocationID.x);
    if (push.first >= photon_count || slot == NO_SLOT) {
        return;
    }
    Receiver receiver = receiver_at(slot, push.map);
    uvec2 range = photons_to_test(receiver.object);
    float radius = sqrt(receiver.radius2);
    Sum sum = NOTHING;
    for (uint i = range.x; i < range.y; i++) {
        test(receiver, radius, PHOTON(GatheredFrom, i), sum);
    }
    add_gathered(slot, push.map, sum, range.y - range.x);
}
