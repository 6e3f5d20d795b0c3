// Surface interactions: the interface of glsl/trace. Closest and any hits are those of `trace_visible`. Include after
// common/random.glsl.
#ifndef TRACE_INTERACTION
#define TRACE_INTERACTION

#include "trace/coincident.glsl"

// Both normals, on the side of the incoming ray.
struct ShadingFrame {
    vec3 geometric_normal;
    vec3 shading_normal;
    bool front; // the ray hits the triangle's front
};

ShadingFrame shading_frame(Surface surface, vec3 incoming) {
    bool front = dot(incoming, surface.geometric_normal) < 0.0;
    float side = front ? 1.0 : -1.0;
    ShadingFrame frame = ShadingFrame(side * surface.geometric_normal, side * surface.shading_normal, front);
    // Below the horizon of the shading normal (at silhouettes of tessellated shapes) the geometric normal is used.
    if (dot(incoming, frame.shading_normal) >= 0.0) {
        frame.shading_normal = frame.geometric_normal;
    }
    return frame;
}

struct SurfaceInteraction {
    Surface surface;
    Material material;
    ShadingFrame frame;
    float opacity; // see Interface
    bool hidden;   // a boundary inside a medium of lower rank: only its tint counts
    float outside; // index of refraction on the outer side
    vec3 tint;     // of all dielectric boundaries at the hit
    Media through; // in front of the boundaries
    Media beyond;  // behind the boundaries
};

SurfaceInteraction no_interaction() {
    Surface surface = Surface(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), NO_TRIANGLE, 0u, 0u, 0u, 0u);
    ShadingFrame frame = ShadingFrame(vec3(0.0), vec3(0.0), false);
    return SurfaceInteraction(surface, no_material(), frame, 0.0, false, 1.0, vec3(0.0), IN_VACUUM, IN_VACUUM);
}

bool finds_coincident_faces() {
    bool finds = COINCIDENT_INTERFACES;
    if (COINCIDENT_FACES) {
        finds = true;
    }
    return finds;
}

// The face with the highest priority of those that coincide at a hit.
Hit preferred_face(Hit hit, vec3 incoming, Random random) {
    if (finds_coincident_faces()) {
        hit = coincident_interfaces(hit, incoming, IN_VACUUM, false, random).hit;
    }
    return hit;
}

SurfaceInteraction interact(Hit hit, vec3 incoming, Media media, bool culls, Random random) {
    Interface place = interface_of(hit, media);
    if (finds_coincident_faces()) {
        place = coincident_interfaces(hit, incoming, media, culls, random);
    } else {
        place.opacity = opacity(hit);
    }
    // Textures come first: the surface would hold registers.
    MaterialPoint point = material_point(place.hit);
    Surface surface = surface_at(place.hit);
    Material material = material_of(place.hit, point, surface);
    if (finds_coincident_faces()) {
        surface.reach = place.reach;
    } else if (is_solid(material)) {
        bool front = dot(incoming, surface.geometric_normal) < 0.0;
        cross_boundary(place, bounded_medium(media, surface, front), front);
    }
    SurfaceInteraction met;
    met.surface = surface;
    met.material = material;
    met.frame = shading_frame(surface, incoming);
    met.opacity = place.opacity;
    met.tint = place.tint * material.base_color;
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
        met.outside = ior_of_medium(met.frame.front ? met.through.first : met.beyond.first);
    }
    return met;
}

// Whether light passes a face without refraction, as shadow rays assume, and the tint of the face.
bool passes_unbent(Hit hit, out vec3 tint) {
    Material material = material_at(shading_triangle(hit.triangle).material);
    tint = material.base_color;
    return is_dielectric(material);
}

bool is_glass(Surface surface) {
    return is_dielectric(material_at(surface.material));
}

// Whether faces that are not dielectric may coincide.
bool faces_coincide() {
    return COINCIDENT_FACES;
}

bool may_lie_on_others(Surface surface) {
    return (COINCIDENT_INTERFACES && is_glass(surface)) || (surface.flags & (COINCIDENT | BACKED)) != 0u;
}

// Whether light may pass a surface.
bool lets_light_pass(Surface surface) {
    return (surface.flags & SEE_THROUGH) != 0u || is_glass(surface);
}

#endif
