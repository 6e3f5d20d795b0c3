// Sobol' points in four dimensions with Owen's scrambling: Burley, «Practical Hash-based Owen Scrambling», JCGT 10(1),
// 2020. Words have their bits reversed, the highest digit lowest, where that saves reversals.

// The columns of the generator matrices for one digit of the index: Joe and Kuo, «Constructing Sobol sequences with better
// two-dimensional projections», 2008. The first dimension's is the unit matrix.
uvec3 column(uint index, int digit, uvec3 reversed) {
    return reversed & uvec3(bitfieldExtract(int(index), digit, 1));
}

uvec3 sobol_reversed(uint index) {
    uvec3 p = uvec3(0u);
    p ^= column(index,  0, uvec3(0x00000001u, 0x00000001u, 0x00000001u));
    p ^= column(index,  1, uvec3(0x00000003u, 0x00000003u, 0x00000003u));
    p ^= column(index,  2, uvec3(0x00000005u, 0x00000006u, 0x00000004u));
    p ^= column(index,  3, uvec3(0x0000000fu, 0x00000009u, 0x0000000au));
    p ^= column(index,  4, uvec3(0x00000011u, 0x00000017u, 0x0000001fu));
    p ^= column(index,  5, uvec3(0x00000033u, 0x0000003au, 0x0000002eu));
    p ^= column(index,  6, uvec3(0x00000055u, 0x00000071u, 0x00000045u));
    p ^= column(index,  7, uvec3(0x000000ffu, 0x000000a3u, 0x000000c9u));
    p ^= column(index,  8, uvec3(0x00000101u, 0x00000116u, 0x0000011bu));
    p ^= column(index,  9, uvec3(0x00000303u, 0x00000339u, 0x000002a4u));
    p ^= column(index, 10, uvec3(0x00000505u, 0x00000677u, 0x0000079au));
    p ^= column(index, 11, uvec3(0x00000f0fu, 0x000009aau, 0x00000b67u));
    p ^= column(index, 12, uvec3(0x00001111u, 0x00001601u, 0x0000101eu));
    p ^= column(index, 13, uvec3(0x00003333u, 0x00003903u, 0x0000302du));
    p ^= column(index, 14, uvec3(0x00005555u, 0x00007706u, 0x00004041u));
    p ^= column(index, 15, uvec3(0x0000ffffu, 0x0000aa09u, 0x0000a0c3u));
    p ^= column(index, 16, uvec3(0x00010001u, 0x00010117u, 0x0001f104u));
    p ^= column(index, 17, uvec3(0x00030003u, 0x0003033au, 0x0002e28au));
    p ^= column(index, 18, uvec3(0x00050005u, 0x00060671u, 0x000457dfu));
    p ^= column(index, 19, uvec3(0x000f000fu, 0x000909a3u, 0x000c9baeu));
    p ^= column(index, 20, uvec3(0x00110011u, 0x00171616u, 0x0011a105u));
    p ^= column(index, 21, uvec3(0x00330033u, 0x003a3939u, 0x002a7289u));
    p ^= column(index, 22, uvec3(0x00550055u, 0x00717777u, 0x0079e7dbu));
    p ^= column(index, 23, uvec3(0x00ff00ffu, 0x00a3aaaau, 0x00b6dba4u));
    p ^= column(index, 24, uvec3(0x01010101u, 0x01170001u, 0x0100011au));
    p ^= column(index, 25, uvec3(0x03030303u, 0x033a0003u, 0x030002a7u));
    p ^= column(index, 26, uvec3(0x05050505u, 0x06710006u, 0x0400079eu));
    p ^= column(index, 27, uvec3(0x0f0f0f0fu, 0x09a30009u, 0x0a000b6du));
    p ^= column(index, 28, uvec3(0x11111111u, 0x16160017u, 0x1f001001u));
    p ^= column(index, 29, uvec3(0x33333333u, 0x3939003au, 0x2e003003u));
    p ^= column(index, 30, uvec3(0x55555555u, 0x77770071u, 0x45004004u));
    p ^= column(index, 31, uvec3(0xffffffffu, 0xaaaa00a3u, 0xc900a00au));
    return p;
}

// Each bit is flipped or not, depending on the bits below it: for reversed words this is Owen's scrambling. The hash is that of
// Laine and Karras with Vegdahl's constants.
uvec4 scramble_reversed(uvec4 p, uvec4 seed) {
    p ^= p * 0x3d20adeau;
    p += seed;
    p *= seed >> 16u | 1u;
    p ^= p * 0x05526c56u;
    p ^= p * 0x53a22864u;
    return p;
}

// A point of a sequence: `seed` is that of the sequence's four dimensions. The index is scrambled as well, so that sets of four
// dimensions with different seeds are independent, while each remains a low-discrepancy sequence.
uvec4 sobol_point(uint index, uvec4 seed) {
    uint order = seed.x ^ (seed.y << 16u | seed.y >> 16u);
    uint shuffled = bitfieldReverse(scramble_reversed(uvec4(bitfieldReverse(index)), uvec4(order)).x);
    return bitfieldReverse(scramble_reversed(uvec4(shuffled, sobol_reversed(shuffled)), seed));
}
