//! A device with its buffers: what the rest of the program sees of Vulkan.

use std::collections::HashMap;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::{Context, DeviceSummary, Instance, OrVulkan};
use super::pipeline::Pipelines;
use super::self_check;
use crate::error::{Error, Result};
use crate::stage::BufferId;

/// Every Vulkan device of this machine.
///
/// # Errors
/// No loader or no instance.
pub fn devices() -> Result<Vec<DeviceSummary>> {
    Ok(Instance::shared()?
        .devices()?
        .into_iter()
        .map(|(_, summary)| summary)
        .collect())
}

/// An open device and its buffers.
pub struct Device {
    pub(super) summary: DeviceSummary,
    pub(super) loop_limit: u32,
    pub(super) buffers: HashMap<BufferId, Buffer>,
    pub(super) read_back: HashMap<BufferId, Buffer>,
    pub(super) pipelines: Pipelines,
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) fence: vk::Fence,
    // Last: everything above is made from it.
    pub(super) context: Context,
}

impl Device {
    /// Opens the device that `choice` names by index or by a part of its name, or the best one: discrete before
    /// integrated before virtual before CPU.
    ///
    /// # Errors
    /// No loader, no such device, or one that lacks what the program needs.
    pub fn open(choice: Option<&str>) -> Result<Self> {
        let instance = Instance::shared()?;
        let devices = instance.devices()?;
        let (physical, summary) = choose(devices, choice)?;
        if !summary.lacks.is_empty() {
            return Err(Error::Device(format!(
                "device {} ({}) lacks {}; pick another with --device (ppm-vk devices lists them) or use --backend cpu",
                summary.index,
                summary.name,
                summary.lacks.join(", ")
            )));
        }
        let context = Context::new(instance, physical)?;
        // SAFETY: plain creation calls; Drop destroys what they make before the context goes.
        let (pool, commands, fence) = unsafe {
            let create = vk::CommandPoolCreateInfo::default()
                .queue_family_index(context.family)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            let pool = context
                .device
                .create_command_pool(&create, None)
                .or_vulkan("vkCreateCommandPool")?;
            let allocate = vk::CommandBufferAllocateInfo::default()
                .command_pool(pool)
                .command_buffer_count(1);
            let commands = context
                .device
                .allocate_command_buffers(&allocate)
                .or_vulkan("vkAllocateCommandBuffers")?[0];
            let fence = context
                .device
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .or_vulkan("vkCreateFence")?;
            (pool, commands, fence)
        };
        context.name(commands, "commands");
        let mut device = Self {
            summary,
            loop_limit: u32::MAX,
            buffers: HashMap::new(),
            read_back: HashMap::new(),
            pipelines: Pipelines::default(),
            pool,
            commands,
            fence,
            context,
        };
        device.loop_limit = self_check::loop_limit(&mut device)?;
        Ok(device)
    }

    /// Name, driver, limits.
    pub fn summary(&self) -> &DeviceSummary {
        &self.summary
    }

    /// Loop iterations after which the driver ends all loops of an invocation, as measured when the device was
    /// opened; `u32::MAX` if it doesn't.
    pub fn loop_limit(&self) -> u32 {
        self.loop_limit
    }

    /// Makes (or makes anew, with undefined content) the buffer `id`.
    ///
    /// # Errors
    /// No memory, or more bytes than the device can bind.
    pub fn create(&mut self, id: BufferId, bytes: u64) -> Result<()> {
        if bytes > self.summary.max_storage_buffer_bytes {
            return Err(Error::Device(format!(
                "{id:?} needs {} MiB, device {} binds {} MiB at most; try fewer --photons or a smaller --resolution",
                bytes >> 20,
                self.summary.name,
                self.summary.max_storage_buffer_bytes >> 20
            )));
        }
        if let Some(old) = self.buffers.remove(&id) {
            old.free(&self.context);
        }
        let buffer = Buffer::new(&self.context, &format!("{id:?}"), bytes, MemoryLocation::GpuOnly)?;
        self.buffers.insert(id, buffer);
        Ok(())
    }

    /// Makes the buffer `id` with this content.
    ///
    /// # Errors
    /// As [`Device::create`], and failed Vulkan calls.
    pub fn upload<T: bytemuck::NoUninit>(&mut self, id: BufferId, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        self.create(id, bytes.len() as u64)?;
        if bytes.is_empty() {
            return Ok(());
        }
        let mut staging = Buffer::new(&self.context, "staging", bytes.len() as u64, MemoryLocation::CpuToGpu)?;
        staging.mapped()[..bytes.len()].copy_from_slice(bytes);
        let target = self.buffers[&id].handle;
        let result = self.submit(|context, commands| {
            let region = vk::BufferCopy::default().size(bytes.len() as u64);
            // SAFETY: both buffers hold that many bytes and live until the submission has been waited for.
            unsafe {
                context
                    .device
                    .cmd_copy_buffer(commands, staging.handle, target, &[region])
            };
            Ok(())
        });
        staging.free(&self.context);
        result.map(|_| ())
    }

    /// Bytes of the buffer `id`; 0 if it doesn't exist.
    pub fn size(&self, id: BufferId) -> u64 {
        self.buffers.get(&id).map_or(0, |buffer| buffer.bytes)
    }
}

fn choose(
    mut devices: Vec<(vk::PhysicalDevice, DeviceSummary)>,
    choice: Option<&str>,
) -> Result<(vk::PhysicalDevice, DeviceSummary)> {
    let names: Vec<String> = devices
        .iter()
        .map(|(_, summary)| format!("{}: {}", summary.index, summary.name))
        .collect();
    if names.is_empty() {
        return Err(Error::Device(
            "no Vulkan device; install a driver (Debian: mesa-vulkan-drivers) or use --backend cpu".to_owned(),
        ));
    }
    let position = match choice {
        Some(choice) => match choice.parse::<usize>() {
            Ok(index) => devices.iter().position(|(_, summary)| summary.index == index),
            Err(_) => devices
                .iter()
                .position(|(_, summary)| summary.name.to_lowercase().contains(&choice.to_lowercase())),
        },
        None => (0..devices.len()).min_by_key(|&i| {
            let summary = &devices[i].1;
            let rank = ["discrete", "integrated", "virtual", "other", "cpu"];
            (
                !summary.lacks.is_empty(),
                rank.iter().position(|kind| *kind == summary.kind),
                i,
            )
        }),
    };
    let position = position.ok_or_else(|| {
        Error::Device(format!(
            "no device matches --device {}; there are {}",
            choice.unwrap_or(""),
            names.join(", ")
        ))
    })?;
    Ok(devices.swap_remove(position))
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: after the wait nothing uses what is destroyed.
        unsafe {
            let _ = self.context.device.device_wait_idle();
            self.context.device.destroy_fence(self.fence, None);
            self.context.device.destroy_command_pool(self.pool, None);
        }
        self.pipelines.free(&self.context);
        for (_, buffer) in self.buffers.drain().chain(self.read_back.drain()) {
            buffer.free(&self.context);
        }
    }
}
