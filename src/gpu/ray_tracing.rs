//! Acceleration structures for VK_KHR_ray_query, over the boxes of triangles; see `glsl/trace/ray_query.glsl`.

use std::ffi::CStr;
use std::ops::Range;

use ash::{khr, vk};
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::{Context, OrVulkan};
use super::device::Device;
use super::instance::{DeviceSummary, VulkanInstance};
use super::structures::{BYTES_OF_BOX, Plan, UNPLACED, barrier_after_builds, boxes, ranges_of, record_of};
use crate::error::{Error, Remedy, Result, Setting};
use crate::layout::{Instance, ShadingTriangle};

/// Required extensions.
pub(super) const EXTENSIONS: [&CStr; 3] = [
    khr::acceleration_structure::NAME,
    khr::ray_query::NAME,
    khr::deferred_host_operations::NAME,
];

/// A device's functions, and the layout of the set that binds the acceleration structure.
pub(super) struct RayTracing {
    pub functions: khr::acceleration_structure::Device,
    pub set_layout: vk::DescriptorSetLayout,
    pub scratch_alignment: u64,
    /// Limits of one structure.
    pub max_triangles: u64,
    pub max_instances: u64,
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
            max_triangles: of_structures.max_primitive_count,
            max_instances: of_structures.max_instance_count,
            scratch_alignment: u64::from(of_structures.min_acceleration_structure_scratch_offset_alignment.max(1)),
        })
    }

    pub fn free(&self, device: &ash::Device) {
        // SAFETY: the pipelines that were made with it are gone.
        unsafe { device.destroy_descriptor_set_layout(self.set_layout, None) };
    }
}

/// A scene's structures, and the set that binds them.
#[derive(Default)]
pub(super) struct Acceleration {
    structures: Vec<vk::AccelerationStructureKHR>,
    buffers: Vec<Buffer>,
    pool: vk::DescriptorPool,
    pub set: vk::DescriptorSet,
}

impl Acceleration {
    /// Bytes of the structures.
    pub fn bytes(&self) -> u64 {
        self.buffers.iter().map(|buffer| buffer.bytes).sum()
    }

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

/// Memory that acceleration structures need.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StructureBytes {
    /// Of the structures, at most: they are compacted after they are built.
    pub structures: u64,
    /// The largest single allocation.
    pub at_once: u64,
}

/// The memory for the structures of a scene, see [`Device::trace_through`], on a device that is not open.
///
/// # Errors
/// A device without ray queries, or one that cannot be opened.
pub(crate) fn structure_bytes(
    device: &DeviceSummary,
    own_triangles: u32,
    instances: &[Instance],
) -> Result<StructureBytes> {
    let shared = VulkanInstance::shared()?;
    let mut devices = shared.devices()?.into_iter();
    let found = devices.find(|(_, summary)| summary.index == device.index && summary.name == device.name);
    let Some((physical, _)) = found else {
        return Err(Error::unfit(
            format!("no device {}", device.name),
            Remedy::AnotherDevice,
        ));
    };
    let context = Context::new(shared.clone(), physical, false)?;
    let tracing = context.ray_tracing.as_ref();
    let tracing = tracing.ok_or_else(|| no_ray_query(&device.name))?;
    StructureBytes::of(tracing, &device.name, own_triangles, instances)
}

impl StructureBytes {
    fn of(tracing: &RayTracing, device: &str, own_triangles: u32, instances: &[Instance]) -> Result<Self> {
        let ranges = ranges_of(own_triangles, instances);
        let triangles = ranges.values().map(|range| u64::from(range.end - range.start)).max();
        for (count, most, of) in [
            (triangles.unwrap_or(0), tracing.max_triangles, "triangles in a mesh"),
            (instances.len() as u64 + 1, tracing.max_instances, "instances"),
        ] {
            if count > most {
                let what = format!(
                    "ray-query: device {device} takes {most} {of} at most, not {count}; use bvh or another device"
                );
                return Err(Error::setting(Setting::Accel, what));
            }
        }
        let boxes = ranges.values().map(|range| u64::from(range.end)).max().unwrap_or(0) * BYTES_OF_BOX;
        let bottom: Vec<Plan<'_>> = ranges.values().map(|range| Plan::boxes(tracing, 0, range)).collect();
        let top = Plan::instances(tracing, 0, instances.len() as u32 + 1);
        let bytes: u64 = bottom.iter().map(|plan| plan.bytes).sum();
        let scratch = bottom.iter().chain([&top]).map(|plan| plan.scratch).max().unwrap_or(0);
        Ok(Self {
            structures: bytes + top.bytes,
            at_once: bytes.max(top.bytes).max(scratch).max(boxes),
        })
    }
}

impl Device {
    /// The memory for the structures of a scene, see [`Device::trace_through`].
    ///
    /// # Errors
    /// A device without ray queries, or with too many triangles or instances for it.
    pub fn structure_bytes(&self, own_triangles: u32, instances: &[Instance]) -> Result<StructureBytes> {
        StructureBytes::of(self.ray_tracing()?, &self.summary.name, own_triangles, instances)
    }

    fn ray_tracing(&self) -> Result<&RayTracing> {
        let tracing = self.context.ray_tracing.as_ref();
        tracing.ok_or_else(|| no_ray_query(&self.summary.name))
    }

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
            self.wait_until_idle();
            old.free(&self.context);
        }
        let mut made = Acceleration::default();
        match self.build(triangles, own_triangles, instances, &mut made) {
            Ok(()) => {
                self.acceleration = Some(made);
                Ok(())
            }
            Err(error) => {
                made.free(&self.context);
                Err(error)
            }
        }
    }

    fn build(
        &mut self,
        triangles: &[ShadingTriangle],
        own_triangles: u32,
        instances: &[Instance],
        made: &mut Acceleration,
    ) -> Result<()> {
        let ranges = ranges_of(own_triangles, instances);
        let boxes = boxes(triangles, &ranges, instances);
        let (input, boxes) = build_input(&self.context, "boxes", bytemuck::cast_slice(&boxes))?;
        let plan = |tracing| {
            ranges
                .values()
                .map(|range| Plan::boxes(tracing, boxes, range))
                .collect()
        };
        let bottom = self.ray_tracing().map(plan);
        let built = bottom.and_then(|bottom| self.build_compact(bottom, made));
        input.free(&self.context);
        let bottom = built?;

        let tracing = self.ray_tracing()?;
        let address_of = |first: u32| {
            let at = ranges.keys().position(|&key| key == first);
            at.map_or(0, |at| {
                let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(bottom[at]);
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
        let (input, records) = build_input(&self.context, "placed structures", &records)?;
        let count = instances.len() as u32 + 1;
        let top = self
            .ray_tracing()
            .map(|tracing| vec![Plan::instances(tracing, records, count)]);
        let built = top.and_then(|top| self.build_compact(top, made));
        input.free(&self.context);
        let top = built?[0];
        let context = &self.context;
        made.bind(context, self.ray_tracing()?, top)
    }

    /// Builds structures that do not depend on each other, in as little memory as they need.
    fn build_compact(
        &mut self,
        mut plans: Vec<Plan<'_>>,
        made: &mut Acceleration,
    ) -> Result<Vec<vk::AccelerationStructureKHR>> {
        if plans.is_empty() {
            return Ok(Vec::new());
        }
        let mut loose = Acceleration::default();
        let built = self.build_loose(&mut plans, &mut loose);
        let built = built.and_then(|()| self.compact(&mut plans, made));
        loose.free(&self.context);
        built.map(|()| plans.iter().map(|plan| plan.structure).collect())
    }

    fn build_loose(&mut self, plans: &mut [Plan<'_>], loose: &mut Acceleration) -> Result<()> {
        let tracing = self.ray_tracing()?;
        make_structures(&self.context, tracing, plans, loose)?;
        let most = plans.iter().map(|plan| plan.scratch).max().unwrap_or(0);
        let bytes = most + tracing.scratch_alignment;
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let scratch = addressable(&self.context, "scratch", bytes, MemoryLocation::GpuOnly, usage)?;
        let at = address(&self.context, &scratch);
        let parts = parts_of(plans);
        let built = self.run_in_parts(parts.len(), |context, tracing, commands, part| {
            for plan in &plans[parts[part].clone()] {
                plan.build(context, tracing, commands, at);
            }
        });
        scratch.free(&self.context);
        built
    }

    /// Copies structures to new ones of the size that they need.
    fn compact(&mut self, plans: &mut [Plan<'_>], made: &mut Acceleration) -> Result<()> {
        let loose: Vec<_> = plans.iter().map(|plan| plan.structure).collect();
        for (plan, bytes) in plans.iter_mut().zip(self.compacted_bytes(&loose)?) {
            plan.take(bytes);
        }
        make_structures(&self.context, self.ray_tracing()?, plans, made)?;
        self.run_in_parts(1, |context, tracing, commands, _| {
            for (plan, &from) in plans.iter().zip(&loose) {
                let copy = vk::CopyAccelerationStructureInfoKHR::default()
                    .src(from)
                    .dst(plan.structure)
                    .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
                // SAFETY: the command buffer is recording; both structures live until it has been waited for.
                unsafe { tracing.functions.cmd_copy_acceleration_structure(commands, &copy) };
            }
            barrier_after_builds(context, commands);
        })
    }

    fn compacted_bytes(&mut self, structures: &[vk::AccelerationStructureKHR]) -> Result<Vec<u64>> {
        let count = structures.len() as u32;
        let ty = vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
        let create = vk::QueryPoolCreateInfo::default().query_type(ty).query_count(count);
        // SAFETY: a plain creation call; destroyed below.
        let pool = unsafe { self.context.device.create_query_pool(&create, None) }.or_vulkan("vkCreateQueryPool")?;
        let told = self.run_in_parts(1, |context, tracing, commands, _| {
            // SAFETY: the command buffer is recording; pool and structures live until it has been waited for.
            unsafe {
                context.device.cmd_reset_query_pool(commands, pool, 0, count);
                let functions = &tracing.functions;
                functions.cmd_write_acceleration_structures_properties(commands, structures, ty, pool, 0);
            }
        });
        let mut bytes = vec![0_u64; structures.len()];
        let wait = vk::QueryResultFlags::WAIT;
        // SAFETY: the pool is alive, and nothing uses it after the wait.
        unsafe {
            let device = &self.context.device;
            let read = told.and_then(|()| {
                let read = device.get_query_pool_results(pool, 0, &mut bytes, vk::QueryResultFlags::TYPE_64 | wait);
                read.or_vulkan("vkGetQueryPoolResults")
            });
            device.destroy_query_pool(pool, None);
            read?;
        }
        Ok(bytes)
    }

    /// Runs commands for acceleration structures to their end, each part in a submission of its own.
    fn run_in_parts(
        &mut self,
        parts: usize,
        record: impl Fn(&Context, &RayTracing, vk::CommandBuffer, usize),
    ) -> Result<()> {
        let slot = self.idle_slot()?;
        self.submit(slot, parts, |context, commands, part| {
            if let Some(tracing) = &context.ray_tracing {
                record(context, tracing, commands, part);
            }
        })?;
        self.wait(slot)
    }
}

/// Triangles that are built into structures by one submission, unless a single structure has more: devices build ten million a
/// second and more, and drivers reset those that are busy for seconds.
const TRIANGLES_AT_ONCE: u32 = 1 << 20;

/// Ranges of structures that are built together.
fn parts_of(plans: &[Plan<'_>]) -> Vec<Range<usize>> {
    let (mut parts, mut first, mut triangles) = (Vec::new(), 0, 0_u32);
    for (index, plan) in plans.iter().enumerate() {
        if index > first && triangles.saturating_add(plan.count) > TRIANGLES_AT_ONCE {
            parts.push(first..index);
            (first, triangles) = (index, 0);
        }
        triangles = triangles.saturating_add(plan.count);
    }
    parts.push(first..plans.len());
    parts
}

/// The error for a device without ray queries.
pub(crate) fn no_ray_query(device: &str) -> Error {
    let what = format!("ray-query: device {device} has no VK_KHR_ray_query; use bvh or another device");
    Error::setting(Setting::Accel, what)
}

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

/// Uploads the input of a build; also returns its device address, a multiple of 16.
fn build_input(context: &Context, name: &str, content: &[u8]) -> Result<(Buffer, vk::DeviceAddress)> {
    let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;
    let bytes = content.len() as u64 + 16;
    let mut buffer = addressable(context, name, bytes, MemoryLocation::CpuToGpu, usage)?;
    let address = address(context, &buffer);
    let aligned = address.next_multiple_of(16);
    let from = (aligned - address) as usize;
    buffer.mapped()[from..from + content.len()].copy_from_slice(content);
    Ok((buffer, aligned))
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
