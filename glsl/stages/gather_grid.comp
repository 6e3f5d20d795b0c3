#version 460
#extension GL_GOOGLE_include_directive : require
// Gathers from the cells of the hashed grid that a visible point's radius reaches.

layout(local_size_x = 64) in;

#include "invocation.glsl"
#include "settings.glsl"
#include "texel.glsl"
#include "sampling.glsl"
#include "photon.glsl"
#include "visible_point.glsl"
#include "statistics.glsl"
#include "gather.glsl"

#include "grid.glsl"
#include "status.glsl"

// The part of the sorted photons that this launch looks at.
layout(push_constant) uniform Push {
    uint first;
    uint end;
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
layout(std430) readonly buffer Grid { GridShape grid; };
uniform usamplerBuffer SortedPhotons;
uniform usamplerBuffer CellRanges;
layout(std430) buffer GatheredOf { Gathered gathered[]; };

void main() {
    uint slot = invocation_index();
    if (slot >= slots()) {
        return;
    }
    Receiver receiver = receiver_of(VISIBLE_POINT(slot), TEXEL(StatisticsOf, 3u * slot).x);
    if (receiver.object == NO_OBJECT) {
        return;
    }
    // A little more than R, so that rounding can't leave out the cell of a photon at distance R.
    float reach = sqrt(receiver.radius2) * 1.000001 + 1e-7;
    float inverse = grid.inverse_cell_size;
    ivec3 low = cell_of(receiver.position - reach, inverse);
    ivec3 high = cell_of(receiver.position + reach, inverse);
    vec3 flux = vec3(0.0);
    uint count = 0u;
    uint to_test = 0u;
    uint tested = 0u;
    uint cells = 0u;
    for (int z = low.z; z <= high.z; z++) {
        for (int y = low.y; y <= high.y; y++) {
            for (int x = low.x; x <= high.x; x++) {
                ivec3 cell = ivec3(x, y, z);
                uvec4 range = TEXEL_BITS(CellRanges, bucket_of(cell));
                uint first = max(range.x, push.first);
                uint end = min(range.y, push.end);
                to_test += max(end, first) - first;
                cells += 1u;
                for (uint i = first; i < end; i++) {
                    Photon photon = PHOTON(SortedPhotons, i);
                    tested += 1u;
                    // Cells that share a bucket must not be counted twice.
                    if (accepts(receiver, photon) && cell_of(photon.position_object.xyz, inverse) == cell) {
                        flux += photon.flux_direction.rgb;
                        count += 1u;
                    }
                }
            }
        }
    }
    // Loops that didn't reach their end were cut by the driver: the gather is done again in smaller parts.
    ivec3 extent = high - low + 1;
    if (tested != to_test || cells != uint(extent.x * extent.y * extent.z)) {
        atomicOr(status.again, GATHERS_TOO_LONG);
    }
    vec4 before = gathered[slot].flux_count;
    gathered[slot].flux_count = vec4(before.rgb + flux, uintBitsToFloat(floatBitsToUint(before.w) + count));
}
