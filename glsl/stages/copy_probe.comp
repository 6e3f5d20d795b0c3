#version 460
#extension GL_GOOGLE_include_directive : require
// Copies 16 bytes per invocation: measures the memory bandwidth of a kernel.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "common/texel.glsl"

uniform usamplerBuffer ProbeFrom;
layout(std430) writeonly buffer ProbeTo { uvec4 probe_to[]; };

void main() {
    uint i = invocation_index();
    if (i < probe_to.length()) {
        probe_to[i] = TEXEL_BITS(ProbeFrom, i);
    }
}
