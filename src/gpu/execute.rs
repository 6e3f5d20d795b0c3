//! Recordings to Vulkan commands, with a timestamp on both sides of every launch.

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::{Context, OrVulkan};
use super::device::Device;
use super::pipeline::Pipeline;
use super::submission::{SlotLaunch, barrier, barrier_to_host};
use crate::error::{Error, Result};
use crate::record::{Command, Launch, Piece, Recording, Run};
use crate::stage::{BufferId, StageDesc};

/// Maximum work of a submission, in nanoseconds: drivers reset a device after 2 to 10 seconds, and the desktop waits for the end
/// of a submission.
const MOST_NS: f64 = 100e6;

/// A submitted piece of work.
#[must_use]
pub struct Ticket(usize);

/// A launch's pipeline and its descriptor sets.
type Bound = (Pipeline, Vec<vk::DescriptorSet>);

/// Times of a recording, and the data that it read back.
pub struct Done {
    /// Times of its launches.
    pub run: Run,
    read: Vec<(BufferId, Vec<u8>)>,
}

impl Done {
    /// The data that was read back of the buffer `id`; empty if the recording reads none.
    pub fn read<T: bytemuck::AnyBitPattern>(&self, id: BufferId) -> Vec<T> {
        let read = self.read.iter().find(|(read, _)| *read == id);
        read.map_or_else(Vec::new, |(_, bytes)| elements(bytes))
    }
}

fn elements<T: bytemuck::AnyBitPattern>(bytes: &[u8]) -> Vec<T> {
    bytes
        .chunks_exact(size_of::<T>())
        .map(bytemuck::pod_read_unaligned)
        .collect()
}

impl Device {
    /// Runs a recording and waits for it.
    ///
    /// # Errors
    /// A buffer that doesn't exist, a failed Vulkan call, or, in debug builds, anything that the validation layer
    /// says.
    pub fn run(&mut self, recording: &Recording) -> Result<Run> {
        let ticket = self.begin(recording)?;
        self.finish(ticket).map(|done| done.run)
    }

    /// Compiles the kernels of a recording, which otherwise happens when it is first submitted.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn compile(&mut self, recording: &Recording) -> Result<()> {
        for command in recording.commands() {
            if let Command::Dispatch(stage) = command {
                self.pipelines.get(&self.context, stage)?;
            }
        }
        Ok(())
    }

    /// Submits a recording, to run after all earlier submissions.
    ///
    /// # Errors
    /// As [`Device::run`].
    pub fn begin(&mut self, recording: &Recording) -> Result<Ticket> {
        let commands = recording.commands();
        let stages: Vec<&StageDesc> = commands
            .iter()
            .filter_map(|command| match command {
                Command::Dispatch(stage) => Some(stage),
                _ => None,
            })
            .collect();
        let mut pipelines = Vec::with_capacity(stages.len());
        for stage in &stages {
            pipelines.push(self.pipelines.get(&self.context, stage)?);
        }
        let sets = self.sets(&stages, &pipelines)?;
        let for_rays = self.acceleration.as_ref().map(|acceleration| acceleration.set);
        if for_rays.is_none() && pipelines.iter().any(|pipeline| pipeline.ray_query) {
            let message = "a stage traces rays before there is anything to trace them through";
            return Err(Error::Device(message.to_owned()));
        }
        let bound: Vec<Bound> = pipelines
            .into_iter()
            .zip(sets)
            .map(|(pipeline, set)| {
                let for_rays = for_rays.filter(|_| pipeline.ray_query);
                (pipeline, [set].into_iter().chain(for_rays).collect())
            })
            .collect();
        let index = self.idle_slot()?;
        let mut reads = Vec::new();
        for command in commands {
            match command {
                Command::Fill(id, _) => {
                    self.handle(*id)?;
                }
                Command::ReadBack(id, most) => {
                    self.handle(*id)?;
                    reads.push((*id, self.size(*id).min(*most)));
                }
                Command::Dispatch(_) | Command::Barrier => {}
            }
        }
        let parts = recording.parts(MOST_NS, |stage| self.expected_ns(stage));
        let pieces_of_launches: Vec<u32> = parts
            .iter()
            .flatten()
            .filter(|piece| piece.place == 0 && matches!(commands[piece.index], Command::Dispatch(_)))
            .map(|piece| piece.count)
            .collect();
        let (slot, context) = self.slot(index);
        slot.make_queries(context, 2 * pieces_of_launches.iter().sum::<u32>())?;
        for &(id, bytes) in &reads {
            slot.make_read_back(context, id, bytes)?;
        }
        slot.reads = reads;
        slot.launches = stages
            .iter()
            .zip(&pieces_of_launches)
            .map(|(stage, &pieces)| SlotLaunch {
                stage: stage.shader.name,
                threads: stage.threads,
                pieces,
            })
            .collect();
        self.record(index, commands, &parts, &bound)?;
        Ok(Ticket(index))
    }

    fn record(&mut self, slot: usize, commands: &[Command], parts: &[Vec<Piece>], bound: &[Bound]) -> Result<()> {
        let handles: Vec<vk::Buffer> = commands
            .iter()
            .map(|command| match command {
                Command::Fill(id, _) | Command::ReadBack(id, _) => self.buffers[id].handle,
                Command::Dispatch(_) | Command::Barrier => vk::Buffer::null(),
            })
            .collect();
        let (of_slot, _) = self.slot(slot);
        let (queries, query_count) = (of_slot.queries, of_slot.query_count());
        let targets: Vec<(vk::Buffer, u64)> = of_slot
            .reads
            .iter()
            .map(|(id, bytes)| (of_slot.read_back[id].handle, *bytes))
            .collect();
        let (mut launch, mut query, mut read) = (0, 0, 0);
        self.submit(slot, parts.len(), |context, into, part| {
            let device = &context.device;
            // SAFETY: pipelines, sets and buffers live until the submission has been waited for.
            unsafe {
                if part == 0 && query_count > 0 {
                    device.cmd_reset_query_pool(into, queries, 0, query_count);
                }
                for piece in &parts[part] {
                    let i = piece.index;
                    match &commands[i] {
                        Command::Dispatch(stage) => {
                            dispatch(context, into, (stage, *piece), &bound[launch], (queries, query));
                            query += 2;
                            launch += usize::from(piece.place + 1 == piece.count);
                        }
                        Command::Fill(_, word) => {
                            device.cmd_fill_buffer(into, handles[i], 0, vk::WHOLE_SIZE, *word);
                        }
                        Command::ReadBack(..) => {
                            let (target, bytes) = targets[read];
                            let region = vk::BufferCopy::default().size(bytes);
                            device.cmd_copy_buffer(into, handles[i], target, &[region]);
                            read += 1;
                        }
                        Command::Barrier => barrier(context, into),
                    }
                }
                if part + 1 == parts.len() && read > 0 {
                    barrier_to_host(context, into);
                }
            }
        })
    }

    /// Waits for submitted work.
    ///
    /// # Errors
    /// A failed Vulkan call, or, in debug builds, anything that the validation layer says.
    pub fn finish(&mut self, ticket: Ticket) -> Result<Done> {
        self.wait(ticket.0)?;
        // Waiting for earlier work does not count as time of this work.
        let begin = self.slots.waited.max(self.slot(ticket.0).0.submitted);
        self.slots.waited = std::time::Instant::now();
        let wall = self.slots.waited - begin;
        let launches = self.launches(ticket.0)?;
        let (slot, _) = self.slot(ticket.0);
        let threads: Vec<u32> = slot.launches.iter().map(|launch| launch.threads).collect();
        let reads = std::mem::take(&mut slot.reads);
        let read = reads
            .into_iter()
            .map(|(id, bytes)| {
                let mapped = slot.read_back.get_mut(&id).map(Buffer::mapped).unwrap_or_default();
                (id, mapped[..bytes as usize].to_vec())
            })
            .collect();
        self.note_times(&launches, &threads);
        Ok(Done {
            run: Run { launches, wall },
            read,
        })
    }

    /// The expected time of a launch, by the longest one of its stage in the last run that had it.
    fn expected_ns(&self, stage: &StageDesc) -> Option<f64> {
        let of_thread = self.thread_ns.get(stage.shader.name)?;
        Some(of_thread * f64::from(stage.threads))
    }

    fn note_times(&mut self, launches: &[Launch], threads: &[u32]) {
        for launch in launches {
            self.thread_ns.insert(launch.stage, 0.0);
        }
        for (launch, threads) in launches.iter().zip(threads) {
            let of_thread = launch.duration_ns / f64::from(*threads);
            let longest = self.thread_ns.entry(launch.stage).or_default();
            *longest = longest.max(of_thread);
        }
    }

    fn launches(&mut self, slot: usize) -> Result<Vec<Launch>> {
        let mask = u64::MAX >> (64 - self.context.timestamp_bits.clamp(1, 64));
        let period = f64::from(self.summary.timestamp_period_ns);
        let (slot, context) = self.slot(slot);
        if slot.launches.is_empty() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0u64; slot.query_count() as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the queries were written by work that has been waited for.
        unsafe {
            context
                .device
                .get_query_pool_results(slot.queries, 0, &mut ticks, flags)
        }
        .or_vulkan("vkGetQueryPoolResults")?;
        let mut rest = ticks.chunks_exact(2);
        let timed = |launch: &SlotLaunch| {
            let pieces: Vec<&[u64]> = rest.by_ref().take(launch.pieces as usize).collect();
            let taken = |ticks: &&[u64]| (ticks[1].wrapping_sub(ticks[0]) & mask) as f64 * period;
            Launch {
                stage: launch.stage,
                begin_ns: (pieces[0][0] & mask) as f64 * period,
                duration_ns: pieces.iter().map(taken).sum(),
            }
        };
        Ok(slot.launches.iter().map(timed).collect())
    }

    /// The first `count` elements of the buffer `id`; all if `count` is `None`.
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
        let name = format!("{id:?} read back");
        let mut target = Buffer::new(&self.context, &name, bytes, MemoryLocation::GpuToCpu)?;
        let copied = self.copy(source, target.handle, bytes);
        let found = copied.map(|()| elements(&target.mapped()[..bytes as usize]));
        target.free(&self.context);
        found
    }

    /// Copies a buffer's first bytes, and waits for it.
    pub(super) fn copy(&mut self, from: vk::Buffer, to: vk::Buffer, bytes: u64) -> Result<()> {
        let slot = self.idle_slot()?;
        self.submit(slot, 1, |context, commands, _| {
            let region = vk::BufferCopy::default().size(bytes);
            // SAFETY: both buffers hold that many bytes and live until the submission has been waited for.
            unsafe { context.device.cmd_copy_buffer(commands, from, to, &[region]) };
            barrier_to_host(context, commands);
        })?;
        self.wait(slot)
    }

    fn handle(&self, id: BufferId) -> Result<vk::Buffer> {
        self.buffers
            .get(&id)
            .map(|buffer| buffer.handle)
            .ok_or_else(|| Error::Device(format!("buffer {id:?} is used before it is made")))
    }
}

/// Records a piece of a launch between two timestamps.
fn dispatch(
    context: &Context,
    commands: vk::CommandBuffer,
    (stage, piece): (&StageDesc, Piece),
    (pipeline, sets): &Bound,
    (queries, query): (vk::QueryPool, u32),
) {
    let device = &context.device;
    let compute = vk::PipelineBindPoint::COMPUTE;
    context.begin_label(commands, stage.shader.name);
    // SAFETY: the command buffer is recording; the caller keeps the resources until the work has finished.
    unsafe {
        device.cmd_bind_pipeline(commands, compute, pipeline.handle);
        device.cmd_bind_descriptor_sets(commands, compute, pipeline.layout, 0, sets, &[]);
        if !stage.push.is_empty() {
            let flags = vk::ShaderStageFlags::COMPUTE;
            device.cmd_push_constants(commands, pipeline.layout, flags, 0, &stage.push);
        }
        let all = vk::PipelineStageFlags::ALL_COMMANDS;
        device.cmd_write_timestamp(commands, all, queries, query);
        let [columns, rows] = layout_of(stage.groups(), piece.count);
        device.cmd_dispatch_base(commands, 0, piece.place * rows, 0, columns, rows, 1);
        device.cmd_write_timestamp(commands, all, queries, query + 1);
    }
    context.end_label(commands);
}

/// Workgroups of each of `pieces` pieces, in rows that every device allows; at least `groups` in total.
fn layout_of(groups: u32, pieces: u32) -> [u32; 2] {
    let rows = groups.div_ceil(65_535 * pieces);
    [groups.div_ceil(rows * pieces), rows]
}
