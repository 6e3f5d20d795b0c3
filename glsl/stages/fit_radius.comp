#version 460
#extension GL_GOOGLE_include_directive : require
// The automatic initial radius, point by point: where a gather of pilot photons found more than wanted, the radius shrinks until
// it would contain the wanted number. Keeps caustics sharp whose photon density is far above that of the scene.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"

layout(push_constant) uniform FitRadiusPush {
    vec2 wanted; // number of photons of each map
    float least; // lower bound of R, in footprints
} push;

layout(std430) readonly buffer Footprints { float footprints[]; };
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint i = invocation_index();
    if (i >= receiver_count()) {
        return;
    }
    float found = float(gathered[i].count);
    float wanted = push.wanted[i / slots()];
    if (found > wanted) {
        float least = push.least * footprints[i % slots()];
        float radius2 = statistics[i].radius2_high;
        statistics[i].radius2_high = max(radius2 * (wanted / found), min(radius2, least * least));
    }
    gathered[i] = Gathered(vec3(0.0), 0u, 0.0, 0u, 0u, 0u);
}
