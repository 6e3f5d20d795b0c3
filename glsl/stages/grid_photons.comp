#version 460
#extension GL_GOOGLE_include_directive : require
// Orders the photons by bucket; within a bucket they keep their order.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "gather/photon.glsl"

layout(std430) readonly buffer ValuesIn { uint values[]; };
uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) writeonly buffer SortedPhotons { Photon sorted_photons[]; };

void main() {
    uint i = invocation_index();
    if (i < photon_count) {
        sorted_photons[i] = PHOTON(Photons, values[i]);
    }
}
