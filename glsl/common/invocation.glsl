// A launch of more workgroups than the limit of a dimension is laid out in rows; the last row may have surplus workgroups.

uint workgroup_index() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

uint invocation_index() {
    return workgroup_index() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
}
