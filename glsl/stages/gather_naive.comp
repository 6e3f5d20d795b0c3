#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's naive hitpoint illumination: every visible point against every photon of a range (one dispatch a range,
// since drivers cut long loops).

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "sampling.glsl"
#include "photon.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "gather.glsl"

layout(push_constant) uniform Push {
    uint first; // photon
    uint last;
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint slot = invocation_index();
    if (slot >= slots()) {
        return;
    }
    Receiver receiver = receiver_of(VISIBLE_POINT(slot), TEXEL(StatisticsOf, 3u * slot).x);
    if (receiver.object == NO_OBJECT) {
        return;
    }
    vec3 flux = vec3(0.0);
    uint count = 0u;
    for (uint i = push.first; i < min(push.last, photon_count); i++) {
        Photon photon = PHOTON(Photons, i);
        if (accepts(receiver, photon)) {
            flux += photon.flux_direction.rgb;
            count += 1u;
        }
    }
    vec4 before = gathered[slot].flux_count;
    gathered[slot].flux_count = vec4(before.rgb + flux, uintBitsToFloat(floatBitsToUint(before.w) + count));
}
