#version 460
#extension GL_GOOGLE_include_directive : require
// The automatic initial radius, point by point: where a gather of pilot photons found more than wanted, the radius
// shrinks until it would hold as many as wanted. Keeps caustics sharp whose photons are far denser than the scene's.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "sampling.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "radius_sums.glsl"

layout(push_constant) uniform Push {
    float wanted; // photons
} push;

uniform usamplerBuffer VisiblePoints;
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };
layout(std430) writeonly buffer RadiusSums { RadiusSum radius_sums[]; };

void main() {
    uint slot = invocation_index();
    bool counts = false;
    float radius2 = 0.0;
    if (slot < slots()) {
        counts = floatBitsToUint(TEXEL(VisiblePoints, 3u * slot).w) != NO_OBJECT;
        radius2 = statistics[slot].radius2_high;
        float found = float(floatBitsToUint(gathered[slot].flux_count.w));
        if (found > push.wanted) {
            radius2 *= push.wanted / found;
            statistics[slot].radius2_high = radius2;
        }
        gathered[slot].flux_count = vec4(0.0);
    }
    RadiusSum sum = sum_of_radii(counts, radius2);
    if (gl_LocalInvocationID.x == 0u && slot < slots()) {
        radius_sums[workgroup_index()] = sum;
    }
}
