//! Resources of work in flight: command buffers, a fence, timestamp queries and read-backs, all created once and reused.

use std::collections::HashMap;
use std::time::Instant;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::{Context, OrVulkan};
use super::device::Device;
use crate::error::{Error, Result};
use crate::stage::BufferId;

/// A launch of a slot's work.
pub(super) struct SlotLaunch {
    pub stage: &'static str,
    pub threads: u32,
    /// Number of pieces that it is divided into, each with two timestamps.
    pub pieces: u32,
}

/// A piece of work in flight, or the resources of a completed one for the next.
pub(super) struct Slot {
    /// As many as the largest number of parts so far.
    commands: Vec<vk::CommandBuffer>,
    fence: vk::Fence,
    pub queries: vk::QueryPool,
    query_room: u32,
    pub read_back: HashMap<BufferId, Buffer>,
    /// Bytes that are read back of each buffer.
    pub reads: Vec<(BufferId, u64)>,
    /// The launches in order.
    pub launches: Vec<SlotLaunch>,
    pub submitted: Instant,
    is_busy: bool,
}

impl Slot {
    fn new(context: &Context) -> Result<Self> {
        // SAFETY: a plain creation call; `free` destroys what it makes.
        let fence = unsafe { context.device.create_fence(&vk::FenceCreateInfo::default(), None) };
        Ok(Self {
            commands: Vec::new(),
            fence: fence.or_vulkan("vkCreateFence")?,
            queries: vk::QueryPool::null(),
            query_room: 0,
            read_back: HashMap::new(),
            reads: Vec::new(),
            launches: Vec::new(),
            submitted: Instant::now(),
            is_busy: false,
        })
    }

    /// Timestamps of the launches.
    pub fn query_count(&self) -> u32 {
        2 * self.launches.iter().map(|launch| launch.pieces).sum::<u32>()
    }

    /// Ensures capacity for this number of timestamps.
    pub fn make_queries(&mut self, context: &Context, count: u32) -> Result<()> {
        if count <= self.query_room {
            return Ok(());
        }
        let create = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(count);
        // SAFETY: the slot isn't in use, and null handles are ignored.
        unsafe {
            context.device.destroy_query_pool(self.queries, None);
            self.queries = vk::QueryPool::null();
            self.query_room = 0;
            self.queries = context
                .device
                .create_query_pool(&create, None)
                .or_vulkan("vkCreateQueryPool")?;
        }
        self.query_room = count;
        Ok(())
    }

    /// A read-back buffer for this number of bytes.
    pub fn make_read_back(&mut self, context: &Context, id: BufferId, bytes: u64) -> Result<()> {
        if self.read_back.get(&id).is_some_and(|buffer| buffer.bytes >= bytes) {
            return Ok(());
        }
        if let Some(old) = self.read_back.remove(&id) {
            old.free(context);
        }
        let name = format!("{id:?} read back");
        let buffer = Buffer::new(context, &name, bytes, MemoryLocation::GpuToCpu)?;
        self.read_back.insert(id, buffer);
        Ok(())
    }

    fn free(self, context: &Context) {
        // SAFETY: the caller has waited for the work; the command buffers go with their pool.
        unsafe {
            context.device.destroy_fence(self.fence, None);
            context.device.destroy_query_pool(self.queries, None);
        }
        for buffer in self.read_back.into_values() {
            buffer.free(context);
        }
    }
}

/// All work in flight.
pub(super) struct Slots {
    pool: vk::CommandPool,
    all: Vec<Slot>,
    /// Time when the host last finished waiting for work.
    pub waited: Instant,
}

impl Slots {
    pub fn new(context: &Context) -> Result<Self> {
        let create = vk::CommandPoolCreateInfo::default()
            .queue_family_index(context.family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: a plain creation call; `free` destroys what it makes.
        let pool = unsafe { context.device.create_command_pool(&create, None) };
        Ok(Self {
            pool: pool.or_vulkan("vkCreateCommandPool")?,
            all: Vec::new(),
            waited: Instant::now(),
        })
    }

    /// Whether anything is in flight.
    pub fn are_busy(&self) -> bool {
        self.all.iter().any(|slot| slot.is_busy)
    }

    /// The device must not be using any of them.
    pub fn free(&mut self, context: &Context) {
        // SAFETY: as the caller says.
        unsafe { context.device.destroy_command_pool(self.pool, None) };
        for slot in self.all.drain(..) {
            slot.free(context);
        }
    }

    fn commands(&mut self, context: &Context, slot: usize, part: usize) -> Result<vk::CommandBuffer> {
        if let Some(commands) = self.all[slot].commands.get(part) {
            return Ok(*commands);
        }
        let allocate = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        // SAFETY: the pool is alive, and owns what is made.
        let made = unsafe { context.device.allocate_command_buffers(&allocate) };
        let commands = made.or_vulkan("vkAllocateCommandBuffers")?[0];
        context.name(commands, "commands");
        self.all[slot].commands.push(commands);
        Ok(commands)
    }
}

impl Device {
    /// A slot without work in flight.
    pub(super) fn idle_slot(&mut self) -> Result<usize> {
        if let Some(slot) = self.slots.all.iter().position(|slot| !slot.is_busy) {
            return Ok(slot);
        }
        self.slots.all.push(Slot::new(&self.context)?);
        Ok(self.slots.all.len() - 1)
    }

    pub(super) fn slot(&mut self, slot: usize) -> (&mut Slot, &Context) {
        (&mut self.slots.all[slot], &self.context)
    }

    /// Records and submits the slot's work, in consecutive parts.
    pub(super) fn submit(
        &mut self,
        slot: usize,
        parts: usize,
        mut record: impl FnMut(&Context, vk::CommandBuffer, usize),
    ) -> Result<()> {
        let mut recorded = Vec::with_capacity(parts);
        for part in 0..parts {
            let commands = self.slots.commands(&self.context, slot, part)?;
            let device = &self.context.device;
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            // SAFETY: the command buffer isn't in use: its slot is idle.
            unsafe { device.begin_command_buffer(commands, &begin) }.or_vulkan("vkBeginCommandBuffer")?;
            // What the host or an earlier submission wrote.
            barrier(&self.context, commands);
            record(&self.context, commands, part);
            // SAFETY: as above.
            unsafe { device.end_command_buffer(commands) }.or_vulkan("vkEndCommandBuffer")?;
            recorded.push(commands);
        }
        let (slot, context) = self.slot(slot);
        slot.submitted = Instant::now();
        for (part, commands) in recorded.iter().enumerate() {
            let buffers = [*commands];
            let info = [vk::SubmitInfo::default().command_buffers(&buffers)];
            let last = part + 1 == recorded.len();
            let fence = if last { slot.fence } else { vk::Fence::null() };
            // SAFETY: buffers and pipelines live until the slot has been waited for.
            unsafe { context.device.queue_submit(context.queue, &info, fence) }.or_vulkan("vkQueueSubmit")?;
            slot.is_busy = true;
        }
        Ok(())
    }

    /// Waits for a slot's work.
    pub(super) fn wait(&mut self, slot: usize) -> Result<()> {
        let (slot, context) = self.slot(slot);
        let fences = [slot.fence];
        // SAFETY: the fence was submitted with the slot's last part.
        unsafe {
            context
                .device
                .wait_for_fences(&fences, true, u64::MAX)
                .or_vulkan("vkWaitForFences")?;
            context.device.reset_fences(&fences).or_vulkan("vkResetFences")?;
        }
        slot.is_busy = false;
        let messages = context.take_messages();
        if !messages.is_empty() {
            return Err(Error::Device(format!("validation: {}", messages.join("\n"))));
        }
        Ok(())
    }
}

/// All earlier commands finish and are visible to all later ones.
pub(super) fn barrier(context: &Context, commands: vk::CommandBuffer) {
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

/// Copies to read-back buffers are visible to the host.
pub(super) fn barrier_to_host(context: &Context, commands: vk::CommandBuffer) {
    let to_host = vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(vk::AccessFlags::HOST_READ);
    // SAFETY: the command buffer is recording.
    unsafe {
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
}
