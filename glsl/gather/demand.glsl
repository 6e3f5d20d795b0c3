// Demand of the visible points for photons: a hashed table of cells. Include after grid.glsl. The cells are coarser than those of
// the gather, so that a disc reaches few of them, and each object has its own. A hash collision keeps photons needlessly: that
// costs time, but no accuracy.

const float LEAST_DEMAND = 1e-30;

uint demand_entry(ivec3 cell, uint of_shell, uint object) {
    uvec3 c = uvec3(cell);
    uint hash = c.x * 0x9e3779b1u ^ c.y * 0x85ebca77u ^ c.z * 0xc2b2ae3du ^ (of_shell | object << 4u) * 0x27d4eb2fu;
    hash ^= hash >> 15u;
    hash *= 0x2c1b3c6du;
    hash ^= hash >> 13u;
    return hash >> (32u - DEMAND_BITS);
}
