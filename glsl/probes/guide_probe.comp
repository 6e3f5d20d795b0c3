#version 460
#extension GL_GOOGLE_include_directive : require
// Guides photons from matte surfaces to the view, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/sampling.glsl"
#include "lights/aim.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

struct Asked {
    vec4 position;
    vec4 normal; // w: share of directions that are aimed
    vec4 u;
};

layout(std430) readonly buffer ProbeFrom { Asked asked[]; };
layout(std430) writeonly buffer ProbeTo { vec4 found[]; }; // direction; w: weight

void main() {
    uint i = invocation_index();
    if (i >= push.count) {
        return;
    }
    Asked a = asked[i];
    vec3 direction = cosine_direction(a.normal.xyz, a.u.xy);
    float weight = guide(a.position.xyz, a.normal.xyz, a.u, a.normal.w, direction);
    found[i] = vec4(direction, weight);
}
