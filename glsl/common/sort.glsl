// A stable radix sort with up to 8 bits per pass. A pass counts the digits of each tile (`sort_count`), computes prefix sums of
// each digit's counts over the tiles (`sort_rows`) and moves each key to its place (`sort_scatter`).

#include "layout.glsl"

const uint MOST_DIGITS = 256u;

layout(push_constant) uniform SortPush {
    uint shift;
    uint bits; // of a digit
    uint tiles;
} push;

layout(std430) readonly buffer SortCount { uint sort_count; };

uint digit_of(uint key) {
    return bitfieldExtract(key, int(push.shift), int(push.bits));
}

uint digits() {
    return 1u << push.bits;
}

// Index of a digit's count in a tile; behind the last tile, of its total.
uint histogram_of(uint digit, uint tile) {
    return digit * (push.tiles + 1u) + tile;
}
