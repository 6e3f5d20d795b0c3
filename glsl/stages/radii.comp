#version 460
#extension GL_GOOGLE_include_directive : require
// R² of each visible point's disc in this iteration, for each photon map. The first visible point of a slot sets its R. Those of
// later iterations may be nearer, along silhouettes: a disc of the surface behind would cover many pixels there, so no disc is
// larger than a multiple of the pixel's footprint.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"

uniform usamplerBuffer VisiblePoints;
layout(std430) readonly buffer Footprints { float footprints[]; };
layout(std430) buffer StatisticsOf { Statistics statistics[]; };
layout(std430) writeonly buffer Radii2 { float radii2[]; };

void main() {
    uint i = invocation_index();
    if (i >= receiver_count()) {
        return;
    }
    uint slot = i % slots();
    uint map = i / slots();
    float radius2 = statistics[i].radius2_high;
    if (VISIBLE_POINT(VisiblePoints, slot).object != NO_OBJECT) {
        float footprint = footprints[slot];
        if (radius2 == 0.0) {
            float first = settings.first_footprints[map] * footprint;
            radius2 = settings.initial_radius2 > 0.0 ? settings.initial_radius2 : max(first * first, SMALLEST_RADIUS2);
            statistics[i].radius2_high = radius2;
        }
        float most = settings.most_footprints[map] * footprint;
        radius2 = most > 0.0 ? min(radius2, max(most * most, SMALLEST_RADIUS2)) : radius2;
    }
    radii2[i] = radius2;
}
