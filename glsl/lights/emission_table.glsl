// The sampling table of aimed photon paths: boxes of starting coordinates, each with a probability. `emission::Table::texels`
// writes the buffer: the counts, the target spheres, the cells.
#ifndef LIGHTS_EMISSION_TABLE
#define LIGHTS_EMISSION_TABLE

#include "lights/light.glsl"

uniform usamplerBuffer EmissionTable;

struct EmissionTableSize {
    uint cells;
    uint targets;
    uint view; // index of the target around most of the view; the number of targets if there is none
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

// The start of a path: five coordinates in [0, 1); the last one has chosen the light.
struct Start {
    uint light;
    float probability; // of the light within its source
    vec2 place;
    vec2 direction;
    uint target;  // that the path has to hit first; the number of targets if there is none
    float weight; // 1 / density of the coordinates
};

// In steps of 2⁻²⁴, like random numbers, because tables are looked up with these.
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

// Whether a ray hits a sphere. Distant light is a line without origin.
bool hits_sphere(vec4 sphere, vec3 origin, vec3 direction, bool distant) {
    vec3 to_centre = sphere.xyz - origin;
    float along = dot(to_centre, direction);
    vec3 off = to_centre - (distant ? along : max(along, 0.0)) * direction;
    return dot(off, off) <= sphere.w * sphere.w;
}

// Whether a ray hits the target, unless that is known, and none of the targets before it.
bool hits_target_first(EmissionTableSize size, uint target, bool known, vec3 origin, vec3 direction, bool distant) {
    bool hits = known || target >= size.targets;
    if (!hits) {
        hits = hits_sphere(target_sphere(target), origin, direction, distant);
    }
    for (uint i = 0u; i < min(target, size.targets) && hits; i++) {
        hits = !hits_sphere(target_sphere(i), origin, direction, distant);
    }
    return hits;
}

#endif
