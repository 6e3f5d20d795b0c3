//! Statistics of compiled kernels by the driver: registers, spills, subgroups that fit. Needs
//! VK_KHR_pipeline_executable_properties. RADV compiles for absent GPUs too (RADV_FORCE_FAMILY), so nothing is run here.

use ash::{khr, vk};

use super::context::{Context, OrVulkan};
use super::device::choose;
use super::instance::{DeviceSummary, VulkanInstance};
use super::pipeline::Pipelines;
use super::pipeline_cache::PipelineCache;
use crate::error::{Error, Remedy, Result};
use crate::stage::StageDesc;

/// A device that compiles kernels and runs none.
pub struct Compiler {
    summary: DeviceSummary,
    pipelines: Pipelines,
    properties: khr::pipeline_executable_properties::Device,
    context: Context,
}

impl Compiler {
    /// Opens the device that `choice` names or numbers, or the best.
    ///
    /// # Errors
    /// No such device, or a driver that reports no statistics.
    pub fn open(choice: Option<&str>) -> Result<Self> {
        let instance = VulkanInstance::shared()?;
        let (physical, summary) = choose(instance.devices()?, choice)?;
        if !instance.tells_statistics(physical)? {
            return Err(Error::unfit(
                format!(
                    "device {} ({}) doesn't tell what it compiles kernels to (VK_KHR_pipeline_executable_properties)",
                    summary.index, summary.name
                ),
                Remedy::AnotherVulkanDevice,
            ));
        }
        let context = Context::new(instance, physical, true)?;
        let properties = khr::pipeline_executable_properties::Device::new(&context.instance.handle, &context.device);
        Ok(Self {
            summary,
            pipelines: Pipelines::new(
                PipelineCache::empty(&context)?,
                vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
            ),
            properties,
            context,
        })
    }

    /// Name, driver, limits.
    pub fn summary(&self) -> &DeviceSummary {
        &self.summary
    }

    /// Statistics of a stage's kernel, with the driver's names and order.
    ///
    /// # Errors
    /// A kernel that doesn't compile.
    pub fn statistics(&mut self, stage: &StageDesc) -> Result<Vec<(String, f64)>> {
        let pipeline = self.pipelines.get(&self.context, stage)?;
        let executable = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline.handle);
        // SAFETY: the pipeline is alive, and was created with statistics enabled.
        let found = unsafe { self.properties.get_pipeline_executable_statistics(&executable) }
            .or_vulkan("vkGetPipelineExecutableStatisticsKHR")?;
        let statistic = |found: &vk::PipelineExecutableStatisticKHR<'_>| {
            // SAFETY: the format says which member of the union the driver has written.
            let value = unsafe {
                match found.format {
                    vk::PipelineExecutableStatisticFormatKHR::BOOL32 => f64::from(found.value.b32),
                    vk::PipelineExecutableStatisticFormatKHR::INT64 => found.value.i64 as f64,
                    vk::PipelineExecutableStatisticFormatKHR::FLOAT64 => found.value.f64,
                    _ => found.value.u64 as f64,
                }
            };
            let name = found.name_as_c_str().unwrap_or_default().to_string_lossy();
            (name.into_owned(), value)
        };
        Ok(found.iter().map(statistic).collect())
    }
}

impl Drop for Compiler {
    fn drop(&mut self) {
        self.pipelines.free(&self.context);
    }
}
