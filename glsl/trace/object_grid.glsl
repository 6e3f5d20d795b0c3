// A grid of cubes for each object: its bounding box, the longest axis split into a fixed number of pieces. The scene's.
#ifndef TRACE_OBJECT_GRID
#define TRACE_OBJECT_GRID

#include "layout.glsl"

uniform usamplerBuffer ObjectGrids;

ObjectGrid object_grid(uint object) {
    return OBJECT_GRID(ObjectGrids, object);
}

// Positions outside the box, by rounding or within a radius, belong to the nearest cells.
uvec3 cell_in(ObjectGrid grid, vec3 position) {
    vec3 cell = floor((position - grid.low) * grid.inverse_cell);
    return uvec3(clamp(cell, vec3(0.0), vec3(grid.cells - 1u)));
}

uint cell_number(ObjectGrid grid, uvec3 cell) {
    return grid.first_cell + (cell.z * grid.cells.y + cell.y) * grid.cells.x + cell.x;
}

// Largest absolute coordinates of an object, or slightly more.
vec3 reach_of(uint object) {
    ObjectGrid grid = object_grid(object);
    return max(abs(grid.low), abs(grid.low + vec3(grid.cells) / grid.inverse_cell));
}

#endif
