//! A device with its buffers: the interface of src/gpu.

use std::collections::HashMap;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::Context;
use super::descriptors::Descriptors;
use super::instance::{DeviceSummary, VulkanInstance};
use super::pipeline::Pipelines;
use super::pipeline_cache::PipelineCache;
use super::ray_tracing::Acceleration;
use super::submission::Slots;
use crate::error::{Error, Remedy, Result};
use crate::stage::BufferId;
use crate::text;

/// Every Vulkan device of this machine.
///
/// # Errors
/// No loader or no instance.
pub fn devices() -> Result<Vec<DeviceSummary>> {
    Ok(VulkanInstance::shared()?
        .devices()?
        .into_iter()
        .map(|(_, summary)| summary)
        .collect())
}

/// The default device.
///
/// # Errors
/// No loader, or no device.
pub fn best_device() -> Result<DeviceSummary> {
    choose(VulkanInstance::shared()?.devices()?, None).map(|(_, summary)| summary)
}

/// An open device and its buffers.
pub struct Device {
    pub(super) summary: DeviceSummary,
    pub(super) loop_limit: Option<u32>,
    pub(super) buffers: HashMap<BufferId, Buffer>,
    pub(super) pipelines: Pipelines,
    pub(super) descriptors: Descriptors,
    pub(super) acceleration: Option<Acceleration>,
    pub(super) slots: Slots,
    /// Time per invocation of each stage in its last run, in nanoseconds.
    pub(super) thread_ns: HashMap<&'static str, f64>,
    // Last, because everything above is created from it.
    pub(super) context: Context,
}

impl Device {
    /// Opens the device that `choice` names by index or by a part of its name, or the best one: discrete before
    /// integrated before virtual before CPU.
    ///
    /// # Errors
    /// No loader, no such device, or one that lacks what the program needs.
    pub fn open(choice: Option<&str>) -> Result<Self> {
        let instance = VulkanInstance::shared()?;
        let devices = instance.devices()?;
        let (physical, summary) = choose(devices, choice)?;
        check_usable(&summary)?;
        let context = Context::new(instance, physical, false)?;
        let slots = Slots::new(&context)?;
        let cache = PipelineCache::open(&context, physical)?;
        Ok(Self {
            summary,
            loop_limit: None,
            buffers: HashMap::new(),
            pipelines: Pipelines::new(cache, vk::PipelineCreateFlags::empty()),
            descriptors: Descriptors::default(),
            acceleration: None,
            slots,
            thread_ns: HashMap::new(),
            context,
        })
    }

    /// Name, driver, limits.
    pub fn summary(&self) -> &DeviceSummary {
        &self.summary
    }

    /// Whether the validation layer is active: in debug builds, if it is installed.
    pub fn is_validated(&self) -> bool {
        self.context.instance.is_validated()
    }

    /// Creates the buffer `id`, or replaces it, with undefined content.
    ///
    /// # Errors
    /// No memory, or more bytes than the device can bind.
    pub fn create(&mut self, id: BufferId, bytes: u64) -> Result<()> {
        if bytes > self.summary.max_storage_buffer_bytes {
            let what = format!(
                "{id:?} needs {}, device {} binds {} at most",
                text::bytes(bytes),
                self.summary.name,
                text::bytes(self.summary.max_storage_buffer_bytes)
            );
            return Err(Error::unfit(what, remedy(id)));
        }
        self.remove(id);
        let buffer = Buffer::new(&self.context, &format!("{id:?}"), bytes, MemoryLocation::GpuOnly)?;
        self.buffers.insert(id, buffer);
        Ok(())
    }

    /// Waits until the device is not using anything.
    pub(super) fn wait_until_idle(&self) {
        if self.slots.are_busy() {
            // SAFETY: a plain call. What fails here fails where the work is waited for.
            let _ = unsafe { self.context.device.device_wait_idle() };
        }
    }

    /// Frees the memory of the buffer `id`.
    pub(super) fn remove(&mut self, id: BufferId) {
        if let Some(buffer) = self.buffers.remove(&id) {
            self.wait_until_idle();
            self.descriptors.free(&self.context);
            buffer.free(&self.context);
        }
    }

    /// Creates the buffer `id` with this content, or overwrites one of the same size.
    ///
    /// # Errors
    /// As [`Device::create`], and failed Vulkan calls.
    pub fn upload<T: bytemuck::NoUninit>(&mut self, id: BufferId, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let size = bytes.len() as u64;
        if self.size(id) != size.max(4) {
            self.create(id, size)?;
        }
        if bytes.is_empty() {
            return Ok(());
        }
        let mut staging = Buffer::new(&self.context, "staging", size, MemoryLocation::CpuToGpu)?;
        staging.mapped()[..bytes.len()].copy_from_slice(bytes);
        let copied = self.copy(staging.handle, self.buffers[&id].handle, size);
        staging.free(&self.context);
        copied
    }

    /// Frees all buffers and acceleration structures; compiled kernels stay.
    pub fn clear(&mut self) {
        self.wait_until_idle();
        self.descriptors.free(&self.context);
        if let Some(acceleration) = self.acceleration.take() {
            acceleration.free(&self.context);
        }
        for (_, buffer) in self.buffers.drain() {
            buffer.free(&self.context);
        }
    }

    /// Bytes of all buffers and acceleration structures.
    pub fn bytes(&self) -> u64 {
        let buffers: u64 = self.buffers.values().map(|buffer| buffer.bytes).sum();
        buffers + self.built_bytes()
    }

    /// Bytes of the acceleration structures; 0 if there are none.
    pub fn built_bytes(&self) -> u64 {
        self.acceleration.as_ref().map_or(0, Acceleration::bytes)
    }

    /// Bytes of the buffer `id`; 0 if it doesn't exist.
    pub fn size(&self, id: BufferId) -> u64 {
        self.buffers.get(&id).map_or(0, |buffer| buffer.bytes)
    }
}

/// Advice that makes a buffer smaller.
pub(crate) fn remedy(id: BufferId) -> Remedy {
    match id {
        BufferId::Textures | BufferId::Texels => Remedy::SmallerTextures,
        BufferId::Environment => Remedy::SmallerEnvironment,
        BufferId::Bvh
        | BufferId::HavelTriangles
        | BufferId::ShadingTriangles
        | BufferId::Instances
        | BufferId::Materials
        | BufferId::Corners
        | BufferId::Lights
        | BufferId::NearLights
        | BufferId::LightSources
        | BufferId::MediaOfLights
        | BufferId::ObjectGrids => Remedy::SmallerScene,
        _ => Remedy::SmallerRender,
    }
}

fn check_usable(summary: &DeviceSummary) -> Result<()> {
    if summary.lacks.is_empty() {
        return Ok(());
    }
    let what = format!(
        "device {} ({}) lacks {}",
        summary.index,
        summary.name,
        summary.lacks.join(", ")
    );
    Err(Error::unfit(what, Remedy::AnotherDevice))
}

pub(super) fn choose(
    mut devices: Vec<(vk::PhysicalDevice, DeviceSummary)>,
    choice: Option<&str>,
) -> Result<(vk::PhysicalDevice, DeviceSummary)> {
    let names: Vec<String> = devices
        .iter()
        .map(|(_, summary)| format!("{}: {}", summary.index, summary.name))
        .collect();
    if names.is_empty() {
        return Err(Error::unfit("no Vulkan device", Remedy::InstallDriver));
    }
    let position = match choice {
        Some(choice) => named(&devices, choice)?,
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
        Error::Config(format!(
            "no device matches {}; this machine has {}",
            choice.unwrap_or(""),
            names.join(", ")
        ))
    })?;
    Ok(devices.swap_remove(position))
}

/// The index of the device that a user names: by index, by name, or by a part of its name that is unique.
fn named(devices: &[(vk::PhysicalDevice, DeviceSummary)], choice: &str) -> Result<Option<usize>> {
    let index: Option<usize> = choice.parse().ok();
    if let Some(found) = devices.iter().position(|(_, summary)| Some(summary.index) == index) {
        return Ok(Some(found));
    }
    let choice = choice.to_lowercase();
    let places = |is_meant: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..devices.len())
            .filter(|&i| is_meant(&devices[i].1.name.to_lowercase()))
            .collect()
    };
    let whole = places(&|name| name == choice);
    let found = if whole.is_empty() {
        places(&|name| name.contains(&choice))
    } else {
        whole
    };
    if let [_, _, ..] = found[..] {
        let names: Vec<String> = found
            .iter()
            .map(|&i| format!("{}: {}", devices[i].1.index, devices[i].1.name))
            .collect();
        let what = format!("device {choice} may be {}", names.join(", "));
        return Err(Error::unfit(what, Remedy::NameOneDevice));
    }
    Ok(found.first().copied())
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: after the wait nothing uses what is destroyed.
        unsafe {
            let _ = self.context.device.device_wait_idle();
        }
        self.slots.free(&self.context);
        self.descriptors.free(&self.context);
        self.pipelines.free(&self.context);
        if let Some(acceleration) = self.acceleration.take() {
            acceleration.free(&self.context);
        }
        for (_, buffer) in self.buffers.drain() {
            buffer.free(&self.context);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, name: &str, kind: &'static str, lacks: &[&str]) -> (vk::PhysicalDevice, DeviceSummary) {
        let summary = DeviceSummary {
            index,
            name: name.to_owned(),
            driver: String::new(),
            kind,
            api_version: "1.2.0".to_owned(),
            timestamp_period_ns: 1.0,
            subgroup_size: 32,
            max_storage_buffer_bytes: 1 << 27,
            max_texels: 1 << 16,
            max_shared_memory_bytes: 1 << 14,
            max_allocation_bytes: 1 << 30,
            ray_query: false,
            lacks: lacks.iter().map(|&what| what.to_owned()).collect(),
        };
        (vk::PhysicalDevice::null(), summary)
    }

    fn three() -> Vec<(vk::PhysicalDevice, DeviceSummary)> {
        vec![
            device(0, "llvmpipe", "cpu", &[]),
            device(1, "Old Card", "discrete", &["Vulkan 1.2"]),
            device(2, "Small Card", "integrated", &[]),
        ]
    }

    fn chosen(choice: Option<&str>) -> Result<usize> {
        choose(three(), choice).map(|(_, summary)| summary.index)
    }

    #[test]
    fn the_best_device_that_lacks_nothing_is_chosen() {
        assert_eq!(chosen(None).ok(), Some(2));
    }

    #[test]
    fn a_device_is_found_by_index_and_by_a_part_of_its_name() {
        assert_eq!(chosen(Some("0")).ok(), Some(0));
        assert_eq!(chosen(Some("old card")).ok(), Some(1));
    }

    #[test]
    fn a_number_that_is_no_index_is_a_part_of_a_name() {
        let mut devices = three();
        devices.push(device(3, "GeForce RTX 4090", "discrete", &[]));
        let found = choose(devices, Some("4090")).map(|(_, summary)| summary.index);
        assert_eq!(found.ok(), Some(3));
    }

    #[test]
    fn a_name_that_several_devices_have_is_told_with_all_of_them_unless_it_is_whole() {
        let error = chosen(Some("CARD")).expect_err("two cards").to_string();
        assert!(
            error.contains("1: Old Card") && error.contains("2: Small Card") && !error.contains("llvmpipe"),
            "{error}"
        );
        let mut devices = three();
        devices.push(device(3, "Old Card D", "discrete", &[]));
        let found = choose(devices, Some("old card")).map(|(_, summary)| summary.index);
        assert_eq!(found.ok(), Some(1));
    }

    #[test]
    fn a_device_that_is_not_there_is_told_from_those_that_are() {
        let error = chosen(Some("9")).expect_err("no such device").to_string();
        assert!(
            error.contains("matches 9") && error.contains("2: Small Card"),
            "{error}"
        );
    }

    #[test]
    fn a_device_that_lacks_something_is_refused_with_what_it_lacks() {
        let (_, old) = &three()[1];
        let error = check_usable(old).expect_err("it lacks Vulkan 1.2").to_string();
        assert!(
            error.contains("Old Card") && error.contains("lacks Vulkan 1.2"),
            "{error}"
        );
        assert!(error.contains("or the CPU") && !error.contains('\n'), "{error}");
    }
}
