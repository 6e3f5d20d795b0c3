struct Photon {
    vec4 position_object; // xyz: render space; w: uint bits, object that it landed on, and CAUSTIC
    vec4 flux_direction;  // rgb: flux, not yet divided by the emitted paths, on coated materials over the cosine to the
                          // geometric normal; w: uint bits, octahedral direction of flight
};

#define PHOTON(buffer, i) Photon(TEXEL(buffer, 2u * (i)), TEXEL(buffer, 2u * (i) + 1u))

// Bit of a photon's object: since the light it has met mirrors and glass alone, in a scene that gathers such photons apart.
const uint CAUSTIC = 0x80000000u;

uint object_of(vec4 position_object) {
    return floatBitsToUint(position_object.w) & ~CAUSTIC;
}

uint map_of(vec4 position_object) {
    return floatBitsToUint(position_object.w) >> 31u;
}
