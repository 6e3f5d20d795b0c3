// A stable radix sort of up to 8 bits a pass. A pass counts the digits of each tile (`sort_count`), sums up each digit's counts over
// the tiles (`sort_rows`) and puts each key into its place (`sort_scatter`).

#include "layout.glsl"

const uint MOST_DIGITS = 256u;

layout(push_constant) uniform Push {
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

// Where a digit's count of a tile is, and past the last tile that of all.
uint histogram_of(uint digit, uint tile) {
    return digit * (push.tiles + 1u) + tile;
}
