#version 460
#extension GL_GOOGLE_include_directive : require
// The picture of one sequence: the mean of its iterations.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/sampling.glsl"
#include "gather/visible_point.glsl"
#include "common/status.glsl"

layout(push_constant) uniform ResolveSequencePush { uint iterations; } push; // of the sequence

layout(std430) readonly buffer SequenceSums { vec4 sequence_sums[]; };
layout(std430) writeonly buffer SequenceFilm { vec4 sequence_film[]; }; // row-major, from the top left; w: curvature

void main() {
    uint pixel_slot = invocation_index();
    if (pixel_slot >= region_slots()) {
        return;
    }
    uvec2 pixel;
    if (!has_pixel(pixel_slot, pixel)) {
        return;
    }
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < settings.slots_per_pixel; i++) {
        sum += sequence_sums[pixel_slot * settings.slots_per_pixel + i];
    }
    vec4 mean = sum / float(max(push.iterations, 1u));
    bool is_sound = finite(mean.rgb) && !isnan(mean.w) && !isinf(mean.w);
    sequence_film[number_on_film(pixel_slot, pixel)] = is_sound ? mean : vec4(0.0);
}
