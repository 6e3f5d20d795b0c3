#version 460
#extension GL_GOOGLE_include_directive : require
// Statistics before the first iteration.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"

layout(std430) writeonly buffer StatisticsOf { Statistics statistics[]; };
layout(std430) writeonly buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint slot = invocation_index();
    if (slot < slots()) {
        statistics[slot] = Statistics(settings.initial_radius2, 0.0, 0u, 0u, vec4(0.0), vec4(0.0));
        gathered[slot] = Gathered(vec4(0.0), 0.0, 0u, 0u, 0u);
    }
}
