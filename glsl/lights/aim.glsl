// Aiming of photon paths, at their start and at bounces.
#ifndef LIGHTS_AIM
#define LIGHTS_AIM

// Paths start by a learned table, or else in proportion to the lights' power.
layout(constant_id = 24) const bool AIMED = false;

#include "lights/emission_table.glsl"

// The cone in which a sphere is seen.
struct Cone {
    vec3 axis;
    float versine; // 1 − cos of the angle between its sides and the axis; 2 from inside the sphere
};

Cone cone_of(vec4 sphere, vec3 from) {
    vec3 way = sphere.xyz - from;
    float distance2 = dot(way, way);
    float sin2 = sphere.w * sphere.w / distance2;
    bool inside = distance2 <= sphere.w * sphere.w;
    float versine = sin2 / (1.0 + sqrt(max(0.0, 1.0 - sin2)));
    return Cone(inside ? vec3(0.0, 0.0, 1.0) : way * inversesqrt(distance2), inside ? 2.0 : versine);
}

// Maximum factor by which all bounces of a path together weight its flux.
const float MOST_GUIDED = 4.0;

// The share of directions that are aimed at the view, for a path whose bounces have weighted its flux by a factor so far: half at
// first. The others are weighted by 1 / (1 - share), which a constant share would let grow with each bounce, so that a few
// photons of long paths would have most of the flux. By this one, the factor stays below MOST_GUIDED.
float guided_share(float guided) {
    return 0.5 - guided * (0.5 / MOST_GUIDED);
}

// Few photons from a matte surface outside of the view reach the view, and each of those carries much flux. So a share of them is
// aimed at it. Replaces the cosine-distributed direction and returns the weight of the flux: cosine distribution over the density
// of both strategies together.
float guide(vec3 position, vec3 normal, vec4 u, float share, inout vec3 outgoing) {
    EmissionTableSize size = emission_table_size();
    float weight = 1.0;
    if (size.view < size.targets) {
        vec4 sphere = target_sphere(size.view);
        vec3 way = sphere.xyz - position;
        if (sphere.w * sphere.w < NARROW_CONE * dot(way, way) && dot(way, normal) > -sphere.w) {
            Cone cone = cone_of(sphere, position);
            bool aimed = u.w < share;
            outgoing = aimed ? direction_in_cone(cone.axis, cone.versine, u.xy) : outgoing;
            vec3 off = outgoing - cone.axis;
            bool inside = aimed || 0.5 * dot(off, off) <= cone.versine;
            float by_cosine = max(0.0, dot(outgoing, normal)) / PI;
            float by_aim = inside ? 1.0 / (2.0 * PI * cone.versine) : 0.0;
            weight = by_cosine > 0.0 ? by_cosine / mix(by_cosine, by_aim, share) : 0.0;
        }
    }
    return weight;
}

#endif
