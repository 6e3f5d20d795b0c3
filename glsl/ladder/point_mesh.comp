#version 460
#extension GL_GOOGLE_include_directive : require
// Ordering of visible points: keys are their meshes; counts the points of each mesh.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"

// Whether the points are ordered already; equal keys keep that order.
layout(constant_id = 0) const bool PRESORTED = false;

layout(push_constant) uniform MeshesPush {
    uint meshes;
} push;

uniform usamplerBuffer VisiblePoints;
layout(std430) writeonly buffer KeysOut { uint keys[]; };
layout(std430) buffer ValuesOut { uint values[]; };
layout(std430) buffer MeshFillers { uint mesh_points[]; }; // cleared before
layout(std430) writeonly buffer PointCount { uint point_count; };

void main() {
    uint i = invocation_index();
    if (i >= slots()) {
        return;
    }
    if (i == 0u) {
        point_count = slots();
    }
    uint slot = PRESORTED ? values[i] : i;
    uint object = VISIBLE_POINT(VisiblePoints, slot).object;
    // Slots without a visible point come last.
    keys[i] = min(object, push.meshes);
    values[i] = slot;
    if (object != NO_OBJECT) {
        atomicAdd(mesh_points[object], 1u);
    }
}
