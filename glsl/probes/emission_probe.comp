#version 460
#extension GL_GOOGLE_include_directive : require
// Starts photon paths at given lights, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "lights/emission.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

struct Asked {
    vec4 u;      // xy: place, zw: direction
    vec4 target; // w: radius, 0: none
    uint light;
    float side;
};

struct Found {
    vec4 origin;    // w: whether the ray is known to hit the target
    vec4 direction; // w: whether it is a line without origin
    vec4 flux;
};

layout(std430) readonly buffer ProbeFrom { Asked asked[]; };
layout(std430) writeonly buffer ProbeTo { Found found[]; };

void main() {
    uint i = invocation_index();
    if (i >= push.count) {
        return;
    }
    Asked a = asked[i];
    Target target = Target(a.target.w == 0.0, a.target);
    AimedStart start = emit_from(a.light, a.u.xy, a.u.zw, a.side, target);
    found[i] = Found(vec4(start.emission.origin, start.on_target ? 1.0 : 0.0),
                     vec4(start.emission.direction, start.distant ? 1.0 : 0.0), vec4(start.emission.flux, 0.0));
}
