//! Logical device, queue, allocator and names of objects.

use std::ffi::{CStr, CString};
use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};

use super::instance::{VulkanInstance, has};
use super::ray_tracing::{self, RayTracing};
use crate::error::{Error, Result};

/// Turns a Vulkan result into the library's.
pub(super) trait OrVulkan<T> {
    fn or_vulkan(self, call: &'static str) -> Result<T>;
}

impl<T> OrVulkan<T> for std::result::Result<T, vk::Result> {
    fn or_vulkan(self, call: &'static str) -> Result<T> {
        self.map_err(|code| Error::Vulkan {
            call,
            code: format!("{code} ({code:?})"),
        })
    }
}

/// A logical device with its queue and its allocator.
pub(super) struct Context {
    // Dropped first: it frees memory of the device.
    pub allocator: ManuallyDrop<Mutex<Allocator>>,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub family: u32,
    pub timestamp_bits: u32,
    debug: Option<ext::debug_utils::Device>,
    /// If the device supports ray queries.
    pub ray_tracing: Option<RayTracing>,
    /// Whether kernels are only compiled. One cannot wait for a null device.
    compiles_only: bool,
    pub instance: Arc<VulkanInstance>,
}

impl Context {
    /// `compiles_only`: to get statistics of compiled kernels, without running any.
    pub fn new(instance: Arc<VulkanInstance>, physical: vk::PhysicalDevice, compiles_only: bool) -> Result<Self> {
        let (family, timestamp_bits) = instance
            .compute_family(physical)
            .ok_or_else(|| Error::Device("the device has no compute queue".to_owned()))?;
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(family)
            .queue_priorities(&priorities)];
        // SAFETY: the physical device belongs to the instance, which the context keeps alive.
        unsafe {
            let extensions = instance.extensions(physical)?;
            let mut names = Vec::new();
            // A device that has it (MoltenVK) requires it. No feature that such a device may lack is used.
            if has(&extensions, khr::portability_subset::NAME) {
                names.push(khr::portability_subset::NAME.as_ptr());
            }
            let mut of_executables =
                vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
            let traces_rays = instance.traces_rays(physical);
            let mut addresses = vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true);
            let mut structures =
                vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
            let mut queries = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
            let mut create = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
            if traces_rays {
                names.extend(ray_tracing::EXTENSIONS.map(CStr::as_ptr));
                create = create
                    .push_next(&mut addresses)
                    .push_next(&mut structures)
                    .push_next(&mut queries);
            }
            if compiles_only {
                names.push(khr::pipeline_executable_properties::NAME.as_ptr());
                create = create.push_next(&mut of_executables);
            }
            let create = create.enabled_extension_names(&names);
            let device = instance
                .handle
                .create_device(physical, &create, None)
                .or_vulkan("vkCreateDevice")?;
            let queue = device.get_device_queue(family, 0);
            let debug = instance
                .labels
                .then(|| ext::debug_utils::Device::new(&instance.handle, &device));
            let allocator = Allocator::new(&AllocatorCreateDesc {
                instance: instance.handle.clone(),
                device: device.clone(),
                physical_device: physical,
                debug_settings: AllocatorDebugSettings::default(),
                buffer_device_address: traces_rays,
                allocation_sizes: AllocationSizes::default(),
            })
            .map_err(|error| Error::Device(format!("no allocator: {error}")))?;
            let ray_tracing = if traces_rays {
                Some(RayTracing::new(&instance.handle, physical, &device)?)
            } else {
                None
            };
            Ok(Self {
                allocator: ManuallyDrop::new(Mutex::new(allocator)),
                device,
                queue,
                family,
                timestamp_bits,
                debug,
                ray_tracing,
                compiles_only,
                instance,
            })
        }
    }

    /// Names an object for debuggers and the validation layer.
    pub fn name<H: vk::Handle>(&self, handle: H, name: &str) {
        if let (Some(debug), Ok(name)) = (&self.debug, CString::new(name)) {
            let info = vk::DebugUtilsObjectNameInfoEXT::default()
                .object_handle(handle)
                .object_name(&name);
            // SAFETY: the handle is alive: its creator calls this. A failure costs the name alone.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }

    /// Opens a labelled region in a command buffer.
    pub fn begin_label(&self, commands: vk::CommandBuffer, name: &str) {
        if let (Some(debug), Ok(name)) = (&self.debug, CString::new(name)) {
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: the command buffer is recording.
            unsafe { debug.cmd_begin_debug_utils_label(commands, &label) };
        }
    }

    /// Closes it.
    pub fn end_label(&self, commands: vk::CommandBuffer) {
        if let Some(debug) = &self.debug {
            // SAFETY: as above.
            unsafe { debug.cmd_end_debug_utils_label(commands) };
        }
    }

    /// Messages of the validation layer since the last call.
    pub fn take_messages(&self) -> Vec<String> {
        self.instance.take_messages()
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: buffers, pipelines and pools are gone: Device drops them before the context.
        unsafe {
            if !self.compiles_only {
                let _ = self.device.device_wait_idle();
            }
            if let Some(ray_tracing) = &self.ray_tracing {
                ray_tracing.free(&self.device);
            }
            ManuallyDrop::drop(&mut self.allocator);
            self.device.destroy_device(None);
        }
        let messages = self.take_messages();
        if !messages.is_empty() && !std::thread::panicking() {
            panic!("validation at teardown: {}", messages.join("\n"));
        }
    }
}
