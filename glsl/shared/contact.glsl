// Faces in one place. Rounding decides which of them a ray meets first, and the step off the one takes it past the others: all
// that are no further apart are met at once. What is opaque is met before glass that lies on it, what shines or looks to the ray
// before what doesn't. Include after alpha.glsl and media.glsl.

// What lies in the place where a ray meets matter.
struct Interface {
    Surface surface; // that it meets
    float share;     // chance of that, where something isn't there everywhere
    bool is_flat;    // a solid dielectric without thickness
    vec3 tint;       // of the other boundaries of dielectrics there
    Media through;   // that the ray came through
    Media beyond;    // behind boundaries of dielectrics
};

// What a face bounds for a ray that meets it in these media.
uint bounded_medium(Media media, Surface surface, bool front) {
    uint medium = medium_of(surface);
    return front ? medium : left_medium(media, medium);
}

// As the ray crosses a boundary of a medium.
void cross_boundary(inout Interface place, uint medium, bool front) {
    if (front) {
        if (NESTED) {
            place.through = without(place.through, medium);
        }
        place.beyond = with(place.beyond, medium);
    } else {
        place.through = with(place.through, medium);
        place.beyond = without(place.beyond, medium);
    }
}

bool is_solid(Material material) {
    return is_dielectric(material) && !is_thin(material);
}

// Of faces in one place that are no dielectrics', the highest is met.
uint preference(Surface surface, Material material, vec3 incoming) {
    bool front = dot(incoming, surface.geometric_normal) < 0.0;
    bool shines = largest(material.emission) > 0.0 && (front || (material.flags & BACK_EMITS) != 0u);
    bool hidden = (material.flags & BACK_HIDDEN) != 0u;
    bool see_through = (surface.flags & SEE_THROUGH) != 0u;
    uint kind = (shines ? 8u : 0u) | (front ? 4u : 0u) | (hidden ? 0u : 2u) | (see_through ? 1u : 0u);
    return kind << 28u | min(surface.object + 1u, 0xfffffffu);
}

// Whether it is a back that no camera sees.
bool is_hidden_back(Surface surface, Material material, vec3 incoming) {
    return (material.flags & BACK_HIDDEN) != 0u && dot(incoming, surface.geometric_normal) > 0.0;
}

// media: those that the ray is in, as far as its path knows. With `culls` backs that no camera sees aren't there.
Interface interface_at(Hit hit, vec3 incoming, Media media, bool culls, Random random) {
    Interface place;
    place.surface = surface_at(hit);
    place.share = share_there(place.surface);
    place.is_flat = false;
    place.tint = vec3(1.0);
    place.through = media;
    place.beyond = media;
    Surface first = place.surface;
    Material material = material_at(first.material);
    vec3 n = first.geometric_normal;
    bool front = dot(incoming, n) < 0.0;
    bool hidden = CULLING && culls && is_hidden_back(first, material, incoming);
    bool opaque = !is_dielectric(material) && !hidden;
    uint own = VACUUM;
    if (is_solid(material)) {
        own = bounded_medium(media, first, front);
        cross_boundary(place, own, front);
    }
    bool touched = CONTACT && (first.flags & TOUCHED) != 0u;
    bool coincides = COINCIDENCE && ((first.flags & COINCIDENT) != 0u || (!front && (first.flags & BACKED) != 0u));
    if (!touched && !coincides) {
        return place;
    }
    uint preferred = opaque ? preference(first, material, incoming) : 0u;
    uint missing = 0u;         // most preferred of those that aren't there
    float share_missing = 0.0; // its share
    uint solid = VACUUM;       // the lowest of the other solids
    Surface solid_surface = first;
    vec3 reach = first.reach;
    // What lies there may be larger and so less certain.
    float probe = ROUNDINGS * max(first.reach.x + first.reach.y + first.reach.z, 1.0);
    vec3 from = first.position + probe * n;
    Progress progress = AT_ORIGIN;
    bool goes_on = true;
    while (goes_on) {
        Hit other_hit = trace_from(from, -2.0 * probe * n, progress, 1.0, triangle_of(hit), false);
        goes_on = other_hit.triangle != MISS && !loops_cut;
        if (!goes_on) {
            break;
        }
        progress = past(other_hit);
        Surface other = surface_at(other_hit);
        vec3 both = max(other.reach, first.reach);
        bool apart = abs(dot(other.position - first.position, n)) > ROUNDINGS * dot(abs(n), both);
        bool same_object = other.object == first.object;
        bool doubles = same_object && dot(other.geometric_normal, n) < -PARALLEL;
        if (apart || (same_object && !doubles)) {
            continue;
        }
        Material other_material = material_at(other.material);
        if (CULLING && culls && is_hidden_back(other, other_material, incoming)) {
            continue;
        }
        bool other_front = dot(incoming, other.geometric_normal) < 0.0;
        uint preference_of_other = preference(other, other_material, incoming);
        float share = share_there(other);
        if (of_face(random, triangle_of(other_hit)) >= share) {
            share_missing = preference_of_other > missing ? share : share_missing;
            missing = max(missing, preference_of_other);
            continue;
        }
        reach = max(reach, both);
        if (!is_dielectric(other_material)) {
            if (preference_of_other > preferred) {
                preferred = preference_of_other;
                place.surface = other;
                place.share = share;
                opaque = true;
            }
        } else if (is_solid(other_material) && !opaque) {
            if (doubles) {
                place.is_flat = true;
            } else {
                uint bounded = bounded_medium(media, other, other_front);
                cross_boundary(place, bounded, other_front);
                place.tint *= other_material.base_color;
                bool lower = bounded < solid;
                solid = min(solid, bounded);
                if (lower) {
                    solid_surface = other;
                }
            }
        }
    }
    if (missing > preferred) {
        place.share *= 1.0 - share_missing;
    }
    if (opaque) {
        place.is_flat = false;
        place.tint = vec3(1.0);
    } else if (place.is_flat) {
        place.through = media;
        place.beyond = media;
    } else if (solid != VACUUM) {
        // The boundary is that of what is there on either side.
        bool counts = is_solid(material) && (own == place.through.first || own == place.beyond.first);
        if (!counts) {
            place.surface = solid_surface;
            place.tint = material.base_color;
        }
    }
    place.surface.reach = reach;
    return place;
}
