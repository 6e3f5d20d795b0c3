#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's photon sorting, first stage: counts the photons on each mesh.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "gather/photon.glsl"

uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) buffer MeshEnds { uint mesh_ends[]; }; // cleared before

void main() {
    uint i = invocation_index();
    if (i < photon_count) {
        atomicAdd(mesh_ends[object_of(PHOTON(Photons, i))], 1u);
    }
}
