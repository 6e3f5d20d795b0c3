#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's photon sorting, last stage: each photon takes the next place of its mesh from an atomic counter. The order of
// photons within a mesh is undefined and differs between runs.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "gather/photon.glsl"

uniform usamplerBuffer Photons;
layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) buffer MeshEnds { uint mesh_ends[]; }; // initially each mesh's first position, finally its end
layout(std430) writeonly buffer SortedPhotons { Photon sorted_photons[]; };

void main() {
    uint i = invocation_index();
    if (i < photon_count) {
        Photon photon = PHOTON(Photons, i);
        sorted_photons[atomicAdd(mesh_ends[object_of(photon)], 1u)] = photon;
    }
}
