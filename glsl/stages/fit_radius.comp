#version 460
#extension GL_GOOGLE_include_directive : require
// The automatic initial radius, point by point: where a gather of pilot photons found more than wanted, the radius
// shrinks until it would hold as many as wanted. Keeps caustics sharp whose photons are far denser than the scene's.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"

layout(push_constant) uniform Push {
    float wanted; // photons
} push;

layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint slot = invocation_index();
    if (slot >= slots()) {
        return;
    }
    float found = float(floatBitsToUint(gathered[slot].flux_count.w));
    if (found > push.wanted) {
        statistics[slot].radius2_high *= push.wanted / found;
    }
    gathered[slot] = Gathered(vec4(0.0), 0.0, 0u, 0u, 0u);
}
