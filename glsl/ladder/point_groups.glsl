// Which visible points a workgroup gathers for. Include after invocation.glsl and visible_point.glsl.

#include "layout.glsl"

// Slots in the order of groups that have one mesh each; past the last group there are fillers alone.
layout(std430) readonly buffer PointOrder { uint point_order[]; };

// Some drivers give each core a run of the workgroups. The groups that are empty, or slow, lie together: they are dealt to
// all in turn, by a factor that has no divisor in common with their number. NO_SLOT past the last group.
uint group_of_workgroup(uint groups, uint factor) {
    uint workgroup = workgroup_index();
    return workgroup < groups ? workgroup * factor % groups : NO_SLOT;
}
