#version 460
#extension GL_GOOGLE_include_directive : require
// Starts photon paths on the lights. A stage of its own, because its registers would be live while `photons` traces.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "lights/emission.glsl"
#include "common/path_start.glsl"
#include "common/status.glsl"

layout(std430) writeonly buffer PathStarts { PathStart path_starts[]; };

void main() {
    uint path = invocation_index();
    if (path >= push.path_count || status.retry != 0u) {
        return;
    }
    Random random = random_of_path(path);
    uint light;
    Emission emission = emit(random, light);
    path_starts[path] = PathStart(emission.origin, emission.ignored.triangle, emission.direction, emission.inverse_range,
                                  emission.flux, light);
}
