#version 460
#extension GL_GOOGLE_include_directive : require
// Samples lights that are no surfaces, and the environment, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "lights/environment.glsl"
#include "lights/light.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

struct Asked {
    vec4 point; // w: bits of the light's index
    vec4 direction;
    vec4 u;
};

struct Found {
    vec4 ray;        // w: where it ends
    vec4 irradiance; // w: whether the light is one of those
    vec4 sampled;    // direction to the environment; w: density
    vec4 radiance;   // from there
    vec4 seen;       // radiance from the given direction; w: its density
};

layout(std430) readonly buffer ProbeFrom { Asked asked[]; };
layout(std430) writeonly buffer ProbeTo { Found found[]; };

void main() {
    uint i = invocation_index();
    if (i >= push.count) {
        return;
    }
    Asked a = asked[i];
    Light light = light_at(floatBitsToUint(a.point.w));
    Found f;
    f.ray = vec4(0.0);
    f.irradiance = vec4(0.0);
    if (is_punctual(light.kind)) {
        Arriving arriving = arriving_from(light, a.point.xyz, a.u.xy);
        f.ray = vec4(arriving.ray, arriving.end);
        f.irradiance = vec4(arriving.irradiance, 1.0);
    }
    vec3 direction;
    EnvironmentSample sky = sample_environment(a.u.zw, direction);
    f.sampled = vec4(direction, sky.density);
    f.radiance = vec4(sky.radiance, 0.0);
    EnvironmentSample seen = environment_at(a.direction.xyz);
    f.seen = vec4(seen.radiance, seen.density);
    found[i] = f;
}
