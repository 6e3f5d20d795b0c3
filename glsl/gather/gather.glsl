// Common parts of all gathers. Include after photon.glsl, visible_point.glsl and statistics.glsl.

#include "bsdf/reflection.glsl"

// Whether tests of photons are counted, for reports.
layout(constant_id = 0) const bool COUNT_TESTS = false;

uniform usamplerBuffer VisiblePoints;
uniform usamplerBuffer Radii2;
uniform usamplerBuffer PackedBsdfs;
layout(std430) buffer GatheredOf { Gathered gathered[]; };
layout(std430) buffer TestsOf { uint tests[]; }; // photons tested for each slot and map, and GATHERED_FOR, where they are counted

// A visible point as gathers need it.
struct Receiver {
    vec3 position;
    float radius2;
    uint object; // with its map's bit, like a photon's; NO_OBJECT if there is no visible point
    vec3 normal; // of any length
    VisibleBsdf bsdf;
};

Receiver no_receiver() {
    return Receiver(vec3(0.0), -1.0, NO_OBJECT, vec3(0.0), no_visible_bsdf());
}

// R² of a slot for a photon map.
float radius2_at(uint slot, uint map) {
    uint i = map * slots() + slot;
    return TEXEL(Radii2, i >> 2u)[i & 3u];
}

Receiver receiver_at(uint slot, uint map) {
    VisiblePoint point = VISIBLE_POINT(VisiblePoints, slot);
    Receiver receiver = Receiver(point.position, radius2_at(slot, map),
                                 point.object, vec3(0.0), no_visible_bsdf());
    receiver.object |= receiver.object != NO_OBJECT && map == 1u ? CAUSTIC : 0u;
    receiver.normal = decode_octahedral(point.geometric_normal);
    if (carries_bsdf()) {
        receiver.bsdf = LOAD_BSDF(PackedBsdfs, slot, decode_direction(point.shading_normal));
    }
    return receiver;
}

float squared_distance(vec3 a, vec3 b) {
    precise vec3 d = a - b;
    precise float d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    return d2;
}

// The predicate of all gathers: on the same object, of the same map, within R, and arriving on the visible side.
bool accepts(Receiver receiver, Photon photon, out float distance2) {
    precise float cosine = dot(decode_octahedral(photon.direction), receiver.normal);
    distance2 = squared_distance(photon.position, receiver.position);
    return distance2 <= receiver.radius2 &&
           photon.object == receiver.object &&
           cosine < 0.0;
}

// A receiver's sums in this launch.
struct Sum {
    vec3 flux;
    uint count;
    float moment; // see Gathered
};

const Sum NOTHING = Sum(vec3(0.0), 0u, 0.0);

// Adds the photon if the receiver accepts it.
void gather(Receiver receiver, Photon photon, inout Sum sum) {
    float distance2;
    bool accepted = accepts(receiver, photon, distance2);
    vec3 flux = photon.flux;
    if (carries_bsdf()) {
        // The sum is the light that the surface scatters to the viewer.
        flux *= accepted ? gathered_part(receiver.bsdf, photon.direction) : vec3(0.0);
    }
    sum.flux += accepted ? flux : vec3(0.0);
    sum.count += accepted ? 1u : 0u;
    sum.moment += accepted ? mean_of(flux) * distance2 : 0.0;
}

void add_gathered(uint slot, uint map, Sum sum, uint tested) {
    uint i = map * slots() + slot;
    gathered[i].flux += sum.flux;
    gathered[i].count += sum.count;
    gathered[i].moment += sum.moment;
    if (COUNT_TESTS) {
        tests[i] = (tests[i] + tested) | GATHERED_FOR;
    }
}
