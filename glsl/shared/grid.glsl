// A hashed uniform grid: cells of one size, as many as space needs, that share a table of 2^cell_bits buckets. Eight
// neighbouring cells (2×2×2) lie together in the table.

// Set on the device for each iteration, from the radii that the visible points have then.
struct GridShape {
    float inverse_cell_size;
};

ivec3 cell_of(vec3 position, float inverse_cell_size) {
    return ivec3(floor(position * inverse_cell_size));
}

uint bucket_of(ivec3 cell) {
    uvec3 block = uvec3(cell >> 1);
    uint hash = block.x * 0x9e3779b1u ^ block.y * 0x85ebca77u ^ block.z * 0xc2b2ae3du;
    hash ^= hash >> 15u;
    hash *= 0x2c1b3c6du;
    hash ^= hash >> 13u;
    uint corner = uint(cell.x & 1) | uint(cell.y & 1) << 1u | uint(cell.z & 1) << 2u;
    return (hash << 3u | corner) & ((1u << settings.cell_bits) - 1u);
}
