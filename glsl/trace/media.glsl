// The solid dielectrics that a ray is in. Where several overlap, the one with the lowest rank counts, and the boundaries of the
// others are ignored: Schmidt and Budge, «Simple Nested Dielectrics in Ray Traced Images», Journal of Graphics Tools 7(2), 2002.
#ifndef TRACE_MEDIA
#define TRACE_MEDIA

#include "bsdf/material.glsl"
#include "trace/intersect.glsl"

layout(constant_id = 13) const bool ABSORPTION = false;
layout(constant_id = 27) const bool NESTED = false;
layout(constant_id = 32) const bool IMMERSED = false; // paths start in dielectrics

// Media in ascending order, filled up with VACUUM. Of more than four, the highest ranks are dropped.
struct Media {
    uint first;
    uvec3 others; // NESTED
};

const Media IN_VACUUM = Media(VACUUM, uvec3(VACUUM));

// A medium: its object's rank, then its material. VACUUM comes last.
uint medium_of(Surface surface) {
    return (surface.flags & ~RANK_BELOW) | surface.material;
}

// The media of a path that starts in these.
Media media_from(uvec4 names) {
    Media media = IN_VACUUM;
    if (IMMERSED) {
        media = Media(names.x, names.yzw);
    }
    return media;
}

uint material_of_medium(uint medium) {
    return medium & RANK_BELOW;
}

Media without(Media media, uint medium) {
    if (NESTED) {
        bvec3 gone;
        gone.x = media.first == medium;
        gone.y = gone.x || media.others.x == medium;
        gone.z = gone.y || media.others.y == medium;
        bool last_gone = gone.z || media.others.z == medium;
        media.first = gone.x ? media.others.x : media.first;
        media.others.x = gone.y ? media.others.y : media.others.x;
        media.others.y = gone.z ? media.others.z : media.others.y;
        media.others.z = last_gone ? VACUUM : media.others.z;
    } else {
        media.first = VACUUM;
    }
    return media;
}

// At most once.
Media with(Media media, uint medium) {
    if (NESTED) {
        media = without(media, medium);
        uvec4 rest = uvec4(media.first, media.others);
        media.first = min(rest.x, medium);
        media.others = max(uvec3(min(rest.yzw, medium)), rest.xyz);
    } else {
        media.first = medium;
    }
    return media;
}

float ior_of_medium(uint medium) {
    return medium == VACUUM ? 1.0 : material_at(material_of_medium(medium)).ior;
}

// The medium that a ray leaves at the back of a face that bounds this medium. If the ray is not in it, the face is a wall that is
// a separate object: the ray leaves the most similar medium.
uint left_medium(Media media, uint medium) {
    uint left = medium;
    if (NESTED) {
        uvec4 all = uvec4(media.first, media.others);
        bool is_in = any(equal(all, uvec4(medium)));
        float ior = ior_of_medium(medium);
        float least = 1e30;
        for (uint i = 0u; i < 4u && !is_in; i++) {
            bool same_material = material_of_medium(all[i]) == material_of_medium(medium);
            float unlike = same_material ? -1.0 : abs(ior_of_medium(all[i]) - ior);
            bool closer = all[i] != VACUUM && unlike < least;
            left = closer ? all[i] : left;
            least = closer ? unlike : least;
        }
    }
    return left;
}

// In private memory.
void keep_media(uint at, Media media) {
    keep(at, media.first);
    if (NESTED) {
        keep(at, uvec4(media.first, media.others));
    }
}

Media kept_media(uint at) {
    Media media = IN_VACUUM;
    media.first = kept_word(at);
    if (NESTED) {
        media.others = kept_bits(at).yzw;
    }
    return media;
}

// Transmittance of a medium over a distance.
vec3 transmittance(uint medium, float distance) {
    vec3 left = vec3(1.0);
    if (ABSORPTION) {
        vec3 absorption = medium == VACUUM ? vec3(0.0) : material_at(material_of_medium(medium)).absorption;
        left = exp(-absorption * distance);
    }
    return left;
}

// The medium that a face bounds for a ray in these media.
uint bounded_medium(Media media, Surface surface, bool front) {
    uint medium = medium_of(surface);
    return front ? medium : left_medium(media, medium);
}

#endif
