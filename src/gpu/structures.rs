//! Descriptions of acceleration structures, and what they are built from: the boxes of triangles and the places of instances.

use std::collections::BTreeMap;
use std::ops::Range;

use ash::vk;
use glam::{DMat3, DVec3, Vec3};

use super::context::Context;
use super::ray_tracing::RayTracing;
use crate::layout::{Instance, ShadingTriangle};

/// Alignment of structures.
const ALIGNMENT: u64 = 256;
/// Every ray sees every instance.
const ALL: u32 = 0xff << 24;

/// A structure to be built.
pub(super) struct Plan<'a> {
    geometry: vk::AccelerationStructureGeometryKHR<'a>,
    pub ty: vk::AccelerationStructureTypeKHR,
    /// Triangles or instances.
    pub count: u32,
    /// Before it is built: at most.
    pub bytes: u64,
    pub scratch: u64,
    pub structure: vk::AccelerationStructureKHR,
}

impl<'a> Plan<'a> {
    fn new(
        tracing: &RayTracing,
        ty: vk::AccelerationStructureTypeKHR,
        geometry: vk::AccelerationStructureGeometryKHR<'a>,
        count: u32,
    ) -> Self {
        let mut plan = Self {
            geometry,
            ty,
            count,
            bytes: 0,
            scratch: 0,
            structure: vk::AccelerationStructureKHR::null(),
        };
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let on_device = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: the description is valid; addresses in it aren't read.
        unsafe {
            tracing.functions.get_acceleration_structure_build_sizes(
                on_device,
                &plan.description(),
                &[count],
                &mut sizes,
            );
        }
        plan.take(sizes.acceleration_structure_size);
        plan.scratch = sizes.build_scratch_size;
        plan
    }

    /// Sets the size.
    pub fn take(&mut self, bytes: u64) {
        self.bytes = bytes.next_multiple_of(ALIGNMENT);
    }

    pub fn boxes(tracing: &RayTracing, boxes: vk::DeviceAddress, range: &Range<u32>) -> Self {
        let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR {
                device_address: boxes + BYTES_OF_BOX * u64::from(range.start),
            })
            .stride(BYTES_OF_BOX);
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::AABBS)
            .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs });
        let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
        Self::new(tracing, bottom, geometry, range.end - range.start)
    }

    pub fn instances(tracing: &RayTracing, instances: vk::DeviceAddress, count: u32) -> Self {
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(vk::DeviceOrHostAddressConstKHR {
            device_address: instances,
        });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        Self::new(tracing, vk::AccelerationStructureTypeKHR::TOP_LEVEL, geometry, count)
    }

    fn description(&self) -> vk::AccelerationStructureBuildGeometryInfoKHR<'_> {
        vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(self.ty)
            .flags(
                vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE
                    | vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION,
            )
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(std::slice::from_ref(&self.geometry))
    }

    /// Records the build and a barrier after it.
    pub fn build(
        &self,
        context: &Context,
        tracing: &RayTracing,
        commands: vk::CommandBuffer,
        scratch: vk::DeviceAddress,
    ) {
        let mut description = self.description();
        description.dst_acceleration_structure = self.structure;
        description.scratch_data = vk::DeviceOrHostAddressKHR {
            device_address: scratch.next_multiple_of(tracing.scratch_alignment),
        };
        let ranges = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(self.count)];
        // SAFETY: the command buffer is recording; what is built from and into lives until it has been waited for.
        unsafe {
            tracing
                .functions
                .cmd_build_acceleration_structures(commands, &[description], &[&ranges]);
        }
        barrier_after_builds(context, commands);
    }
}

/// Structures that were built or copied can be read, and the memory of a build can be reused.
pub(super) fn barrier_after_builds(context: &Context, commands: vk::CommandBuffer) {
    let builds = vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
    let (read, write) = (
        vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR,
        vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR,
    );
    let built = vk::MemoryBarrier::default()
        .src_access_mask(write)
        .dst_access_mask(read | write);
    let next = builds | vk::PipelineStageFlags::COMPUTE_SHADER;
    let none = vk::DependencyFlags::empty();
    // SAFETY: the command buffer is recording.
    unsafe {
        context
            .device
            .cmd_pipeline_barrier(commands, builds, next, none, &[built], &[], &[]);
    }
}

/// Two corners of three f32.
pub(super) const BYTES_OF_BOX: u64 = 24;

/// Margin of boxes in render space, where triangles lie within about ±1: the rounding of a device's box test is unspecified.
const WIDENING: f64 = 1.0 / 65536.0;

/// Boxes of the triangles, widened by the margin of render space, transformed to the space of each.
pub(super) fn boxes(
    triangles: &[ShadingTriangle],
    ranges: &BTreeMap<u32, Range<u32>>,
    instances: &[Instance],
) -> Vec<[Vec3; 2]> {
    let mut boxes: Vec<[Vec3; 2]> = triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = [triangle.p0, triangle.p1, triangle.p2].map(Vec3::from);
            [a.min(b).min(c), a.max(b).max(c)]
        })
        .collect();
    let mut widenings: BTreeMap<u32, f64> = ranges.keys().map(|&first| (first, WIDENING)).collect();
    for instance in instances {
        let widest = widenings.entry(instance.first_triangle).or_default();
        *widest = widest.max(WIDENING * largest_coordinate(&instance.rows));
    }
    for (first, range) in ranges {
        let by = Vec3::splat(widenings[first] as f32);
        for [low, high] in &mut boxes[range.start as usize..range.end as usize] {
            *low -= by;
            *high += by;
        }
    }
    boxes
}

/// Bound of the coordinates that points of render space have in the space of an instance, where its triangles lie within about ±1.
fn largest_coordinate(rows: &[[f32; 4]; 3]) -> f64 {
    let [x, y, z] = rows.map(|row| row.map(f64::from));
    let linear = DMat3::from_cols_array_2d(&[x, y, z].map(|[a, b, c, _]| [a, b, c])).transpose();
    let inverse = linear.inverse();
    let from = DVec3::new(x[3], y[3], z[3]);
    let abs = DMat3::from_cols(inverse.x_axis.abs(), inverse.y_axis.abs(), inverse.z_axis.abs());
    1.0 + (abs * (DVec3::ONE + from.abs())).max_element()
}

/// The ranges of triangles that are one structure each: those in render space, if any, then those that instances share, by the
/// first triangle.
pub(super) fn ranges_of(own_triangles: u32, instances: &[Instance]) -> BTreeMap<u32, Range<u32>> {
    let own = (own_triangles > 0).then_some(0..own_triangles);
    let shared = instances
        .iter()
        .map(|instance| instance.first_triangle..instance.first_triangle + instance.triangle_count);
    own.into_iter()
        .chain(shared)
        .map(|range| (range.start, range))
        .collect()
}

/// An instance in the device's layout: rows of its transform, mask, flags, structure.
pub(super) fn record_of(rows: &[[f32; 4]; 3], structure: vk::DeviceAddress) -> Vec<u8> {
    let mut record = bytemuck::cast_slice(rows).to_vec();
    for word in [ALL, 0] {
        record.extend_from_slice(&u32::to_ne_bytes(word));
    }
    record.extend_from_slice(&structure.to_ne_bytes());
    record
}

pub(super) const UNPLACED: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
