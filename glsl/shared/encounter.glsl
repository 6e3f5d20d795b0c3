// Where rays meet matter. Include after bsdf.glsl and contact.glsl.

// A surface interaction.
struct Encounter {
    Surface surface;
    Material material;
    Facing facing;
    float share;   // see Interface
    bool hidden;   // a boundary inside of something of lower rank: nothing but its tint counts
    float outside; // index of refraction on the outer side
    vec3 tint;     // of all boundaries of dielectrics there
    Media through; // that the ray came through
    Media beyond;  // behind boundaries of dielectrics
};

Encounter encounter(Hit hit, vec3 incoming, Media media, bool culls, Random random) {
    Interface place = interface_at(hit, incoming, media, culls, random);
    Encounter met;
    met.surface = place.surface;
    met.material = material_of(met.surface);
    met.facing = face(met.surface, incoming);
    met.share = place.share;
    met.tint = place.tint * met.material.base_color;
    met.through = place.through;
    met.beyond = place.beyond;
    met.hidden = false;
    met.outside = 1.0;
    if (THIN_WALLS && place.is_flat) {
        met.material.thin = 1u;
    }
    bool nests = NESTED && is_solid(met.material);
    if (nests) {
        met.hidden = met.through.first == met.beyond.first;
        met.outside = ior_of_medium(met.facing.front ? met.through.first : met.beyond.first);
    }
    return met;
}
