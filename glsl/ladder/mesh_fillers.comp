#version 460
#extension GL_GOOGLE_include_directive : require
// The paper's filler hitpoints: the number that each mesh needs to fill its last workgroup.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"

layout(push_constant) uniform MeshFillersPush {
    uint meshes;
    uint group; // visible points of a workgroup
} push;

layout(std430) buffer MeshFillers { uint mesh_fillers[]; }; // before: visible points of each mesh

void main() {
    uint mesh = invocation_index();
    if (mesh < push.meshes) {
        uint points = mesh_fillers[mesh];
        mesh_fillers[mesh] = (push.group - points % push.group) % push.group;
    }
}
