//! Loader, instance, physical and logical device, queue, allocator and the validation layer's messages.

use std::ffi::{CStr, CString, c_void};
use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};
use serde::Serialize;

use super::ray_tracing::{self, RayTracing};
use crate::error::{Error, Remedy, Result};
use crate::shaders;

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const API_VERSION: u32 = vk::API_VERSION_1_2;

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

/// Properties of a Vulkan device, for users.
#[derive(Debug, Clone, Serialize)]
pub struct DeviceSummary {
    /// Index in the order that Vulkan lists devices.
    pub index: usize,
    /// Name.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: &'static str,
    /// Vulkan version.
    pub api_version: String,
    /// Nanoseconds of a timestamp tick.
    pub timestamp_period_ns: f32,
    /// Invocations of a subgroup.
    pub subgroup_size: u32,
    /// Bytes that one storage buffer binding can span.
    pub max_storage_buffer_bytes: u64,
    /// 16-byte texels that one texel buffer can have.
    pub max_texels: u32,
    /// Bytes of shared memory of a workgroup.
    pub max_shared_memory_bytes: u32,
    /// Bytes that can be allocated at once.
    pub max_allocation_bytes: u64,
    /// Whether it supports ray queries (VK_KHR_ray_query).
    pub ray_query: bool,
    /// Requirements that the device does not meet; empty if it is usable.
    pub lacks: Vec<String>,
}

pub(super) type Messages = Arc<Mutex<Vec<String>>>;

/// Loader and instance.
pub(super) struct VulkanInstance {
    _entry: ash::Entry, // keeps the loader
    pub handle: ash::Instance,
    /// Whether objects and passes can be named.
    labels: bool,
    debug: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub messages: Messages,
}

unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data, and `messages` outlives the messenger (see VulkanInstance).
    unsafe {
        let text = (*data)
            .message_as_c_str()
            .unwrap_or(c"(no text)")
            .to_string_lossy()
            .into_owned();
        let messages = &*messages.cast::<Mutex<Vec<String>>>();
        if let Ok(mut messages) = messages.lock() {
            messages.push(text);
        }
    }
    vk::FALSE
}

fn has(extensions: &[vk::ExtensionProperties], name: &CStr) -> bool {
    extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name))
}

/// The current instance, if any. Some loaders crash if one thread creates an instance while another names an object.
static SHARED: Mutex<Weak<VulkanInstance>> = Mutex::new(Weak::new());

impl VulkanInstance {
    /// The instance of the process.
    pub fn shared() -> Result<Arc<Self>> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(instance) = shared.upgrade() {
            return Ok(instance);
        }
        let instance = Arc::new(Self::new()?);
        *shared = Arc::downgrade(&instance);
        Ok(instance)
    }

    /// Loads Vulkan. Debug builds turn on the validation layer where it is installed.
    fn new() -> Result<Self> {
        // SAFETY: the loader is the system's own.
        let entry = unsafe { ash::Entry::load() }
            .map_err(|error| Error::unfit(format!("no Vulkan loader: {error}"), Remedy::InstallLoader))?;
        let messages = Messages::default();
        // SAFETY: plain Vulkan calls on a live entry; pointers outlive the calls.
        unsafe {
            let layers = entry
                .enumerate_instance_layer_properties()
                .or_vulkan("vkEnumerateInstanceLayerProperties")?;
            let validate = cfg!(debug_assertions)
                && layers
                    .iter()
                    .any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER));
            let extensions = entry
                .enumerate_instance_extension_properties(None)
                .or_vulkan("vkEnumerateInstanceExtensionProperties")?;
            let debug_utils = validate || has(&extensions, ext::debug_utils::NAME);
            // MoltenVK is listed only with this flag.
            let portability = has(&extensions, khr::portability_enumeration::NAME);
            let application = vk::ApplicationInfo::default()
                .application_name(c"ppm-vk")
                .api_version(API_VERSION);
            let layer_names = if validate {
                vec![VALIDATION_LAYER.as_ptr()]
            } else {
                Vec::new()
            };
            let mut extension_names = Vec::new();
            if debug_utils {
                extension_names.push(ext::debug_utils::NAME.as_ptr());
            }
            if portability {
                extension_names.push(khr::portability_enumeration::NAME.as_ptr());
            }
            let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
            if validate {
                extension_names.push(ext::validation_features::NAME.as_ptr());
            }
            let mut create = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_layer_names(&layer_names)
                .enabled_extension_names(&extension_names);
            if validate {
                create = create.push_next(&mut features);
            }
            if portability {
                create = create.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
            }
            let handle = entry
                .create_instance(&create, None)
                .map_err(|code| Error::unfit(format!("no Vulkan instance: {code}"), Remedy::InstallDriver))?;
            let debug = if validate {
                let debug = ext::debug_utils::Instance::new(&entry, &handle);
                let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                    .message_severity(
                        vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                    )
                    .message_type(
                        vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
                    )
                    .pfn_user_callback(Some(on_message))
                    .user_data(Arc::as_ptr(&messages).cast_mut().cast());
                let messenger = debug
                    .create_debug_utils_messenger(&info, None)
                    .or_vulkan("vkCreateDebugUtilsMessengerEXT")?;
                Some((debug, messenger))
            } else {
                None
            };
            Ok(Self {
                _entry: entry,
                handle,
                labels: debug_utils,
                debug,
                messages,
            })
        }
    }

    /// Whether the validation layer is on.
    pub fn is_validated(&self) -> bool {
        self.debug.is_some()
    }

    /// Every device, usable or not.
    pub fn devices(&self) -> Result<Vec<(vk::PhysicalDevice, DeviceSummary)>> {
        // SAFETY: the instance is live.
        let devices = unsafe { self.handle.enumerate_physical_devices() }.or_vulkan("vkEnumeratePhysicalDevices")?;
        Ok(devices
            .into_iter()
            .enumerate()
            .map(|(index, device)| (device, self.summary(index, device)))
            .collect())
    }

    fn summary(&self, index: usize, device: vk::PhysicalDevice) -> DeviceSummary {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut maintenance = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut subgroup)
            .push_next(&mut maintenance)
            .push_next(&mut driver);
        // SAFETY: the device belongs to this instance.
        unsafe { self.handle.get_physical_device_properties2(device, &mut properties) };
        let properties = properties.properties;
        let limits = properties.limits;
        let text = |chars: Option<&CStr>| chars.map_or_else(String::new, |c| c.to_string_lossy().into_owned());
        let mut lacks = Vec::new();
        if properties.api_version < API_VERSION {
            lacks.push("Vulkan 1.2".to_owned());
        }
        match self.compute_family(device) {
            None => lacks.push("a compute queue".to_owned()),
            Some((_, 0)) => lacks.push("timestamps on its compute queue".to_owned()),
            Some(_) => {}
        }
        let buffers = shaders::ALL
            .iter()
            .map(|shader| shader.storage_buffers())
            .max()
            .unwrap_or(0) as u32;
        if limits.max_per_stage_descriptor_storage_buffers < buffers {
            lacks.push(format!("{buffers} storage buffers a stage"));
        }
        let threads = shaders::ALL.iter().map(|shader| shader.workgroup).max().unwrap_or(0);
        if limits.max_compute_work_group_invocations < threads || limits.max_compute_work_group_size[0] < threads {
            lacks.push(format!("workgroups of {threads} invocations"));
        }
        let version = |v: u32| {
            format!(
                "{}.{}.{}",
                vk::api_version_major(v),
                vk::api_version_minor(v),
                vk::api_version_patch(v)
            )
        };
        DeviceSummary {
            index,
            name: text(properties.device_name_as_c_str().ok()),
            driver: format!(
                "{} {}",
                text(driver.driver_name_as_c_str().ok()),
                text(driver.driver_info_as_c_str().ok())
            )
            .trim()
            .to_owned(),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
                vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
                vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
                vk::PhysicalDeviceType::CPU => "cpu",
                _ => "other",
            },
            api_version: version(properties.api_version),
            timestamp_period_ns: limits.timestamp_period,
            subgroup_size: subgroup.subgroup_size,
            max_storage_buffer_bytes: u64::from(limits.max_storage_buffer_range),
            max_texels: limits.max_texel_buffer_elements,
            max_shared_memory_bytes: limits.max_compute_shared_memory_size,
            max_allocation_bytes: maintenance.max_memory_allocation_size,
            ray_query: lacks.is_empty() && self.traces_rays(device),
            lacks,
        }
    }

    /// Whether a device's driver reports statistics of compiled kernels.
    pub fn tells_statistics(&self, device: vk::PhysicalDevice) -> Result<bool> {
        Ok(has(
            &self.extensions(device)?,
            khr::pipeline_executable_properties::NAME,
        ))
    }

    /// Whether a device supports ray queries.
    fn traces_rays(&self, device: vk::PhysicalDevice) -> bool {
        let found = self.extensions(device).unwrap_or_default();
        ray_tracing::EXTENSIONS.iter().all(|name| has(&found, name)) && ray_tracing::has_features(&self.handle, device)
    }

    fn extensions(&self, device: vk::PhysicalDevice) -> Result<Vec<vk::ExtensionProperties>> {
        // SAFETY: the device is one of this instance's.
        unsafe { self.handle.enumerate_device_extension_properties(device) }
            .or_vulkan("vkEnumerateDeviceExtensionProperties")
    }

    /// A compute queue family, preferably without graphics, and the valid bits of its timestamps.
    pub fn compute_family(&self, device: vk::PhysicalDevice) -> Option<(u32, u32)> {
        // SAFETY: the device belongs to this instance.
        let families = unsafe { self.handle.get_physical_device_queue_family_properties(device) };
        let computes = families
            .iter()
            .enumerate()
            .filter(|(_, f)| f.queue_flags.contains(vk::QueueFlags::COMPUTE));
        computes
            .min_by_key(|(_, f)| {
                (
                    f.timestamp_valid_bits == 0,
                    f.queue_flags.contains(vk::QueueFlags::GRAPHICS),
                )
            })
            .map(|(index, family)| (index as u32, family.timestamp_valid_bits))
    }
}

impl Drop for VulkanInstance {
    fn drop(&mut self) {
        // SAFETY: everything made from the instance is gone: Context, its only user, drops it last.
        unsafe {
            if let Some((debug, messenger)) = &self.debug {
                debug.destroy_debug_utils_messenger(*messenger, None);
            }
            self.handle.destroy_instance(None);
        }
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
        self.instance
            .messages
            .lock()
            .map(|mut messages| std::mem::take(&mut *messages))
            .unwrap_or_default()
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
