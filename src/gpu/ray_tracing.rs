//! Acceleration structures for VK_KHR_ray_query, over the boxes of triangles; see `glsl/trace/ray_query.glsl`.

use std::collections::BTreeMap;
use std::ffi::CStr;
use std::ops::Range;

use ash::{khr, vk};
use glam::{DMat3, DVec3, Vec3};
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::{Context, OrVulkan};
use super::device::Device;
use crate::error::{Error, Result, Setting};
use crate::layout::{Instance, ShadingTriangle};

/// Required extensions.
pub(super) const EXTENSIONS: [&CStr; 3] = [
    khr::acceleration_structure::NAME,
    khr::ray_query::NAME,
    khr::deferred_host_operations::NAME,
];

/// Alignment of structures.
const ALIGNMENT: u64 = 256;
/// Every ray sees every instance.
const ALL: u32 = 0xff << 24;

/// A device's functions, and the layout of the set that binds the acceleration structure.
pub(super) struct RayTracing {
    functions: khr::acceleration_structure::Device,
    pub set_layout: vk::DescriptorSetLayout,
    scratch_alignment: u64,
}

/// Whether a device with [`EXTENSIONS`] has the features too.
pub(super) fn has_features(instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
    let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut queries = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut addresses = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
    let mut features = vk::PhysicalDeviceFeatures2::default()
        .push_next(&mut structures)
        .push_next(&mut queries)
        .push_next(&mut addresses);
    // SAFETY: the device belongs to the instance and has the extensions of the structs.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    [
        structures.acceleration_structure,
        queries.ray_query,
        addresses.buffer_device_address,
    ]
    .iter()
    .all(|&has| has == vk::TRUE)
}

impl RayTracing {
    pub fn new(instance: &ash::Instance, physical: vk::PhysicalDevice, device: &ash::Device) -> Result<Self> {
        let mut of_structures = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut of_structures);
        let bindings = [vk::DescriptorSetLayoutBinding::default()
            .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
            .descriptor_count(1)
            .stage_flags(vk::ShaderStageFlags::COMPUTE)];
        // SAFETY: plain calls; `free` destroys the layout.
        let set_layout = unsafe {
            instance.get_physical_device_properties2(physical, &mut properties);
            let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            device.create_descriptor_set_layout(&create, None)
        };
        Ok(Self {
            functions: khr::acceleration_structure::Device::new(instance, device),
            set_layout: set_layout.or_vulkan("vkCreateDescriptorSetLayout")?,
            scratch_alignment: u64::from(of_structures.min_acceleration_structure_scratch_offset_alignment.max(1)),
        })
    }

    pub fn free(&self, device: &ash::Device) {
        // SAFETY: the pipelines that were made with it are gone.
        unsafe { device.destroy_descriptor_set_layout(self.set_layout, None) };
    }
}

/// A scene's structures, and the set that binds them.
pub(super) struct Acceleration {
    structures: Vec<vk::AccelerationStructureKHR>,
    buffers: Vec<Buffer>,
    pool: vk::DescriptorPool,
    pub set: vk::DescriptorSet,
}

impl Acceleration {
    /// The device must not be using it.
    pub fn free(self, context: &Context) {
        // SAFETY: as the caller says.
        unsafe {
            context.device.destroy_descriptor_pool(self.pool, None);
            if let Some(tracing) = &context.ray_tracing {
                for structure in self.structures {
                    tracing.functions.destroy_acceleration_structure(structure, None);
                }
            }
        }
        for buffer in self.buffers {
            buffer.free(context);
        }
    }
}

/// A structure to be built.
struct Plan<'a> {
    geometry: vk::AccelerationStructureGeometryKHR<'a>,
    ty: vk::AccelerationStructureTypeKHR,
    /// Triangles or instances.
    count: u32,
    bytes: u64,
    scratch: u64,
    structure: vk::AccelerationStructureKHR,
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
        plan.bytes = sizes.acceleration_structure_size.next_multiple_of(ALIGNMENT);
        plan.scratch = sizes.build_scratch_size;
        plan
    }

    fn boxes(tracing: &RayTracing, boxes: vk::DeviceAddress, range: &Range<u32>) -> Self {
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

    fn instances(tracing: &RayTracing, instances: vk::DeviceAddress, count: u32) -> Self {
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
            .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(std::slice::from_ref(&self.geometry))
    }

    /// Records the build and a barrier after it.
    fn build(&self, context: &Context, tracing: &RayTracing, commands: vk::CommandBuffer, scratch: vk::DeviceAddress) {
        let mut description = self.description();
        description.dst_acceleration_structure = self.structure;
        description.scratch_data = vk::DeviceOrHostAddressKHR {
            device_address: scratch.next_multiple_of(tracing.scratch_alignment),
        };
        let ranges = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(self.count)];
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
        // SAFETY: the command buffer is recording; what is built from and into lives until it has been waited for.
        unsafe {
            tracing
                .functions
                .cmd_build_acceleration_structures(commands, &[description], &[&ranges]);
            context
                .device
                .cmd_pipeline_barrier(commands, builds, next, none, &[built], &[], &[]);
        }
    }
}

/// Two corners of three f32.
const BYTES_OF_BOX: u64 = 24;

/// Margin of boxes in render space, where triangles lie within about ±1: the rounding of a device's box test is unspecified.
const WIDENING: f64 = 1.0 / 65536.0;

/// Boxes of the triangles, widened by the margin of render space, transformed to the space of each.
fn boxes(triangles: &[ShadingTriangle], ranges: &BTreeMap<u32, Range<u32>>, instances: &[Instance]) -> Vec<[Vec3; 2]> {
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
fn ranges_of(own_triangles: u32, instances: &[Instance]) -> BTreeMap<u32, Range<u32>> {
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
fn record_of(rows: &[[f32; 4]; 3], structure: vk::DeviceAddress) -> Vec<u8> {
    let mut record = bytemuck::cast_slice(rows).to_vec();
    for word in [ALL, 0] {
        record.extend_from_slice(&u32::to_ne_bytes(word));
    }
    record.extend_from_slice(&structure.to_ne_bytes());
    record
}

const UNPLACED: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

impl Device {
    /// Builds the acceleration structures: the first `own_triangles` triangles are in render space, the others are placed by
    /// instances.
    ///
    /// # Errors
    /// A device without ray queries, no memory, or a failed Vulkan call.
    pub fn trace_through(
        &mut self,
        triangles: &[ShadingTriangle],
        own_triangles: u32,
        instances: &[Instance],
    ) -> Result<()> {
        if let Some(old) = self.acceleration.take() {
            old.free(&self.context);
        }
        let mut temporary = Vec::new();
        let built = self.build(triangles, own_triangles, instances, &mut temporary);
        for buffer in temporary {
            buffer.free(&self.context);
        }
        built
    }

    /// `temporary` is not needed after the build.
    fn build(
        &mut self,
        triangles: &[ShadingTriangle],
        own_triangles: u32,
        instances: &[Instance],
        temporary: &mut Vec<Buffer>,
    ) -> Result<()> {
        let context = &self.context;
        let tracing = context
            .ray_tracing
            .as_ref()
            .ok_or_else(|| no_ray_query(&self.summary.name))?;
        let ranges = ranges_of(own_triangles, instances);
        let boxes = boxes(triangles, &ranges, instances);
        let boxes = input(context, "boxes", bytemuck::cast_slice(&boxes), temporary)?;
        let mut plans: Vec<Plan<'_>> = ranges
            .values()
            .map(|range| Plan::boxes(tracing, boxes, range))
            .collect();

        // From here on, failures have to free resources.
        let mut made = Acceleration {
            structures: Vec::new(),
            buffers: Vec::new(),
            pool: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
        };
        let result = (|| {
            make_structures(context, tracing, &mut plans, &mut made)?;
            let address_of = |first: u32| {
                let at = ranges.keys().position(|&key| key == first);
                at.map_or(0, |at| {
                    let info = vk::AccelerationStructureDeviceAddressInfoKHR::default()
                        .acceleration_structure(plans[at].structure);
                    // SAFETY: the structure is alive.
                    unsafe { tracing.functions.get_acceleration_structure_device_address(&info) }
                })
            };
            // An instance whose structure has the address 0 is inactive.
            let own = if own_triangles > 0 { address_of(0) } else { 0 };
            let mut records = record_of(&UNPLACED, own);
            for instance in instances {
                records.extend(record_of(&instance.rows, address_of(instance.first_triangle)));
            }
            let records = input(context, "placed structures", &records, temporary)?;
            let mut top = [Plan::instances(tracing, records, instances.len() as u32 + 1)];
            make_structures(context, tracing, &mut top, &mut made)?;
            let [top] = top;
            made.bind(context, tracing, top.structure)?;
            let most = plans.iter().chain([&top]).map(|plan| plan.scratch).max().unwrap_or(0);
            let bytes = most + tracing.scratch_alignment;
            let scratch = addressable(context, "scratch", bytes, MemoryLocation::GpuOnly, SCRATCH)?;
            let address = address(context, &scratch);
            temporary.push(scratch);
            Ok((top, address))
        })();
        match result {
            Ok((top, scratch)) => {
                self.acceleration = Some(made);
                let slot = self.idle_slot()?;
                let plans: Vec<_> = plans.into_iter().chain([top]).collect();
                self.submit(slot, 1, |context, commands, _| {
                    if let Some(tracing) = &context.ray_tracing {
                        for plan in &plans {
                            plan.build(context, tracing, commands, scratch);
                        }
                    }
                })?;
                self.wait(slot)
            }
            Err(error) => {
                made.free(context);
                Err(error)
            }
        }
    }
}

/// The error for a device without ray queries.
pub(crate) fn no_ray_query(device: &str) -> Error {
    let what = format!("ray-query: device {device} has no VK_KHR_ray_query; use bvh or another device");
    Error::setting(Setting::Accel, what)
}

const SCRATCH: vk::BufferUsageFlags = vk::BufferUsageFlags::STORAGE_BUFFER;

fn addressable(
    context: &Context,
    name: &str,
    bytes: u64,
    location: MemoryLocation,
    usage: vk::BufferUsageFlags,
) -> Result<Buffer> {
    let usage = usage | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
    Buffer::with_usage(context, name, bytes, location, usage)
}

fn address(context: &Context, buffer: &Buffer) -> vk::DeviceAddress {
    let info = vk::BufferDeviceAddressInfo::default().buffer(buffer.handle);
    // SAFETY: the buffer is alive, and was made to have an address.
    unsafe { context.device.get_buffer_device_address(&info) }
}

/// Uploads the input of a build; returns its device address, a multiple of 16.
fn input(context: &Context, name: &str, content: &[u8], into: &mut Vec<Buffer>) -> Result<vk::DeviceAddress> {
    let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;
    let bytes = content.len() as u64 + 16;
    let mut buffer = addressable(context, name, bytes, MemoryLocation::CpuToGpu, usage)?;
    let address = address(context, &buffer);
    let aligned = address.next_multiple_of(16);
    let from = (aligned - address) as usize;
    buffer.mapped()[from..from + content.len()].copy_from_slice(content);
    into.push(buffer);
    Ok(aligned)
}

/// Creates structures side by side in one buffer.
fn make_structures(
    context: &Context,
    tracing: &RayTracing,
    plans: &mut [Plan<'_>],
    made: &mut Acceleration,
) -> Result<()> {
    let bytes: u64 = plans.iter().map(|plan| plan.bytes).sum();
    let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
    let buffer = addressable(context, "structures for rays", bytes, MemoryLocation::GpuOnly, usage)?;
    let handle = buffer.handle;
    made.buffers.push(buffer);
    let mut offset = 0;
    for plan in plans {
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(handle)
            .offset(offset)
            .size(plan.bytes)
            .ty(plan.ty);
        // SAFETY: the buffer has room for it, and is freed after it.
        let structure = unsafe { tracing.functions.create_acceleration_structure(&create, None) };
        plan.structure = structure.or_vulkan("vkCreateAccelerationStructureKHR")?;
        made.structures.push(plan.structure);
        offset += plan.bytes;
    }
    Ok(())
}

impl Acceleration {
    fn bind(&mut self, context: &Context, tracing: &RayTracing, top: vk::AccelerationStructureKHR) -> Result<()> {
        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
            .descriptor_count(1)];
        let create = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        let layouts = [tracing.set_layout];
        // SAFETY: plain creation calls; `free` destroys what they make.
        unsafe {
            self.pool = context
                .device
                .create_descriptor_pool(&create, None)
                .or_vulkan("vkCreateDescriptorPool")?;
            let allocate = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(self.pool)
                .set_layouts(&layouts);
            self.set = context
                .device
                .allocate_descriptor_sets(&allocate)
                .or_vulkan("vkAllocateDescriptorSets")?[0];
            let structures = [top];
            let mut write =
                vk::WriteDescriptorSetAccelerationStructureKHR::default().acceleration_structures(&structures);
            let write = vk::WriteDescriptorSet::default()
                .dst_set(self.set)
                .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
                .descriptor_count(1)
                .push_next(&mut write);
            context.device.update_descriptor_sets(&[write], &[]);
        }
        Ok(())
    }
}
