//! Compute pipelines, one for each shader and set of specialisation constants.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use ash::vk;

use super::context::{Context, OrVulkan};
use super::pipeline_cache::PipelineCache;
use super::ray_tracing::no_ray_query;
use crate::error::{Error, Result};
use crate::stage::{Access, Shader, StageDesc};

/// A shader's layouts, shared by its specialisations.
struct Layouts {
    module: vk::ShaderModule,
    set: vk::DescriptorSetLayout,
    pipeline: vk::PipelineLayout,
}

/// A pipeline and what binding its buffers needs.
#[derive(Clone, Copy)]
pub(super) struct Pipeline {
    pub handle: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    pub set_layout: vk::DescriptorSetLayout,
    /// Whether it uses ray queries, with the acceleration structure in a second set.
    pub ray_query: bool,
}

/// A shader's module, by its name and whether it has ray queries.
type Module = (&'static str, bool);
/// A module and its specialisation constants, by id.
type Key = (Module, Vec<(u32, u32)>);

pub(super) struct Pipelines {
    cache: PipelineCache,
    flags: vk::PipelineCreateFlags,
    layouts: HashMap<Module, Layouts>,
    pipelines: HashMap<Key, Pipeline>,
}

pub(super) fn descriptor_type(access: Access) -> vk::DescriptorType {
    match access {
        Access::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        Access::Texels => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
        _ => vk::DescriptorType::STORAGE_BUFFER,
    }
}

impl Pipelines {
    /// An empty cache.
    pub fn new(cache: PipelineCache, flags: vk::PipelineCreateFlags) -> Self {
        Self {
            cache,
            flags,
            layouts: HashMap::new(),
            pipelines: HashMap::new(),
        }
    }

    /// The pipeline for a launch, created at its first use.
    pub fn get(&mut self, context: &Context, stage: &StageDesc) -> Result<Pipeline> {
        let shader = stage.shader;
        let mut constants: Vec<(u32, u32)> = Vec::new();
        for (name, value) in stage.constants.iter() {
            // A stage may not use a constant; setting it is no error.
            if let Some(constant) = shader.constants.iter().find(|constant| constant.name == *name) {
                constants.push((constant.id, *value));
            }
        }
        let ray_query = stage.ray_query();
        let module = (shader.name, ray_query.is_some());
        let key = (module, constants);
        if let Some(pipeline) = self.pipelines.get(&key) {
            return Ok(*pipeline);
        }
        let layouts = match self.layouts.entry(module) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => place.insert(layouts(context, shader, ray_query)?),
        };
        let entries: Vec<_> = key
            .1
            .iter()
            .enumerate()
            .map(|(i, (id, _))| vk::SpecializationMapEntry {
                constant_id: *id,
                offset: 4 * i as u32,
                size: 4,
            })
            .collect();
        let data: Vec<u8> = key.1.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect();
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
        let stage_info = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(layouts.module)
            .name(c"main")
            .specialization_info(&specialization);
        let create = vk::ComputePipelineCreateInfo::default()
            // Long launches are divided by their workgroups.
            .flags(self.flags | vk::PipelineCreateFlags::DISPATCH_BASE)
            .stage(stage_info)
            .layout(layouts.pipeline);
        // SAFETY: module and layout are alive; the context outlives the pipeline.
        let handle = unsafe {
            context
                .device
                .create_compute_pipelines(self.cache.handle, &[create], None)
        }
        .map_err(|(_, code)| Error::Vulkan {
            call: "vkCreateComputePipelines",
            code: format!("{code} (stage {})", shader.name),
        })?[0];
        context.name(handle, shader.name);
        let pipeline = Pipeline {
            handle,
            layout: layouts.pipeline,
            set_layout: layouts.set,
            ray_query: ray_query.is_some(),
        };
        self.pipelines.insert(key, pipeline);
        Ok(pipeline)
    }

    pub fn free(&mut self, context: &Context) {
        self.cache.free(context);
        // SAFETY: the caller has waited for the work that used them.
        unsafe {
            for pipeline in self.pipelines.values() {
                context.device.destroy_pipeline(pipeline.handle, None);
            }
            for layouts in self.layouts.values() {
                context.device.destroy_pipeline_layout(layouts.pipeline, None);
                context.device.destroy_descriptor_set_layout(layouts.set, None);
                context.device.destroy_shader_module(layouts.module, None);
            }
        }
    }
}

fn layouts(context: &Context, shader: &Shader, ray_query: Option<&'static [u8]>) -> Result<Layouts> {
    let for_rays = match (&context.ray_tracing, ray_query) {
        (_, None) => None,
        (Some(tracing), Some(_)) => Some(tracing.set_layout),
        (None, Some(_)) => return Err(no_ray_query("at hand")),
    };
    let code = ash::util::read_spv(&mut std::io::Cursor::new(ray_query.unwrap_or(shader.spirv)))
        .map_err(|error| Error::Device(format!("stage {}: {error}", shader.name)))?;
    let bindings: Vec<_> = shader
        .bindings
        .iter()
        .map(|binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding.slot)
                .descriptor_type(descriptor_type(binding.access))
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let ranges: Vec<_> = shader
        .push_constants
        .iter()
        .map(|block| {
            vk::PushConstantRange::default()
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
                .size(block.size() as u32)
        })
        .collect();
    // SAFETY: plain creation calls; the context outlives what they make.
    unsafe {
        let module = context
            .device
            .create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&code), None)
            .or_vulkan("vkCreateShaderModule")?;
        let set = context
            .device
            .create_descriptor_set_layout(&vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings), None)
            .or_vulkan("vkCreateDescriptorSetLayout")?;
        let sets: Vec<_> = [set].into_iter().chain(for_rays).collect();
        let create = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&sets)
            .push_constant_ranges(&ranges);
        let pipeline = context
            .device
            .create_pipeline_layout(&create, None)
            .or_vulkan("vkCreatePipelineLayout")?;
        context.name(module, shader.name);
        context.name(set, shader.name);
        context.name(pipeline, shader.name);
        Ok(Layouts { module, set, pipeline })
    }
}
