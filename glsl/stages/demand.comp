#version 460
#extension GL_GOOGLE_include_directive : require
// The demand of each visible point for photons, added to the cells that its disc reaches: the squared relative error that a
// photon of flux 1 would cause in its pixel, times the number of visible points that such a photon reaches, up to a constant. A
// pixel with mostly direct light has a low demand; in an empty cell, no visible point can accept a photon. Pixels that aren't
// guides add the least demand: their photons are kept, but nothing is learned from these.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/sampling.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "gather/grid.glsl"
#include "gather/demand.glsl"

layout(push_constant) uniform DemandPush {
    uint iterations; // done so far
    float emitted;   // photon paths of all of them
    uint of_guides;  // 1: guides alone
} push;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer StatisticsOf;
uniform usamplerBuffer DirectSums;
layout(std430) readonly buffer CoverageOf { Coverage coverage[]; };
layout(std430) readonly buffer Footprints { float footprints[]; };
layout(std430) readonly buffer Radii2 { float radii2[]; };
layout(std430) readonly buffer Grid { GridShape grid; };
layout(std430) buffer Demand { uint demand[]; }; // float bits; cleared before

// Of the picture so far, mean of the channels.
float radiance_of(uint slot) {
    float radiance = 0.0;
    if (push.iterations > 0u) {
        radiance = mean_of(DIRECT_SUM(DirectSums, slot).high.rgb) / float(push.iterations);
        for (uint map = 0u; map < settings.photon_maps; map++) {
            uint i = map * slots() + slot;
            Statistics statistics = STATISTICS(StatisticsOf, i);
            float tau = mean_of(statistics.flux_high.rgb);
            radiance += tau / push.emitted / (PI * max(statistics.radius2_high, 1e-30) * share_of(coverage[i]));
        }
    }
    return radiance;
}

void main() {
    uint i = invocation_index();
    if (i >= receiver_count()) {
        return;
    }
    uint slot = i % slots();
    VisiblePoint point = VISIBLE_POINT(VisiblePoints, slot);
    uint object = point.object;
    float radius2 = radii2[i];
    bool guide = is_guide(slot / settings.slots_per_pixel);
    if (object == NO_OBJECT || (push.of_guides != 0u && !guide)) {
        return;
    }
    float radius = sqrt(radius2);
    float footprint = max(footprints[slot], 1e-3 * radius);
    float radiance = radiance_of(slot);
    float of_one = mean_of(VISIBLE_POINT(VisiblePoints, slot).weight) / (PI * radius2);
    float reached = PI * radius2 / (footprint * footprint);
    float demanded = of_one * of_one * reached / (radiance * radiance + settings.demand_floor2);
    uint wanted = floatBitsToUint(guide ? clamp(demanded, LEAST_DEMAND, 1e30) : LEAST_DEMAND);

    float reach = radius * 1.000001 + 1e-7;
    uvec2 shells = shells_of(point.position, radius);
    for (uint shell = shells.x; shell <= shells.y; shell++) {
        uint of_shell = i / slots() * SHELLS + shell;
        float inverse = grid.inverse_cell_size[of_shell] * (1.0 / COARSENING);
        ivec3 low = cell_of(point.position - reach, inverse);
        ivec3 high = cell_of(point.position + reach, inverse);
        for (int z = low.z; z <= high.z; z++) {
            for (int y = low.y; y <= high.y; y++) {
                for (int x = low.x; x <= high.x; x++) {
                    uint entry = demand_entry(ivec3(x, y, z), of_shell, object);
                    // Neighbours in the picture add nearly the same.
                    if (demand[entry] < wanted) {
                        atomicMax(demand[entry], wanted);
                    }
                }
            }
        }
    }
}
