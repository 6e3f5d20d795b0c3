// Coincident faces. Rounding decides which of them a ray hits first, and the offset of the next ray's origin skips the others. So
// all faces within that distance are hit at once. Opaque faces have priority over glass that lies on them, faces that emit or
// face the ray over others. Include after common/random.glsl.
#ifndef TRACE_COINCIDENT
#define TRACE_COINCIDENT

#include "trace/media.glsl"
#include "trace/opacity.glsl"

layout(constant_id = 8) const bool COINCIDENT_INTERFACES = true;
layout(constant_id = 23) const bool CULLING = false;

// The faces at the point where a ray hits a surface.
struct Interface {
    Hit hit;       // of the face with the highest priority
    vec3 reach;    // of all faces, see Surface
    float opacity; // probability of hitting it, if faces are partly transparent by alpha
    bool is_flat;  // a solid dielectric without thickness
    vec3 tint;     // of the other dielectric boundaries
    Media through; // in front of the boundaries
    Media beyond;  // behind the boundaries
};

Interface interface_of(Hit hit, Media media) {
    return Interface(hit, vec3(0.0), 1.0, false, vec3(1.0), media, media);
}

// Updates the media as the ray crosses a boundary.
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

// Priority of coincident faces that are not dielectric: the highest is hit.
uint preference(Surface surface, Material material, vec3 incoming) {
    bool front = dot(incoming, surface.geometric_normal) < 0.0;
    bool emitting = largest(material.emission) > 0.0 && emits(material, front);
    bool see_through = (surface.flags & SEE_THROUGH) != 0u;
    uint kind = (emitting ? 8u : 0u) | (front ? 4u : 0u) | (hides_back(material) ? 0u : 2u) | (see_through ? 1u : 0u);
    return kind << 28u | min(surface.object + 1u, 0xfffffffu);
}

// Whether it is a back face that is culled for the camera.
bool is_hidden_back(Surface surface, Material material, vec3 incoming) {
    return CULLING && hides_back(material) && dot(incoming, surface.geometric_normal) > 0.0;
}

// Whether other faces may coincide with a hit.
bool may_coincide(Surface surface, bool front) {
    bool touched = COINCIDENT_INTERFACES && (surface.flags & TOUCHED) != 0u;
    bool coincides = COINCIDENT_FACES && ((surface.flags & COINCIDENT) != 0u || (!front && (surface.flags & BACKED) != 0u));
    return touched || coincides;
}

// The state of the search for coincident faces.
struct Search {
    Interface place;
    uint preferred;      // priority of the opaque face
    uint missing;        // highest priority of the faces that alpha removed
    float missing_opacity; // its opacity
    uint solid;          // lowest medium of the other solids
};

void keep_search(Search search) {
    Interface place = search.place;
    keep(0u, place.reach);
    keep(3u, place.tint);
    keep(6u, vec3(place.hit.u, place.hit.v, place.opacity));
    keep(9u, uvec4(place.hit.triangle, place.hit.instance, search.preferred, search.missing));
    keep(13u, vec3(search.missing_opacity, uintBitsToFloat(search.solid), place.is_flat ? 1.0 : 0.0));
    keep_media(16u, place.through);
    keep_media(20u, place.beyond);
}

Search kept_search() {
    vec3 at = kept(6u);
    uvec4 bits = kept_bits(9u);
    vec3 more = kept(13u);
    Hit hit = hit_at(PlacedTriangle(bits.x, bits.y), at.xy);
    Interface place = Interface(hit, kept(0u), at.z, more.z != 0.0, kept(3u), kept_media(16u), kept_media(20u));
    return Search(place, bits.z, bits.w, more.x, floatBitsToUint(more.y));
}

// Adds another coincident face, which alpha has not removed.
void add_face(inout Search search, inout bool opaque, Hit hit, Surface face, Material material, bool doubles, float face_opacity,
               vec3 incoming, Media media) {
    bool glass = is_dielectric(material);
    uint preference_of_face = preference(face, material, incoming);
    if (!glass && preference_of_face > search.preferred) {
        search.preferred = preference_of_face;
        search.place.hit = hit;
        search.place.opacity = face_opacity;
        opaque = true;
    } else if (is_solid(material) && !opaque) {
        search.place.is_flat = search.place.is_flat || doubles;
        if (!doubles) {
            bool front = dot(incoming, face.geometric_normal) < 0.0;
            uint bounded = bounded_medium(media, face, front);
            cross_boundary(search.place, bounded, front);
            search.place.tint *= material.base_color;
            if (bounded < search.solid) {
                search.place.hit = hit;
            }
            search.solid = min(search.solid, bounded);
        }
    }
}

// media: those that the ray is in, as tracked by its path. With `culls`, culled back faces are ignored.
Interface coincident_interfaces(Hit hit, vec3 incoming, Media media, bool culls, Random random) {
    Search search = Search(interface_of(hit, media), 0u, 0u, 0.0, VACUUM);
    search.place.opacity = opacity(hit);
    Surface first = surface_at(hit);
    search.place.reach = first.reach;
    Material material = material_at(first.material);
    bool front = dot(incoming, first.geometric_normal) < 0.0;
    bool opaque = !is_dielectric(material) && !(culls && is_hidden_back(first, material, incoming));
    bool solid = is_solid(material);
    if (solid) {
        cross_boundary(search.place, bounded_medium(media, first, front), front);
    }
    if (may_coincide(first, front)) {
        search.preferred = opaque ? preference(first, material, incoming) : 0u;
        keep_search(search);
        keep(24u, first.position);
        keep(27u, first.geometric_normal);
        keep(30u, first.reach);
        keep(33u, first.object);
        Progress progress = AT_ORIGIN;
        bool goes_on = true;
        while (goes_on) {
            // The other face may be larger and so its plane less certain.
            vec3 of_first = kept(30u);
            float probe = ROUNDINGS * max(of_first.x + of_first.y + of_first.z, 1.0);
            vec3 across = probe * kept(27u);
            Hit other_hit = trace_from(kept(24u) + across, -2.0 * across, progress, 1.0, triangle_of(hit), false);
            goes_on = other_hit.triangle != MISS && !loops_cut;
            if (goes_on) {
                progress = past(other_hit);
                Surface other = surface_at(other_hit);
                Material other_material = material_at(other.material);
                vec3 n = kept(27u);
                vec3 reach = max(other.reach, kept(30u));
                bool apart = abs(dot(other.position - kept(24u), n)) > ROUNDINGS * dot(abs(n), reach);
                bool same_object = other.object == kept_word(33u);
                bool doubles = same_object && dot(other.geometric_normal, n) < -PARALLEL;
                bool hidden = culls && is_hidden_back(other, other_material, incoming);
                if (!apart && (!same_object || doubles) && !hidden) {
                    float face_opacity = opacity(other_hit);
                    search = kept_search();
                    if (opacity_number(random, triangle_of(other_hit)) < face_opacity) {
                        search.place.reach = max(search.place.reach, reach);
                        add_face(search, opaque, other_hit, other, other_material, doubles, face_opacity, incoming, media);
                    } else {
                        uint preference_of_other = preference(other, other_material, incoming);
                        bool most = preference_of_other > search.missing;
                        search.missing_opacity = most ? face_opacity : search.missing_opacity;
                        search.missing = most ? preference_of_other : search.missing;
                    }
                    keep_search(search);
                }
            }
        }
        search = kept_search();
        search.place.opacity *= search.missing > search.preferred ? 1.0 - search.missing_opacity : 1.0;
        if (opaque) {
            search.place.is_flat = false;
            search.place.tint = vec3(1.0);
        } else if (search.place.is_flat) {
            search.place.hit = hit;
            search.place.through = media;
            search.place.beyond = media;
        } else if (search.solid != VACUUM) {
            // The boundary belongs to the medium that counts on either side.
            Surface surface = surface_at(hit);
            uint own = bounded_medium(media, surface, dot(incoming, surface.geometric_normal) < 0.0);
            if (solid && (own == search.place.through.first || own == search.place.beyond.first)) {
                search.place.hit = hit;
            } else {
                search.place.tint = material_at(surface.material).base_color;
            }
        }
    }
    return search.place;
}

#endif
