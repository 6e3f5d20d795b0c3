// The alias method: Vose, «A Linear Algorithm For Generating Random Numbers With a Given Distribution», IEEE Transactions
// on Software Engineering 17(9), 1991. `alias.rs` makes the tables.
#ifndef LIGHTS_ALIAS_TABLE
#define LIGHTS_ALIAS_TABLE

// A cell of a table, and the position of a number within it.
struct AliasPlace {
    uint cell;
    float within;
};

// The chosen index, and the remainder of the number that chose it, uniform in [0, 1].
struct Choice {
    uint index;
    float rest;
};

// u and each of the two `digits` below it have 24 bits, so that an index with a probability of 10⁻¹² is chosen as often as it
// should be.
AliasPlace alias_place(uint count, float u, vec2 digits) {
    uvec3 bits = uvec3(vec3(u, digits) * 16777216.0);
    // A fraction of 64 bits times the number of cells: the cell, and a fraction of 64 bits within it.
    uint cell, part, carried, lower_part, carry;
    umulExtended(bits.x << 8u | bits.y >> 16u, count, cell, part);
    umulExtended(bits.y << 16u | bits.z >> 8u, count, carried, lower_part);
    part = uaddCarry(part, carried, carry);
    return AliasPlace(cell + carry,
                      float(part) * (1.0 / 4294967296.0) + float(lower_part) * (1.0 / 4294967296.0 / 4294967296.0));
}

// `accept`: the part of the cell that chooses the cell's own index; `alias`: the index that the rest of it chooses.
Choice alias_choice(AliasPlace place, float accept, uint alias) {
    bool own = place.within < accept || accept >= 1.0;
    float rest = own ? place.within / accept : (place.within - accept) / (1.0 - accept);
    return Choice(own ? place.cell : alias, min(rest, 1.0));
}

#endif
