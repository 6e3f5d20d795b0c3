// A launch of more workgroups than a dimension may have is laid out in rows; the last row has some too many.

uint workgroup_index() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

uint invocation_index() {
    return workgroup_index() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
}
