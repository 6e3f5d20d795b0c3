struct Photon {
    vec4 position_object; // xyz: render space; w: uint bits, object that it landed on
    vec4 flux_direction;  // rgb: flux, not yet divided by the emitted paths; w: uint bits, octahedral direction of flight
};

#define PHOTON(buffer, i) Photon(TEXEL(buffer, 2u * (i)), TEXEL(buffer, 2u * (i) + 1u))
