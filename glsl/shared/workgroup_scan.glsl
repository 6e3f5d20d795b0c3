// Exclusive prefix sum over the invocations of a workgroup (Hillis and Steele). Uses no subgroup operation: subgroups
// have 8 to 128 invocations, depending on the device.

shared uint workgroup_scan_values[gl_WorkGroupSize.x];

uint workgroup_exclusive_scan(uint value, out uint total) {
    uint me = gl_LocalInvocationID.x;
    uint inclusive = value;
    for (uint distance = 1u; distance < gl_WorkGroupSize.x; distance *= 2u) {
        barrier();
        workgroup_scan_values[me] = inclusive;
        barrier();
        if (me >= distance) {
            inclusive += workgroup_scan_values[me - distance];
        }
    }
    barrier();
    workgroup_scan_values[me] = inclusive;
    barrier();
    total = workgroup_scan_values[gl_WorkGroupSize.x - 1u];
    return inclusive - value;
}
