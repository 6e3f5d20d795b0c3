// Where aimed photon paths start: boxes of starts, each with a probability of its own. Include after texel.glsl and
// light.glsl. `emission::Table::texels` writes the buffer: its counts, the spheres that paths are aimed at, the cells.

uniform usamplerBuffer EmissionTable;

const uint CELL_TEXELS = 4u;

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
    uint cells = 1u + size.targets;
    float accept = TEXEL(EmissionTable, cells + CELL_TEXELS * place.cell + 2u).w;
    uint alias = TEXEL_BITS(EmissionTable, cells + CELL_TEXELS * place.cell + 3u).x;
    Choice choice = alias_choice(place, accept, alias);
    uint cell = cells + CELL_TEXELS * choice.index;
    vec4 coordinates = in_box(TEXEL(EmissionTable, cell), TEXEL(EmissionTable, cell + 1u), vec4(choice.rest, u.yzw));
    vec4 light_weight = TEXEL(EmissionTable, cell + 2u);
    uvec4 rest = TEXEL_BITS(EmissionTable, cell + 3u);
    float e = in_box(light_weight.xxxx, light_weight.yyyy, w.wwww).x;
    LightWithin within = light_within(rest.y, rest.z, e);
    return Start(within.light, within.probability, coordinates.xy, coordinates.zw, rest.w, light_weight.z);
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
    if (!known && target < size.targets && !meets_sphere(target_sphere(target), origin, direction, from_afar)) {
        return false;
    }
    for (uint i = 0u; i < min(target, size.targets); i++) {
        if (meets_sphere(target_sphere(i), origin, direction, from_afar)) {
            return false;
        }
    }
    return true;
}
