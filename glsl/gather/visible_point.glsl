// Visible points and their order. Include after settings.glsl.

// In place of a visible point, of a path without one.
VisiblePoint no_visible_point(vec3 emitted, bool met_surface) {
    return VisiblePoint(vec3(0.0), NO_OBJECT, vec3(0.0), met_surface ? 1u : 0u, emitted, 0u);
}

// Visible points are stored in 8×8 tiles of pixels, 4×2 inside a tile: neighbours in the picture are neighbours in memory. At the
// picture's edge, slots are unused.
uvec2 pixel_of(uint pixel_slot) {
    uint tiles_across = (settings.resolution.x + TILE - 1u) / TILE;
    uint tile = pixel_slot / (TILE * TILE);
    uint inside = pixel_slot % (TILE * TILE);
    uvec2 local = uvec2((inside & 3u) | ((inside >> 1u) & 4u), ((inside >> 2u) & 1u) | ((inside >> 3u) & 6u));
    return uvec2(tile % tiles_across, tile / tiles_across) * TILE + local;
}

uint pixel_slots() {
    uvec2 tiles = (settings.resolution + TILE - 1u) / TILE;
    return tiles.x * tiles.y * TILE * TILE;
}

uint slots() {
    return pixel_slots() * settings.slots_per_pixel;
}

// Receivers of photons: each slot for each photon map, map-major.
uint receiver_count() {
    return slots() * settings.photon_maps;
}
