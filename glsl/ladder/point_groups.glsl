// The visible points of a workgroup. Include after invocation.glsl and visible_point.glsl.

#include "layout.glsl"

// Slots in the order of groups that have one mesh each; after the last group only fillers.
layout(std430) readonly buffer PointOrder { uint point_order[]; };

// Some drivers give each core a contiguous run of workgroups. Empty or slow groups are neighbours, so groups are distributed over
// the workgroups by a factor that is coprime to their number. NO_SLOT after the last group.
uint group_of_workgroup(uint groups, uint factor) {
    uint workgroup = workgroup_index();
    return workgroup < groups ? workgroup * factor % groups : NO_SLOT;
}
