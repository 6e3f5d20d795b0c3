// What all gathers share. Include after sampling.glsl, photon.glsl and visible_point.glsl.

// The gather's side of a visible point.
struct Receiver {
    vec3 position;
    float radius2;
    uint object;
    vec3 normal;
};

Receiver receiver_of(VisiblePoint visible_point, float radius2) {
    return Receiver(visible_point.position_object.xyz, radius2, floatBitsToUint(visible_point.position_object.w),
                    decode_direction(floatBitsToUint(visible_point.weight_normal.w)));
}

float squared_distance(vec3 a, vec3 b) {
    precise vec3 d = a - b;
    precise float d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    return d2;
}

// The one predicate of every gather: on the same object, within R, and arriving on the side that the viewer sees.
bool accepts(Receiver receiver, Photon photon) {
    return squared_distance(photon.position_object.xyz, receiver.position) <= receiver.radius2 &&
           floatBitsToUint(photon.position_object.w) == receiver.object &&
           dot(decode_direction(floatBitsToUint(photon.flux_direction.w)), receiver.normal) < 0.0;
}
