#version 460
#extension GL_GOOGLE_include_directive : require
// Clears the statistics before the first iteration. `radii` sets the R of each slot.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"

layout(std430) writeonly buffer StatisticsOf { Statistics statistics[]; };
layout(std430) writeonly buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint i = invocation_index();
    if (i < receiver_count()) {
        statistics[i] = Statistics(0.0, 0.0, 0u, 0u, vec4(0.0), vec4(0.0));
        gathered[i] = Gathered(vec3(0.0), 0u, 0.0, 0u, 0u, 0u);
    }
}
