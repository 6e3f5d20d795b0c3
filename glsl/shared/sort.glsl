// A stable radix sort of 5 bits a pass. A workgroup sorts a tile; each of its threads a run of the tile, one key after
// the other, which is what keeps the order of equal keys.

const uint DIGITS = 32u;
const uint KEYS_PER_THREAD = 16u;
const uint TILE_KEYS = KEYS_PER_THREAD * gl_WorkGroupSize.x;

layout(std430) readonly buffer SortCount { uint sort_count; };

uint digit_of(uint key, uint shift) {
    return key >> shift & (DIGITS - 1u);
}
