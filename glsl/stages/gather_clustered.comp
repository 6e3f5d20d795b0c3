#version 460
#extension GL_GOOGLE_include_directive : require
// Gathers for clusters of neighbouring visible points: an invocation has a run of them and tests each nearby photon against all,
// so that a photon is loaded once for all tests. A run is split into several clusters only if its points lie far apart, as along
// silhouettes.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/sampling.glsl"
#include "gather/photon.glsl"
#include "gather/visible_point.glsl"
#include "gather/statistics.glsl"
#include "gather/gather.glsl"
#include "gather/grid.glsl"
#include "common/status.glsl"

// Visible points of a run: 4×2 pixels, see pixel_of. CPUs load a photon once for all of them; GPUs have caches for that, and more
// than one point takes registers that hide the latency of memory.
layout(constant_id = 1) const uint RUN = 8u;

// The part of the sorted photons that this launch tests.
layout(push_constant) uniform GatherClusteredPush {
    uint first;
    uint end;
} push;

layout(std430) readonly buffer Grid { GridShape grid; };
uniform usamplerBuffer SortedPhotons;
uniform usamplerBuffer CellStarts;

uint cell_start(uint bucket) {
    uvec4 four = TEXEL_BITS(CellStarts, bucket >> 2u);
    uvec2 two = (bucket & 2u) == 0u ? four.xy : four.zw;
    return (bucket & 1u) == 0u ? two.x : two.y;
}

void main() {
    // Neighbours in a run are neighbours in the picture; several points of a pixel lie in different runs.
    uint runs_of_map = slots() / RUN;
    uint map = invocation_index() / runs_of_map;
    uint run = invocation_index() % runs_of_map;
    uint first_slot = run / settings.slots_per_pixel * RUN * settings.slots_per_pixel + run % settings.slots_per_pixel;
    if (map >= settings.photon_maps) {
        return;
    }
    Receiver receivers[RUN];
    uvec2 shells[RUN];
    Sum sums[RUN];
    uint tested_for[RUN];
    uvec2 all_shells = uvec2(SHELLS, 0u);
    for (uint k = 0u; k < RUN; k++) {
        receivers[k] = receiver_at(first_slot + k * settings.slots_per_pixel, map);
        shells[k] = receivers[k].object == NO_OBJECT
                        ? uvec2(SHELLS, 0u)
                        : shells_of(receivers[k].position, sqrt(receivers[k].radius2));
        all_shells = uvec2(min(all_shells.x, shells[k].x), max(all_shells.y, shells[k].y));
        sums[k] = NOTHING;
        tested_for[k] = 0u;
    }
    // Expected and completed loop iterations.
    uint points = 0u;
    uint points_done = 0u;
    uint rows = 0u;
    uint rows_done = 0u;
    uint to_test = 0u;
    uint tested = 0u;
    uint shells_done = 0u;
    for (uint shell = all_shells.x; shell <= all_shells.y; shell++) {
        uint of_shell = map * SHELLS + shell;
        float inverse = grid.inverse_cell_size[of_shell];
        ivec3 lows[RUN];
        ivec3 highs[RUN];
        bool pending[RUN];
        bool any_pending = false;
        for (uint k = 0u; k < RUN; k++) {
            // A little more than R, so that rounding can't leave out the cell of a photon at distance R.
            float reach = sqrt(receivers[k].radius2) * 1.000001 + 1e-7;
            lows[k] = cell_of(receivers[k].position - reach, inverse);
            highs[k] = cell_of(receivers[k].position + reach, inverse);
            pending[k] = shells[k].x <= shell && shell <= shells[k].y;
            points += pending[k] ? 1u : 0u;
            any_pending = any_pending || pending[k];
        }
        while (any_pending) {
            // The first remaining point, and the points that extend the range of cells by at most one.
            any_pending = false;
            bool chosen = false;
            ivec3 low = ivec3(0);
            ivec3 high = ivec3(-1);
            Receiver cluster[RUN];
            for (uint k = 0u; k < RUN; k++) {
                bool leads = pending[k] && !chosen;
                ivec3 new_low = leads ? lows[k] : min(low, lows[k]);
                ivec3 new_high = leads ? highs[k] : max(high, highs[k]);
                ivec3 extent = max(high - low, highs[k] - lows[k]);
                bool joins = leads || (pending[k] && all(lessThanEqual(new_high - new_low, extent + 1)));
                low = joins ? new_low : low;
                high = joins ? new_high : high;
                cluster[k] = receivers[k];
                cluster[k].radius2 = joins ? receivers[k].radius2 : -1.0;
                chosen = chosen || leads;
                points_done += joins ? 1u : 0u;
                pending[k] = pending[k] && !joins;
                any_pending = any_pending || pending[k];
            }
            uint tested_before = tested;
            ivec3 first_row = row_of(low);
            ivec3 last_row = row_of(high);
            ivec3 extent = last_row - first_row + 1;
            rows += uint(extent.x * extent.y * extent.z);
            ivec3 row = first_row;
            bool more;
            // Loops with the test at the end: some drivers run a loop's body once more than its condition holds.
            do {
                uint bucket = bucket_of_row(row, of_shell);
                int row_begin = row.x << ROW_BITS;
                uint from = bucket + uint(max(low.x - row_begin, 0));
                uint past = bucket + uint(min(high.x + 1 - row_begin, 1 << ROW_BITS));
                uint i = max(cell_start(from), push.first);
                uint end = min(cell_start(past), push.end);
                to_test += max(end, i) - i;
                do {
                    Photon photon = PHOTON(SortedPhotons, i);
                    vec3 position = photon.position;
                    // Rows that share a bucket must be counted once.
                    bool here = i < end && row_of(cell_of(position, inverse)) == row && shell_of(position) == shell;
                    // No receiver lies on that object.
                    photon.object = here ? photon.object : NO_OBJECT - 1u;
                    for (uint k = 0u; k < RUN; k++) {
                        gather(cluster[k], photon, sums[k]);
                    }
                    tested += i < end ? 1u : 0u;
                    i += 1u;
                } while (i < end);
                rows_done += 1u;
                bool end_x = row.x == last_row.x;
                bool end_y = end_x && row.y == last_row.y;
                more = !(end_y && row.z == last_row.z);
                row = ivec3(end_x ? first_row.x : row.x + 1, end_y ? first_row.y : row.y + (end_x ? 1 : 0),
                            row.z + (end_y ? 1 : 0));
            } while (more);
            if (COUNT_TESTS) {
                for (uint k = 0u; k < RUN; k++) {
                    tested_for[k] += cluster[k].radius2 >= 0.0 ? tested - tested_before : 0u;
                }
            }
        }
        shells_done += 1u;
    }
    uint shells_wanted = all_shells.x <= all_shells.y ? all_shells.y + 1u - all_shells.x : 0u;
    // Loops that did not reach their end were cut by the driver: the gather is repeated in smaller parts.
    if (tested != to_test || rows_done != rows || points_done != points ||
        shells_done != shells_wanted) {
        atomicOr(status.retry, GATHERS_TOO_LONG);
    }
    for (uint k = 0u; k < RUN; k++) {
        if (receivers[k].object != NO_OBJECT) {
            add_gathered(first_slot + k * settings.slots_per_pixel, map, sums[k], tested_for[k]);
        }
    }
}
