#version 460
#extension GL_GOOGLE_include_directive : require
// Ordering of visible points: keys along a space-filling curve (Morton's) through each object's bounding box.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/visible_point.glsl"
#include "trace/object_grid.glsl"

const uint BITS = CURVE_BITS / 3u; // of a coordinate

uniform usamplerBuffer VisiblePoints;
layout(std430) writeonly buffer PointKeys { uint keys[]; };
layout(std430) writeonly buffer PointValues { uint values[]; };
layout(std430) writeonly buffer PointCount { uint point_count; };

// Inserts two zero bits after each of the six bits.
uint spread(uint v) {
    v = (v | v << 8u) & 0x0300fu;
    v = (v | v << 4u) & 0x030c3u;
    return (v | v << 2u) & 0x09249u;
}

void main() {
    uint slot = invocation_index();
    if (slot >= slots()) {
        return;
    }
    if (slot == 0u) {
        point_count = slots();
    }
    VisiblePoint point = VISIBLE_POINT(VisiblePoints, slot);
    uint object = point.object;
    uint key = 0u;
    if (object != NO_OBJECT) {
        ObjectGrid grid = object_grid(object);
        float pieces = float(max(grid.cells.x, max(grid.cells.y, grid.cells.z)));
        vec3 along = (point.position - grid.low) * (grid.inverse_cell * float(1u << BITS) / pieces);
        uvec3 cell = uvec3(clamp(along, vec3(0.0), vec3(float((1u << BITS) - 1u))));
        key = spread(cell.x) | spread(cell.y) << 1u | spread(cell.z) << 2u;
    }
    keys[slot] = key;
    values[slot] = slot;
}
