//! Descriptor sets: created at the first launch with its buffers, and kept as long as the buffers are the same.

use std::collections::HashMap;

use ash::vk;

use super::context::{Context, OrVulkan};
use super::device::Device;
use super::pipeline::{Pipeline, descriptor_type};
use crate::error::{Error, Remedy, Result};
use crate::stage::{Access, StageDesc};

/// A shader, and the buffers of its bindings in order.
type Key = (&'static str, Vec<vk::Buffer>);

#[derive(Default)]
pub(super) struct Descriptors {
    pools: Vec<vk::DescriptorPool>,
    sets: HashMap<Key, vk::DescriptorSet>,
}

impl Descriptors {
    /// Drops all sets. The device must not be using them.
    pub fn free(&mut self, context: &Context) {
        self.sets.clear();
        for pool in self.pools.drain(..) {
            // SAFETY: the caller has waited for the work that used its sets.
            unsafe { context.device.destroy_descriptor_pool(pool, None) };
        }
    }
}

impl Device {
    /// The descriptor set of each launch.
    pub(super) fn sets(&mut self, stages: &[&StageDesc], pipelines: &[Pipeline]) -> Result<Vec<vk::DescriptorSet>> {
        let mut keys = Vec::with_capacity(stages.len());
        for stage in stages {
            keys.push(self.key(stage)?);
        }
        let mut missing: Vec<usize> = Vec::new();
        for (i, key) in keys.iter().enumerate() {
            if !self.descriptors.sets.contains_key(key) && !missing.iter().any(|&other| keys[other] == *key) {
                missing.push(i);
            }
        }
        if !missing.is_empty() {
            let of = |i: &usize| (stages[*i], pipelines[*i].set_layout);
            let made = self.make_sets(&missing.iter().map(of).collect::<Vec<_>>())?;
            for (i, set) in missing.into_iter().zip(made) {
                self.descriptors.sets.insert(keys[i].clone(), set);
            }
        }
        Ok(keys.iter().map(|key| self.descriptors.sets[key]).collect())
    }

    fn key(&self, stage: &StageDesc) -> Result<Key> {
        let mut buffers = Vec::with_capacity(stage.shader.bindings.len());
        for (_, id, _) in stage.uses() {
            let buffer = self
                .buffers
                .get(&id)
                .ok_or_else(|| Error::Device(format!("stage {} uses {id:?} before it is made", stage.shader.name)))?;
            buffers.push(buffer.handle);
        }
        Ok((stage.shader.name, buffers))
    }

    fn make_sets(&mut self, stages: &[(&StageDesc, vk::DescriptorSetLayout)]) -> Result<Vec<vk::DescriptorSet>> {
        let count = |access_type: vk::DescriptorType| {
            let all = stages.iter().flat_map(|(stage, _)| stage.uses());
            all.filter(|(_, _, access)| descriptor_type(*access) == access_type)
                .count()
                .max(1) as u32
        };
        let sizes = [
            vk::DescriptorType::STORAGE_BUFFER,
            vk::DescriptorType::UNIFORM_BUFFER,
            vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
        ]
        .map(|ty| vk::DescriptorPoolSize::default().ty(ty).descriptor_count(count(ty)));
        let layouts: Vec<_> = stages.iter().map(|(_, layout)| *layout).collect();
        let vulkan = &self.context.device;
        // SAFETY: plain creation calls; `free` destroys what they make.
        let sets = unsafe {
            let create = vk::DescriptorPoolCreateInfo::default()
                .max_sets(stages.len() as u32)
                .pool_sizes(&sizes);
            let pool = vulkan
                .create_descriptor_pool(&create, None)
                .or_vulkan("vkCreateDescriptorPool")?;
            self.descriptors.pools.push(pool);
            let allocate = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(pool)
                .set_layouts(&layouts);
            vulkan
                .allocate_descriptor_sets(&allocate)
                .or_vulkan("vkAllocateDescriptorSets")?
        };
        for ((stage, _), set) in stages.iter().zip(&sets) {
            self.write_set(stage, *set)?;
        }
        Ok(sets)
    }

    fn write_set(&mut self, stage: &StageDesc, set: vk::DescriptorSet) -> Result<()> {
        self.context.name(set, stage.shader.name);
        for (slot, id, access) in stage.uses() {
            let Some(buffer) = self.buffers.get_mut(&id) else {
                continue;
            };
            let info = [vk::DescriptorBufferInfo::default()
                .buffer(buffer.handle)
                .range(vk::WHOLE_SIZE)];
            let mut write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(slot)
                .descriptor_type(descriptor_type(access))
                .buffer_info(&info);
            let view;
            if access == Access::Texels {
                if buffer.bytes / 16 > u64::from(self.summary.max_texels) {
                    let what = format!(
                        "{id:?} has {} texels, device {} reads {} at most",
                        buffer.bytes / 16,
                        self.summary.name,
                        self.summary.max_texels
                    );
                    return Err(Error::unfit(what, Remedy::SmallerRender));
                }
                view = [buffer.texels(&self.context)?];
                write = write.texel_buffer_view(&view);
            }
            // SAFETY: set and buffer are alive, and the set isn't in use.
            unsafe { self.context.device.update_descriptor_sets(&[write], &[]) };
        }
        Ok(())
    }
}
