// The solid dielectrics that a ray is in. Where several overlap, the one of the lowest rank is there, and the boundaries of the
// others don't count: Schmidt and Budge, «Simple Nested Dielectrics in Ray Traced Images», Journal of Graphics Tools 7(2), 2002.
// Include after scene.glsl.

// Their names in order, VACUUM where there are fewer. Of more than four the highest ranks are forgotten.
struct Media {
    uint first;
    uvec3 others; // NESTED
};

const Media IN_VACUUM = Media(VACUUM, uvec3(VACUUM));

// A medium's name: its object's rank, then its material. VACUUM comes last.
uint medium_of(Surface surface) {
    return (surface.flags & ~RANK_BELOW) | surface.material;
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

// What a ray leaves at the back of a face that bounds this medium. If it isn't in that, the face is a wall that is an object of
// its own: it leaves what is most like it.
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

// What a medium leaves of light over a distance.
vec3 transmittance(uint medium, float distance) {
    bool absorbs = ABSORPTION && medium != VACUUM;
    vec3 absorption = vec3(0.0);
    if (absorbs) {
        absorption = material_at(material_of_medium(medium)).absorption;
    }
    return exp(-absorption * distance);
}
