#version 460
#extension GL_GOOGLE_include_directive : require
// Radix sort, last stage of a pass: moves each key to its place. A workgroup first sorts its tile by the digit, in shared memory
// and by four bits at a time, so that keys of a digit are neighbours when they are written.

layout(local_size_x = 128) in;

#include "common/invocation.glsl"
#include "common/sort.glsl"

layout(std430) readonly buffer KeysIn { uint keys_in[]; };
layout(std430) readonly buffer ValuesIn { uint values_in[]; };
layout(std430) readonly buffer Histograms { uint histograms[]; };
layout(std430) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430) writeonly buffer ValuesOut { uint values_out[]; };

#include "common/workgroup_scan.glsl"

const uint PER_THREAD = SORT_TILE / gl_WorkGroupSize.x;
const uint QUADS = 4u;      // of the values of four bits
const uint GROUP_SIZE = 8u; // threads: their items of a value fit a byte
const uint GROUPS = gl_WorkGroupSize.x / GROUP_SIZE;

// High bits: digits; low bits: the keys' places in the tile.
const uint DIGIT_SHIFT = 16u;
const uint COUNT_SHIFT = 28u;
shared uint items[SORT_TILE];
// [quad][thread], a byte for each value: first the number of items of the thread, then that of the threads before it in its
// group. With more than a byte each, shared memory would limit the number of workgroups that fit a GPU. After the sort it is
// [digit], see `find_places`.
shared uint counts[QUADS * gl_WorkGroupSize.x];
shared uint of_groups[QUADS * GROUPS];   // [quad][group], likewise: number of items of the group
shared uint starts[QUADS * 2u * GROUPS]; // [value][group], 16 bits each: place of the first item

uint byte_of(uint word, uint i) {
    return word >> i * 8u & 0xffu;
}

// Sorts the tile by four bits. Each thread has a run of consecutive items, which keeps the order of equal keys.
void split(uint mine[PER_THREAD], uint shift) {
    uint me = gl_LocalInvocationID.x;
    uint group = me / GROUP_SIZE;
    uvec4 count = uvec4(0u); // of the thread, a byte for each value: registers are faster than shared memory
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint value = bitfieldExtract(mine[i], int(shift), 4);
        uvec4 here = uvec4(equal(uvec4(value / 4u), uvec4(0u, 1u, 2u, 3u)));
        uvec4 counted = count * here;
        // The number of previous items with this value is stored above the digit: separate registers would double their number.
        mine[i] |= byte_of(counted.x | counted.y | counted.z | counted.w, value % 4u) << COUNT_SHIFT;
        count += here << value % 4u * 8u;
    }
    for (uint i = 0u; i < QUADS; i++) {
        counts[i * gl_WorkGroupSize.x + me] = count[i];
    }
    barrier();
    if (me < QUADS * GROUPS) {
        uint sum = 0u;
        for (uint i = 0u; i < GROUP_SIZE; i++) {
            uint of_thread = counts[me * GROUP_SIZE + i];
            counts[me * GROUP_SIZE + i] = sum;
            sum += of_thread;
        }
        of_groups[me] = sum;
    }
    barrier();
    // Two groups of a value for each thread.
    uint value_of_sum = 2u * me / GROUPS;
    uint first = value_of_sum / 4u * GROUPS + 2u * me % GROUPS;
    uint of_first = byte_of(of_groups[first], value_of_sum % 4u);
    uint total;
    uint before = workgroup_exclusive_scan(of_first + byte_of(of_groups[first + 1u], value_of_sum % 4u), total);
    starts[me] = before + of_first << 16u | before;
    barrier();
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint value = bitfieldExtract(mine[i], int(shift), 4);
        uint start = starts[(value * GROUPS + group) / 2u] >> group % 2u * 16u & 0xffffu;
        uint in_group = byte_of(counts[value / 4u * gl_WorkGroupSize.x + me], value % 4u);
        items[start + in_group + (mine[i] >> COUNT_SHIFT)] = mine[i] & (1u << COUNT_SHIFT) - 1u;
    }
    barrier();
}

// The place of each digit's first key of this tile among all keys.
void find_places() {
    uint digit = 2u * gl_LocalInvocationID.x;
    bool has = digit < digits();
    uint first = has ? histograms[histogram_of(digit, push.tiles)] : 0u;
    uint second = has ? histograms[histogram_of(digit + 1u, push.tiles)] : 0u;
    uint total;
    uint before = workgroup_exclusive_scan(first + second, total);
    if (has) {
        counts[digit] = before + histograms[histogram_of(digit, workgroup_index())];
        counts[digit + 1u] = before + first + histograms[histogram_of(digit + 1u, workgroup_index())];
    }
}

void main() {
    uint me = gl_LocalInvocationID.x;
    uint tile = workgroup_index() * SORT_TILE;
    // Capacity beyond the number of keys costs nothing.
    if (tile >= sort_count) {
        return;
    }
    uint keys = min(SORT_TILE, sort_count - tile);
    uint mine[PER_THREAD];
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint place = me * PER_THREAD + i;
        // Padding goes behind the keys of the last digit.
        uint digit = place < keys ? digit_of(keys_in[tile + place]) : digits() - 1u;
        mine[i] = digit << DIGIT_SHIFT | place;
    }
    split(mine, DIGIT_SHIFT);
    if (push.bits > 4u) {
        for (uint i = 0u; i < PER_THREAD; i++) {
            mine[i] = items[me * PER_THREAD + i];
        }
        split(mine, DIGIT_SHIFT + 4u);
    }
    find_places();
    barrier();
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint place = i * gl_WorkGroupSize.x + me;
        mine[i] = items[place];
        uint digit = mine[i] >> DIGIT_SHIFT;
        if (place == 0u || items[place - 1u] >> DIGIT_SHIFT != digit) {
            counts[digit] -= place; // minus the first place in the tile
        }
    }
    barrier();
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint place = i * gl_WorkGroupSize.x + me;
        if (place < keys) {
            uint from = tile + (mine[i] & (1u << DIGIT_SHIFT) - 1u);
            uint to = counts[mine[i] >> DIGIT_SHIFT] + place;
            keys_out[to] = keys_in[from];
            values_out[to] = values_in[from];
        }
    }
}
