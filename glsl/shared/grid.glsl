// A hashed uniform grid: cells of one size, as many as space needs, that share a table of 2^cell_bits buckets. A block of
// 16×4×4 cells lies together in the table and each of its rows of 16 cells along x is contiguous, so that the photons of
// neighbouring cells of a row are one range of the sorted photons.

// Set on the device for each iteration, from the radii that the visible points have then.
struct GridShape {
    float inverse_cell_size;
};

const uint ROW_BITS = 4u;  // log2 of a row's cells
const uint SIDE_BITS = 2u; // log2 of a block's rows along y, and along z

ivec3 cell_of(vec3 position, float inverse_cell_size) {
    return ivec3(floor(position * inverse_cell_size));
}

// The row of a cell: its x counts rows.
ivec3 row_of(ivec3 cell) {
    return ivec3(cell.x >> ROW_BITS, cell.yz);
}

// The bucket of a row's first cell.
uint bucket_of_row(ivec3 row) {
    uvec3 block = uvec3(row.x, row.yz >> SIDE_BITS);
    uint hash = block.x * 0x9e3779b1u ^ block.y * 0x85ebca77u ^ block.z * 0xc2b2ae3du;
    hash ^= hash >> 15u;
    hash *= 0x2c1b3c6du;
    hash ^= hash >> 13u;
    uvec2 inside = uvec2(row.yz) & ((1u << SIDE_BITS) - 1u);
    uint number = (hash << SIDE_BITS | inside.y) << SIDE_BITS | inside.x;
    return number << ROW_BITS & ((1u << settings.cell_bits) - 1u);
}

uint bucket_of(ivec3 cell) {
    return bucket_of_row(row_of(cell)) | uint(cell.x) & ((1u << ROW_BITS) - 1u);
}
