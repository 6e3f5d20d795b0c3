#version 460
#extension GL_GOOGLE_include_directive : require
// Sums up the radii of each workgroup's visible points: the grid's cell size follows from them.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "radius_sums.glsl"

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
layout(std430) writeonly buffer RadiusSums { RadiusSum radius_sums[]; };

void main() {
    uint slot = invocation_index();
    bool counts = slot < slots() && floatBitsToUint(TEXEL(VisiblePoints, 3u * slot).w) != NO_OBJECT;
    float radius2 = counts ? TEXEL(StatisticsOf, 3u * slot).x : 0.0;
    RadiusSum sum = sum_of_radii(counts, radius2);
    if (gl_LocalInvocationID.x == 0u && slot < slots()) {
        radius_sums[workgroup_index()] = sum;
    }
}
