//! Loader, instance, physical devices, and the validation layer's messages.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use ash::{ext, khr, vk};
use serde::Serialize;

use super::context::OrVulkan;
use super::ray_tracing;
use crate::error::{Error, Remedy, Result};
use crate::shaders;

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const API_VERSION: u32 = vk::API_VERSION_1_2;

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

type Messages = Arc<Mutex<Vec<String>>>;

/// Loader and instance.
pub(super) struct VulkanInstance {
    _entry: ash::Entry, // keeps the loader
    pub handle: ash::Instance,
    /// Whether objects and passes can be named.
    pub labels: bool,
    debug: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Messages,
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

pub(super) fn has(extensions: &[vk::ExtensionProperties], name: &CStr) -> bool {
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

    /// Messages of the validation layer since the last call.
    pub fn take_messages(&self) -> Vec<String> {
        self.messages
            .lock()
            .map(|mut messages| std::mem::take(&mut *messages))
            .unwrap_or_default()
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
    pub fn traces_rays(&self, device: vk::PhysicalDevice) -> bool {
        let found = self.extensions(device).unwrap_or_default();
        ray_tracing::EXTENSIONS.iter().all(|name| has(&found, name)) && ray_tracing::has_features(&self.handle, device)
    }

    pub fn extensions(&self, device: vk::PhysicalDevice) -> Result<Vec<vk::ExtensionProperties>> {
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
