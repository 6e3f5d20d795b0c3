// Hashed uniform grids: unbounded grids of cells of one size that share a table of 2^cell_bits buckets. A block of 16×4×4 cells
// is contiguous in the table, and so is each of its rows of 16 cells along x, so that the photons of neighbouring cells of a row
// are one range of the sorted photons. Radii grow with the distance from the camera, like footprints. So space is divided into
// shells around the camera, each four times as large as the one inside, and each shell of each photon map has a grid with its own
// cell size. Include after settings.glsl.

// The shell at a squared distance from the camera. Render space is 2 wide: distances above 4 are in the outermost shell.
uint shell_at(float distance2) {
    int exponent = int(floatBitsToUint(distance2) >> 23u) - 127;
    return uint(clamp((exponent + 28) >> 2, 0, int(SHELLS) - 1));
}

uint shell_of(vec3 position) {
    precise vec3 d = position - settings.camera_position.xyz;
    precise float distance2 = d.x * d.x + d.y * d.y + d.z * d.z;
    return shell_at(distance2);
}

// The first and the last shell that a ball reaches.
uvec2 shells_of(vec3 position, float radius) {
    float distance = length(position - settings.camera_position.xyz);
    float slack = 1e-6 * (distance + radius); // more than the rounding of both ends
    float nearest = max(distance - radius - slack, 0.0);
    float farthest = distance + radius + slack;
    return uvec2(shell_at(nearest * nearest), shell_at(farthest * farthest));
}

const uint ROW_BITS = 4u;  // log2 of a row's cells
const uint SIDE_BITS = 2u; // log2 of a block's rows along y, and along z

ivec3 cell_of(vec3 position, float inverse_cell_size) {
    return ivec3(floor(position * inverse_cell_size));
}

// The row of a cell: its x counts rows.
ivec3 row_of(ivec3 cell) {
    return ivec3(cell.x >> ROW_BITS, cell.yz);
}

// The bucket of the first cell of a row of a grid, which is map · SHELLS + shell.
uint bucket_of_row(ivec3 row, uint grid) {
    uvec3 block = uvec3(row.x, row.yz >> SIDE_BITS);
    uint hash = block.x * 0x9e3779b1u ^ block.y * 0x85ebca77u ^ block.z * 0xc2b2ae3du ^ grid * 0x27d4eb2fu;
    hash ^= hash >> 15u;
    hash *= 0x2c1b3c6du;
    hash ^= hash >> 13u;
    uvec2 inside = uvec2(row.yz) & ((1u << SIDE_BITS) - 1u);
    uint number = (hash << SIDE_BITS | inside.y) << SIDE_BITS | inside.x;
    return number << ROW_BITS & ((1u << settings.cell_bits) - 1u);
}

uint bucket_of(ivec3 cell, uint grid) {
    return bucket_of_row(row_of(cell), grid) | uint(cell.x) & ((1u << ROW_BITS) - 1u);
}
