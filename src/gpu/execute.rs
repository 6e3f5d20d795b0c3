//! Recordings to Vulkan commands, with a timestamp on both sides of every launch.

use std::time::{Duration, Instant};

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::{Context, OrVulkan};
use super::device::Device;
use super::pipeline::descriptor_type;
use crate::error::{Error, Result};
use crate::record::{Command, Launch, Recording, Run};
use crate::stage::{Access, BufferId, StageDesc};

impl Device {
    /// Runs a recording and waits for it.
    ///
    /// # Errors
    /// A buffer that doesn't exist, a failed Vulkan call, or, in debug builds, anything that the validation layer
    /// says.
    pub fn run(&mut self, recording: &Recording) -> Result<Run> {
        let stages: Vec<&StageDesc> = recording
            .commands()
            .iter()
            .filter_map(|command| match command {
                Command::Dispatch(stage) => Some(stage),
                _ => None,
            })
            .collect();
        let scratch = Scratch::new(self, &stages)?;
        let result = self.run_with(recording, &stages, &scratch);
        scratch.free(&self.context);
        result
    }

    fn run_with(&mut self, recording: &Recording, stages: &[&StageDesc], scratch: &Scratch) -> Result<Run> {
        let mut prepared = Vec::with_capacity(stages.len());
        for (stage, set) in stages.iter().zip(&scratch.sets) {
            prepared.push((self.pipelines.get(&self.context, stage)?, *set));
        }
        for command in recording.commands() {
            if let Command::Fill(id, _) = command {
                self.handle(*id)?;
            }
        }
        let buffers = &self.buffers;
        let wall = submit(&self.context, self.commands, self.fence, |context, commands| {
            let device = &context.device;
            let mut next = 0;
            // SAFETY: pipelines, sets and buffers live until the submission has been waited for.
            unsafe {
                if !stages.is_empty() {
                    device.cmd_reset_query_pool(commands, scratch.queries, 0, 2 * stages.len() as u32);
                }
                for command in recording.commands() {
                    match command {
                        Command::Dispatch(stage) => {
                            let (pipeline, set) = prepared[next];
                            context.begin_label(commands, stage.shader.name);
                            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline.handle);
                            device.cmd_bind_descriptor_sets(
                                commands,
                                vk::PipelineBindPoint::COMPUTE,
                                pipeline.layout,
                                0,
                                &[set],
                                &[],
                            );
                            if !stage.push.is_empty() {
                                let flags = vk::ShaderStageFlags::COMPUTE;
                                device.cmd_push_constants(commands, pipeline.layout, flags, 0, &stage.push);
                            }
                            let all = vk::PipelineStageFlags::ALL_COMMANDS;
                            device.cmd_write_timestamp(commands, all, scratch.queries, 2 * next as u32);
                            let [columns, rows] = layout_of(stage.groups());
                            device.cmd_dispatch(commands, columns, rows, 1);
                            device.cmd_write_timestamp(commands, all, scratch.queries, 2 * next as u32 + 1);
                            context.end_label(commands);
                            next += 1;
                        }
                        Command::Fill(id, word) => {
                            device.cmd_fill_buffer(commands, buffers[id].handle, 0, vk::WHOLE_SIZE, *word);
                        }
                        Command::Barrier => barrier(context, commands),
                    }
                }
            }
            Ok(())
        })?;
        Ok(Run {
            launches: self.launches(stages, scratch)?,
            wall,
        })
    }

    fn launches(&self, stages: &[&StageDesc], scratch: &Scratch) -> Result<Vec<Launch>> {
        if stages.is_empty() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0u64; 2 * stages.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the queries were written by work that has been waited for.
        unsafe {
            self.context
                .device
                .get_query_pool_results(scratch.queries, 0, &mut ticks, flags)
        }
        .or_vulkan("vkGetQueryPoolResults")?;
        let mask = u64::MAX >> (64 - self.context.timestamp_bits.clamp(1, 64));
        let period = f64::from(self.summary.timestamp_period_ns);
        Ok(stages
            .iter()
            .zip(ticks.chunks_exact(2))
            .map(|(stage, ticks)| Launch {
                stage: stage.shader.name,
                begin_ns: (ticks[0] & mask) as f64 * period,
                duration_ns: (ticks[1].wrapping_sub(ticks[0]) & mask) as f64 * period,
            })
            .collect())
    }

    /// The first `count` elements of the buffer `id`; all where `count` is `None`.
    ///
    /// # Errors
    /// No such buffer, or a failed Vulkan call.
    pub fn download<T: bytemuck::AnyBitPattern>(&mut self, id: BufferId, count: Option<usize>) -> Result<Vec<T>> {
        let source = self.handle(id)?;
        let available = self.size(id);
        let bytes = count
            .map_or(available, |count| (count * size_of::<T>()) as u64)
            .min(available);
        if bytes == 0 {
            return Ok(Vec::new());
        }
        if self.read_back.get(&id).is_none_or(|buffer| buffer.bytes < bytes) {
            if let Some(old) = self.read_back.remove(&id) {
                old.free(&self.context);
            }
            let name = format!("{id:?} read back");
            self.read_back
                .insert(id, Buffer::new(&self.context, &name, bytes, MemoryLocation::GpuToCpu)?);
        }
        let target = self.read_back[&id].handle;
        self.submit(|context, commands| {
            let region = vk::BufferCopy::default().size(bytes);
            let to_host = vk::MemoryBarrier::default()
                .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
                .dst_access_mask(vk::AccessFlags::HOST_READ);
            // SAFETY: both buffers hold that many bytes and live until the submission has been waited for.
            unsafe {
                context.device.cmd_copy_buffer(commands, source, target, &[region]);
                context.device.cmd_pipeline_barrier(
                    commands,
                    vk::PipelineStageFlags::TRANSFER,
                    vk::PipelineStageFlags::HOST,
                    vk::DependencyFlags::empty(),
                    &[to_host],
                    &[],
                    &[],
                );
            }
            Ok(())
        })?;
        let mapped = self.read_back.get_mut(&id).map(Buffer::mapped).unwrap_or_default();
        let whole = bytes as usize / size_of::<T>() * size_of::<T>();
        Ok(mapped[..whole]
            .chunks_exact(size_of::<T>())
            .map(bytemuck::pod_read_unaligned)
            .collect())
    }

    pub(super) fn submit(&self, record: impl FnOnce(&Context, vk::CommandBuffer) -> Result<()>) -> Result<Duration> {
        submit(&self.context, self.commands, self.fence, record)
    }

    fn handle(&self, id: BufferId) -> Result<vk::Buffer> {
        self.buffers
            .get(&id)
            .map(|buffer| buffer.handle)
            .ok_or_else(|| Error::Device(format!("buffer {id:?} is used before it is made")))
    }
}

/// Workgroups in rows of no more than every device allows; at least `groups` of them.
fn layout_of(groups: u32) -> [u32; 2] {
    let rows = groups.div_ceil(65_535);
    [groups.div_ceil(rows), rows]
}

/// Records, submits, waits; returns the time from the submission to the fence.
fn submit(
    context: &Context,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    record: impl FnOnce(&Context, vk::CommandBuffer) -> Result<()>,
) -> Result<Duration> {
    let device = &context.device;
    let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
    // SAFETY: the command buffer isn't in use: every submission is waited for before the next one.
    let wall = unsafe {
        device
            .begin_command_buffer(commands, &begin)
            .or_vulkan("vkBeginCommandBuffer")?;
        // What the host or an earlier submission wrote.
        barrier(context, commands);
        record(context, commands)?;
        device.end_command_buffer(commands).or_vulkan("vkEndCommandBuffer")?;
        let buffers = [commands];
        let start = Instant::now();
        device
            .queue_submit(
                context.queue,
                &[vk::SubmitInfo::default().command_buffers(&buffers)],
                fence,
            )
            .or_vulkan("vkQueueSubmit")?;
        device
            .wait_for_fences(&[fence], true, u64::MAX)
            .or_vulkan("vkWaitForFences")?;
        let wall = start.elapsed();
        device.reset_fences(&[fence]).or_vulkan("vkResetFences")?;
        wall
    };
    let messages = context.take_messages();
    if !messages.is_empty() {
        return Err(Error::Device(format!("validation: {}", messages.join("\n"))));
    }
    Ok(wall)
}

/// Everything before is finished and visible to everything after.
fn barrier(context: &Context, commands: vk::CommandBuffer) {
    let stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    let barrier = vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(
            vk::AccessFlags::SHADER_READ
                | vk::AccessFlags::SHADER_WRITE
                | vk::AccessFlags::UNIFORM_READ
                | vk::AccessFlags::TRANSFER_READ
                | vk::AccessFlags::TRANSFER_WRITE,
        );
    // SAFETY: the command buffer is recording.
    unsafe {
        let none = vk::DependencyFlags::empty();
        context
            .device
            .cmd_pipeline_barrier(commands, stages, stages, none, &[barrier], &[], &[]);
    }
}

/// Descriptor sets and timestamp queries of one run.
struct Scratch {
    pool: vk::DescriptorPool,
    sets: Vec<vk::DescriptorSet>,
    queries: vk::QueryPool,
}

impl Scratch {
    fn new(device: &mut Device, stages: &[&StageDesc]) -> Result<Self> {
        let mut scratch = Self {
            pool: vk::DescriptorPool::null(),
            sets: Vec::new(),
            queries: vk::QueryPool::null(),
        };
        if stages.is_empty() {
            return Ok(scratch);
        }
        let result = scratch.fill(device, stages);
        match result {
            Ok(()) => Ok(scratch),
            Err(error) => {
                scratch.free(&device.context);
                Err(error)
            }
        }
    }

    fn fill(&mut self, device: &mut Device, stages: &[&StageDesc]) -> Result<()> {
        let count = |access_type: vk::DescriptorType| {
            let all = stages.iter().flat_map(|stage| stage.uses());
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
        let mut layouts = Vec::with_capacity(stages.len());
        for stage in stages {
            layouts.push(device.pipelines.get(&device.context, stage)?.set_layout);
        }
        let vulkan = &device.context.device;
        // SAFETY: plain creation calls; `free` destroys what they make.
        unsafe {
            let create = vk::DescriptorPoolCreateInfo::default()
                .max_sets(stages.len() as u32)
                .pool_sizes(&sizes);
            self.pool = vulkan
                .create_descriptor_pool(&create, None)
                .or_vulkan("vkCreateDescriptorPool")?;
            let allocate = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(self.pool)
                .set_layouts(&layouts);
            self.sets = vulkan
                .allocate_descriptor_sets(&allocate)
                .or_vulkan("vkAllocateDescriptorSets")?;
            let create = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(2 * stages.len() as u32);
            self.queries = vulkan.create_query_pool(&create, None).or_vulkan("vkCreateQueryPool")?;
        }
        for (stage, set) in stages.iter().zip(&self.sets) {
            device.context.name(*set, stage.shader.name);
            for (slot, id, access) in stage.uses() {
                let buffer = device.buffers.get_mut(&id).ok_or_else(|| {
                    Error::Device(format!("stage {} uses {id:?} before it is made", stage.shader.name))
                })?;
                let info = [vk::DescriptorBufferInfo::default()
                    .buffer(buffer.handle)
                    .range(vk::WHOLE_SIZE)];
                let mut write = vk::WriteDescriptorSet::default()
                    .dst_set(*set)
                    .dst_binding(slot)
                    .descriptor_type(descriptor_type(access))
                    .buffer_info(&info);
                let view;
                if access == Access::Texels {
                    if buffer.bytes / 16 > u64::from(device.summary.max_texels) {
                        return Err(Error::Device(format!(
                            "{id:?} has {} texels, device {} reads {} at most; try fewer --photons, a smaller \
                             --resolution or another --device",
                            buffer.bytes / 16,
                            device.summary.name,
                            device.summary.max_texels
                        )));
                    }
                    view = [buffer.texels(&device.context)?];
                    write = write.texel_buffer_view(&view);
                }
                // SAFETY: set and buffer are alive, and the set isn't in use.
                unsafe { vulkan.update_descriptor_sets(&[write], &[]) };
            }
        }
        Ok(())
    }

    fn free(&self, context: &Context) {
        // SAFETY: the run that used them has been waited for; null handles are ignored.
        unsafe {
            context.device.destroy_descriptor_pool(self.pool, None);
            context.device.destroy_query_pool(self.queries, None);
        }
    }
}
