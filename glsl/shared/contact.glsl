// Dielectrics that lie on other objects. Include after texture.glsl and intersect.glsl.

// Where a ray meets matter: a surface, and the index of refraction on its outer side.
struct Encounter {
    Surface surface;
    Material material;
    Facing facing;
    float outside;
    vec3 tint;     // of both sides of a dielectric boundary
    uint through;  // material that the ray came through, or VACUUM
    uint beyond;   // and what lies behind a dielectric boundary
};

const uint VACUUM = 0xffffffffu;

// Rounding decides which of two faces in one place a ray meets first, and the step off the one takes it past the other: where
// they are no further apart, both are crossed at once. Glass on glass is one boundary between the two; where glass lies on
// something opaque, that is what the ray meets.
// medium: the material that the ray is in, as far as its path knows. The other side's tint is that without its textures.
Encounter encounter(Hit hit, vec3 incoming, uint medium) {
    Encounter met;
    met.surface = surface_at(hit);
    met.outside = 1.0;
    met.through = medium;
    met.beyond = medium;
    bool front = dot(incoming, met.surface.geometric_normal) < 0.0;
    Material first = material_at(met.surface.material);
    if (is_dielectric(first) && !is_thin(first)) {
        met.through = front ? medium : met.surface.material;
        met.beyond = front ? met.surface.material : VACUUM;
    }
    vec3 other_tint = vec3(1.0);
    bool touched = CONTACT && (met.surface.flags & TOUCHED) != 0u;
    if (touched) {
        vec3 n = met.surface.geometric_normal;
        float step_off = ROUNDINGS * dot(abs(n), met.surface.reach);
        float size = met.surface.reach.x + met.surface.reach.y + met.surface.reach.z;
        if (INSTANCED) {
            size = max(size, 1.0); // of the scene: what lies there may be an instance, see below
        }
        float probe = ROUNDINGS * size;
        Hit other_hit = trace(met.surface.position + probe * n, -2.0 * probe * n, 1.0, triangle_of(hit), false);
        if (other_hit.triangle != MISS) {
            Surface other = surface_at(other_hit);
            if (INSTANCED) {
                // Where an instance puts its corners is uncertain by more than their own rounding.
                other.reach = max(other.reach, met.surface.reach);
                step_off = ROUNDINGS * dot(abs(n), other.reach);
            }
            bool apart = abs(dot(other.position - met.surface.position, n)) > step_off;
            bool meets_other = !apart && other.object != met.surface.object;
            if (INSTANCED) {
                met.surface.reach = meets_other ? other.reach : met.surface.reach;
            }
            Material other_material = material_at(other.material);
            bool is_there = share_there(other) >= 0.5;
            if (meets_other && !is_dielectric(other_material) && is_there) {
                met.surface = other;
            } else if (meets_other && is_dielectric(other_material) && dot(other.geometric_normal, n) < 0.0) {
                met.outside = other_material.ior;
                other_tint = other_material.base_color;
                if (front) {
                    met.through = other.material;
                } else {
                    met.beyond = other.material;
                }
            }
        }
    }
    met.material = material_of(met.surface);
    met.facing = face(met.surface, incoming);
    met.tint = met.material.base_color * other_tint;
    return met;
}

// What a medium leaves of light over a distance.
vec3 transmittance(uint medium, float distance) {
    bool absorbs = ABSORPTION && medium != VACUUM;
    vec3 absorption = vec3(0.0);
    if (absorbs) {
        absorption = TEXEL(Materials, MATERIAL_TEXELS * medium + 4u).rgb;
    }
    return exp(-absorption * distance);
}
