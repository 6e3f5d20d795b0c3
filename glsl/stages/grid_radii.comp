#version 460
#extension GL_GOOGLE_include_directive : require
// Sums up the radii of a sample of the visible points: the grid's cell size follows from them.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "radius_sums.glsl"

layout(push_constant) uniform Push {
    uint groups;
    uint step; // every how many slots
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
layout(std430) writeonly buffer RadiusSums { RadiusSum radius_sums[]; };

void main() {
    RadiusSum term = RadiusSum(0.0, 0.0, 0u, 0u);
    uint step = push.groups * gl_WorkGroupSize.x * push.step;
    for (uint slot = invocation_index() * push.step; slot < slots(); slot += step) {
        if (floatBitsToUint(TEXEL(VisiblePoints, 3u * slot).w) != NO_OBJECT) {
            float radius2 = TEXEL(StatisticsOf, 3u * slot).x;
            term = together(term, RadiusSum(radius2, 1.0 / radius2, 1u, 0u));
        }
    }
    RadiusSum sum = reduce(term);
    if (gl_LocalInvocationID.x == 0u && workgroup_index() < push.groups) {
        radius_sums[workgroup_index()] = sum;
    }
}
