// Exclusive prefix sum over the invocations of a workgroup, by groups of eight: two sums of few numbers each take fewer
// barriers than doubling distances, and CPU devices pay for those. Uses no subgroup operation: subgroups have 8 to 128
// invocations, depending on the device.

const uint SCAN_GROUP = 8u;

shared uint workgroup_scan_values[gl_WorkGroupSize.x];
shared uint workgroup_scan_groups[gl_WorkGroupSize.x / SCAN_GROUP];

uint workgroup_exclusive_scan(uint value, out uint total) {
    uint me = gl_LocalInvocationID.x;
    uint group = me / SCAN_GROUP;
    // What a call before has read of either array lies a barrier before this one's writes to it.
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
