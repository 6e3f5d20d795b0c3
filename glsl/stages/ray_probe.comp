#version 460
#extension GL_GOOGLE_include_directive : require
// Traces given rays and returns their hits, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "trace/intersect.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

layout(std430) readonly buffer ProbeFrom { vec4 rays[]; };  // origin, direction; w: unused
layout(std430) writeonly buffer ProbeTo { vec4 hits[]; };   // t, u, v, uint bits of the object or MISS

void main() {
    uint i = invocation_index();
    if (i < push.count) {
        Hit hit = trace(rays[2u * i].xyz, rays[2u * i + 1u].xyz, 1e30, NO_TRIANGLE, false);
        uint object = MISS;
        if (hit.triangle != MISS && !loops_cut) {
            object = surface_at(hit).object;
        }
        hits[i] = vec4(hit.t, hit.u, hit.v, uintBitsToFloat(object));
    }
}
