#version 460
#extension GL_GOOGLE_include_directive : require
// Ordering of visible points, last stage: moves them to their places, after the fillers of the previous meshes.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"

layout(push_constant) uniform MeshesPush {
    uint meshes;
} push;

layout(std430) readonly buffer KeysIn { uint keys[]; };
layout(std430) readonly buffer ValuesIn { uint values[]; };
layout(std430) readonly buffer MeshFillers { uint fillers_before[]; };
layout(std430) writeonly buffer OrderOut { uint order[]; }; // filled with NO_SLOT before

void main() {
    uint i = invocation_index();
    if (i < slots() && keys[i] < push.meshes) {
        order[i + fillers_before[keys[i]]] = values[i];
    }
}
