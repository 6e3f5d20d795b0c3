#version 460
#extension GL_GOOGLE_include_directive : require
// Starts photon paths on the lights. Apart from `photons`, which would need its registers while it traces.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "sampling.glsl"
#include "gloss.glsl"
#include "random.glsl"
#include "texel.glsl"
#include "scene.glsl"
#include "texture.glsl"
#include "bsdf.glsl"
#include "media.glsl"
#include "environment.glsl"
#include "light.glsl"
#include "emission.glsl"
#include "path_start.glsl"
#include "status.glsl"

layout(std430) writeonly buffer PathStarts { PathStart path_starts[]; };

void main() {
    uint path = invocation_index();
    if (path >= push.path_count || status.again != 0u) {
        return;
    }
    Random random = random_of_path(path);
    uint light;
    Emission emission = emit(random, light);
    path_starts[path] = PathStart(emission.origin, emission.ignored.triangle, emission.direction, emission.inverse_range,
                                  emission.flux, light);
}
