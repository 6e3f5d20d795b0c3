// Exclusive prefix sum over the invocations of a workgroup, by groups of eight: this takes fewer barriers than doubling
// distances, and barriers are expensive on CPU devices. Uses no subgroup operations: subgroups have 8 to 128 invocations,
// depending on the device.

const uint SCAN_GROUP = 8u;

shared uint workgroup_scan_values[gl_WorkGroupSize.x];
shared uint workgroup_scan_groups[gl_WorkGroupSize.x / SCAN_GROUP];

uint workgroup_exclusive_scan(uint value, out uint total) {
    uint me = gl_LocalInvocationID.x;
    uint group = me / SCAN_GROUP;
    // A barrier separates the reads of a previous call from this call's writes to the same array.
    workgroup_scan_values[me] = value;
    barrier();
    uint before = 0u;
    for (uint other = group * SCAN_GROUP; other < me; other++) {
        before += workgroup_scan_values[other];
    }
    if (me % SCAN_GROUP == SCAN_GROUP - 1u) {
        workgroup_scan_groups[group] = before + value;
    }
    barrier();
    total = 0u;
    for (uint other = 0u; other < gl_WorkGroupSize.x / SCAN_GROUP; other++) {
        before += other < group ? workgroup_scan_groups[other] : 0u;
        total += workgroup_scan_groups[other];
    }
    return before;
}
