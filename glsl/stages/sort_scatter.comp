#version 460
#extension GL_GOOGLE_include_directive : require
// Radix sort, last stage of a pass: each key goes to its place among all keys. A workgroup sorts its tile by the digit first, in
// shared memory and by four bits at a time, so that a digit's keys are neighbours when they are written.

layout(local_size_x = 128) in;

#include "invocation.glsl"
#include "sort.glsl"

layout(std430) readonly buffer KeysIn { uint keys_in[]; };
layout(std430) readonly buffer ValuesIn { uint values_in[]; };
layout(std430) readonly buffer Histograms { uint histograms[]; };
layout(std430) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430) writeonly buffer ValuesOut { uint values_out[]; };

#include "workgroup_scan.glsl"

const uint PER_THREAD = SORT_TILE / gl_WorkGroupSize.x;
const uint HALF = 8u; // of the values of four bits

// Digits above, and below them the keys' places in the tile.
const uint DIGIT_SHIFT = 16u;
shared uint items[SORT_TILE];
// [value of four bits][thread]: first how many, then where the thread's next one goes; 16 bits each, those of the values from 8 on
// above those of the first eight. With 32 bits each, more shared memory would be taken than every device has.
shared uint counts[HALF * gl_WorkGroupSize.x];
// Where each digit's keys begin among all, less where they begin in the tile.
shared uint places[MOST_DIGITS];

// Sorts the tile by four bits. Each thread has a run of it, one item after the other, which keeps the order of equal ones.
void split(uint mine[PER_THREAD], uint shift) {
    uint me = gl_LocalInvocationID.x;
    uvec4 count = uvec4(0u); // of the thread's own ones, a byte for each value: registers take less time than shared memory
    uint before_mine[PER_THREAD];
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint value = bitfieldExtract(mine[i], int(shift), 4);
        uint byte_shift = value % 4u * 8u;
        uvec4 here = uvec4(equal(uvec4(value / 4u), uvec4(0u, 1u, 2u, 3u)));
        uvec4 counted = count * here;
        before_mine[i] = (counted.x | counted.y | counted.z | counted.w) >> byte_shift & 0xffu;
        count += here << byte_shift;
    }
    for (uint i = 0u; i < HALF; i++) {
        uint low = count[i / 4u] >> i % 4u * 8u & 0xffu;
        uint high = count[i / 4u + 2u] >> i % 4u * 8u & 0xffu;
        counts[i * gl_WorkGroupSize.x + me] = high << 16u | low;
    }
    barrier();
    uint sum = 0u;
    for (uint i = 0u; i < HALF; i++) {
        sum += counts[me * HALF + i];
    }
    uint total;
    uint before = workgroup_exclusive_scan(sum, total);
    before += total << 16u; // the upper half begins where the lower one ends
    for (uint i = 0u; i < HALF; i++) {
        uint count = counts[me * HALF + i];
        counts[me * HALF + i] = before;
        before += count;
    }
    barrier();
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint value = bitfieldExtract(mine[i], int(shift), 4);
        uint at = value % HALF * gl_WorkGroupSize.x + me;
        items[(counts[at] >> value / HALF * 16u & 0xffffu) + before_mine[i]] = mine[i];
    }
    barrier();
}

// Where each digit's keys of this tile begin among all.
void find_places() {
    uint digit = 2u * gl_LocalInvocationID.x;
    bool has = digit < digits();
    uint first = has ? histograms[histogram_of(digit, push.tiles)] : 0u;
    uint second = has ? histograms[histogram_of(digit + 1u, push.tiles)] : 0u;
    uint total;
    uint before = workgroup_exclusive_scan(first + second, total);
    if (has) {
        places[digit] = before + histograms[histogram_of(digit, workgroup_index())];
        places[digit + 1u] = before + first + histograms[histogram_of(digit + 1u, workgroup_index())];
    }
}

void main() {
    uint me = gl_LocalInvocationID.x;
    uint tile = workgroup_index() * SORT_TILE;
    // Room for more keys than there are costs nothing.
    if (tile >= sort_count) {
        return;
    }
    uint keys = min(SORT_TILE, sort_count - tile);
    find_places();
    uint mine[PER_THREAD];
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint place = me * PER_THREAD + i;
        // What is no key goes behind the keys of the last digit.
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
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint place = i * gl_WorkGroupSize.x + me;
        mine[i] = items[place];
        uint digit = mine[i] >> DIGIT_SHIFT;
        if (place == 0u || items[place - 1u] >> DIGIT_SHIFT != digit) {
            places[digit] -= place;
        }
    }
    barrier();
    for (uint i = 0u; i < PER_THREAD; i++) {
        uint place = i * gl_WorkGroupSize.x + me;
        if (place < keys) {
            uint from = tile + (mine[i] & (1u << DIGIT_SHIFT) - 1u);
            uint to = places[mine[i] >> DIGIT_SHIFT] + place;
            keys_out[to] = keys_in[from];
            values_out[to] = values_in[from];
        }
    }
}
