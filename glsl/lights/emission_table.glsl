// Where aimed photon paths start: boxes of starts, each with a probability of its own. `emission::Table::texels` writes the buffer: its counts, the spheres that paths are aimed at, the cells.
#ifndef LIGHTS_EMISSION_TABLE
#define LIGHTS_EMISSION_TABLE

#include "lights/light.glsl"

uniform usamplerBuffer EmissionTable;

struct EmissionTableSize {
    uint cells;
    uint targets;
    uint view; // the target around most of what the camera sees; as many as there are targets: none
};

EmissionTableSize emission_table_size() {
    uvec4 head = TEXEL_BITS(EmissionTable, 0u);
    return EmissionTableSize(head.x, head.y, head.z);
}

// xyz: centre; w: radius.
vec4 target_sphere(uint i) {
    return TEXEL(EmissionTable, 1u + i);
}

EmissionCell emission_cell(EmissionTableSize size, uint i) {
    return EMISSION_CELL_AFTER(EmissionTable, 1u + size.targets, i);
}

// What a path starts with: five coordinates in [0, 1), of which the last has chosen the light.
struct Start {
    uint light;
    float probability; // of the light within its source
    vec2 place;
    vec2 direction;
    uint target;  // that the path has to meet first of all; as many as there are: none
    float weight; // 1 / density of the coordinates
};

// In steps of 2⁻²⁴, as random numbers are: tables are looked up with these.
vec4 in_box(vec4 low, vec4 size, vec4 u) {
    return min(floor((low + size * u) * 16777216.0), 16777215.0) * (1.0 / 16777216.0);
}

Start choose_start(EmissionTableSize size, vec4 u, vec4 w) {
    AliasPlace place = alias_place(size.cells, u.x, w.xz);
    EmissionCell entry = emission_cell(size, place.cell);
    Choice choice = alias_choice(place, entry.accept, entry.alias);
    EmissionCell cell = emission_cell(size, choice.index);
    vec4 coordinates = in_box(cell.low, cell.size, vec4(choice.rest, u.yzw));
    float e = in_box(vec4(cell.low_light), vec4(cell.size_light), w.wwww).x;
    LightWithin within = light_within(cell.first_light, cell.lights, e);
    return Start(within.light, within.probability, coordinates.xy, coordinates.zw, cell.target, cell.weight);
}

// Whether a ray meets a sphere. One that comes from afar has no beginning.
bool meets_sphere(vec4 sphere, vec3 origin, vec3 direction, bool from_afar) {
    vec3 to_centre = sphere.xyz - origin;
    float along = dot(to_centre, direction);
    vec3 off = to_centre - (from_afar ? along : max(along, 0.0)) * direction;
    return dot(off, off) <= sphere.w * sphere.w;
}

// Whether it meets the target, unless that is known, and none of those before it.
bool meets_first(EmissionTableSize size, uint target, bool known, vec3 origin, vec3 direction, bool from_afar) {
    bool meets = known || target >= size.targets;
    if (!meets) {
        meets = meets_sphere(target_sphere(target), origin, direction, from_afar);
    }
    for (uint i = 0u; i < min(target, size.targets) && meets; i++) {
        meets = !meets_sphere(target_sphere(i), origin, direction, from_afar);
    }
    return meets;
}

#endif
