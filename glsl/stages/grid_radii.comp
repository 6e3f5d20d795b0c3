#version 460
#extension GL_GOOGLE_include_directive : require
// The size of discs in each shell of each photon map, from which the cell sizes of the grids follow.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "gather/grid.glsl"

layout(push_constant) uniform GridRadiiPush {
    uint step; // the mean is over every step-th slot of guides
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer Radii2;
layout(std430) buffer RadiiOfShells { ShellRadii radii_of_shells[]; }; // cleared before

void main() {
    uint i = invocation_index();
    if (i >= receiver_count()) {
        return;
    }
    uint slot = i % slots();
    VisiblePoint point = VISIBLE_POINT(VisiblePoints, slot);
    if (point.object == NO_OBJECT || !is_guide(slot / settings.slots_per_pixel)) {
        return;
    }
    float radius2 = TEXEL(Radii2, i >> 2u)[i & 3u];
    uint first_shell = i / slots() * SHELLS;
    uvec2 shells = shells_of(point.position, sqrt(radius2));
    for (uint shell = first_shell + shells.x; shell <= first_shell + shells.y; shell++) {
        if (floatBitsToUint(radius2) > radii_of_shells[shell].largest) {
            atomicMax(radii_of_shells[shell].largest, floatBitsToUint(radius2));
        }
    }
    if (i % push.step == 0u) {
        uint shell = first_shell + shell_of(point.position);
        atomicAdd(radii_of_shells[shell].logs, radius_log(radius2));
        atomicAdd(radii_of_shells[shell].count, 1u);
    }
}
