// Visible points and their order. Include after settings.glsl.

// In place of a visible point, of a path without one.
VisiblePoint no_visible_point(vec3 emitted, bool met_surface) {
    return VisiblePoint(vec3(0.0), NO_OBJECT, vec3(0.0), met_surface ? 1u : 0u, emitted, 0u);
}

uvec2 tiles_of(uvec2 size) {
    return (size + TILE - 1u) / TILE;
}

uint slots_of(uvec2 size) {
    uvec2 tiles = tiles_of(size);
    return tiles.x * tiles.y * TILE * TILE;
}

// Visible points are stored in 8×8 tiles of pixels, 4×2 inside a tile: neighbours in the picture are neighbours in memory. At the
// picture's edge, slots are unused.
uvec2 place_in_tiles(uint number, uint tiles_across) {
    uint tile = number / (TILE * TILE);
    uint inside = number % (TILE * TILE);
    uvec2 local = uvec2((inside & 3u) | ((inside >> 1u) & 4u), ((inside >> 2u) & 1u) | ((inside >> 3u) & 6u));
    return uvec2(tile % tiles_across, tile / tiles_across) * TILE + local;
}

// Slots of the pixels that the picture shows. Those behind them are guides: pixels of the whole picture, also of what is cropped,
// from which is learned what all pixels share.
uint region_slots() {
    return slots_of(settings.region_size);
}

uint pixel_slots() {
    return region_slots() + slots_of(settings.guides);
}

// Whether all learn from a slot's pixel.
bool is_guide(uint pixel_slot) {
    return settings.guides.x == 0u || pixel_slot >= region_slots();
}

// Whether a slot has a pixel, and which one of the whole picture.
bool has_pixel(uint pixel_slot, out uvec2 pixel) {
    uint before = region_slots();
    bool guide = pixel_slot >= before;
    uvec2 size = guide ? settings.guides : settings.region_size;
    uvec2 place = place_in_tiles(guide ? pixel_slot - before : pixel_slot, tiles_of(size).x);
    pixel = guide ? place * settings.guide_step + settings.guide_step / 2u : place + settings.region_origin;
    return all(lessThan(place, size));
}

uint number_in_picture(uvec2 pixel) {
    return pixel.y * settings.resolution.x + pixel.x;
}

// The number of a slot's pixel among those that the film has, row by row; behind them are the guides.
uint number_on_film(uint pixel_slot, uvec2 pixel) {
    uint before = region_slots();
    uvec2 place = pixel - settings.region_origin;
    return pixel_slot < before ? place.y * settings.region_size.x + place.x
                               : settings.region_size.x * settings.region_size.y + pixel_slot - before;
}

// The slot that a visible point has if the whole picture is rendered, for random numbers.
uint slot_in_whole(uint slot) {
    uvec2 pixel;
    has_pixel(slot / settings.slots_per_pixel, pixel);
    uvec2 tile = pixel / TILE;
    uint inside = (pixel.x & 3u) | (pixel.y & 1u) << 2u | (pixel.x & 4u) << 1u | (pixel.y & 6u) << 3u;
    uint whole = (tile.y * tiles_of(settings.resolution).x + tile.x) * (TILE * TILE) + inside;
    return whole * settings.slots_per_pixel + slot % settings.slots_per_pixel;
}

uint slots() {
    return pixel_slots() * settings.slots_per_pixel;
}

// Receivers of photons: each slot for each photon map, map-major.
uint receiver_count() {
    return slots() * settings.photon_maps;
}
