// Common parts of the gathers that test every photon, or every photon of a mesh. Include after gather.glsl and point_groups.glsl.

// Visible points in the order of PointOrder, whose workgroups have one mesh each; otherwise in the order of slots.
layout(constant_id = 1) const bool ORDERED = false;
// Photons are sorted by mesh; a visible point tests those of its own mesh.
layout(constant_id = 2) const bool BY_MESH = false;
// Photons beyond R are rejected by the built-in distance() instead of a squared distance.
layout(constant_id = 3) const bool DISTANCE = false;

layout(push_constant) uniform ExhaustivePush {
    uint first;  // the photons of this launch: drivers cut long loops
    uint end;
    uint stride; // only every stride-th group of visible points is processed: 1 except in benches
    uint groups; // number of groups that are processed
    uint factor; // see group_of_workgroup
    uint map;    // of photons
} push;

layout(std430) readonly buffer PhotonCount { uint photon_count; };
layout(std430) readonly buffer MeshEnds { uint mesh_ends[]; }; // one past each mesh's last photon

// Slot of the visible point at a position of this workgroup; NO_SLOT for a filler.
uint slot_at(uint place) {
    uint group = group_of_workgroup(push.groups, push.factor);
    if (group == NO_SLOT) {
        return NO_SLOT;
    }
    uint i = group * push.stride * gl_WorkGroupSize.x + place;
    if (ORDERED) {
        return i < point_order.length() ? point_order[i] : NO_SLOT;
    }
    return i < slots() ? i : NO_SLOT;
}

// First and end of the photons to test in this launch for a visible point on `object`.
uvec2 photons_to_test(uint object) {
    if (object == NO_OBJECT) {
        return uvec2(0u);
    }
    uvec2 range = uvec2(0u, photon_count);
    if (BY_MESH) {
        uint mesh = object & ~CAUSTIC;
        range = uvec2(mesh == 0u ? 0u : mesh_ends[mesh - 1u], mesh_ends[mesh]);
    }
    range = uvec2(max(range.x, push.first), min(range.y, push.end));
    return uvec2(range.x, max(range.x, range.y));
}

void test(Receiver receiver, float radius, Photon photon, inout Sum sum) {
    // The rounding of the built-in is unspecified; the margin leaves the decision to the common predicate.
    bool far = DISTANCE ? distance(photon.position, receiver.position) > radius * 1.00001 : false;
    if (!far) {
        gather(receiver, photon, sum);
    }
}
