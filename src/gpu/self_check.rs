//! Properties of a device that Vulkan does not report.

use super::device::Device;
use crate::error::Result;
use crate::record::Recording;
use crate::shaders;
use crate::stage::{BufferId, StageDesc};

/// Older versions of Mesa's llvmpipe end loops at 65,535 iterations; a driver that allows more than this has no limit.
const ASKED: u32 = 70_000;

/// Size of the copy in each direction in bytes, if the device can bind it.
const COPIED: u64 = 64 << 20;
/// Number of copies; the median counts.
const COPIES: usize = 9;

impl Device {
    /// Loop iterations after which the driver ends all loops of an invocation; `u32::MAX` if it does not. Measured at the first
    /// call.
    ///
    /// # Errors
    /// No memory, or a failed Vulkan call.
    pub fn loop_limit(&mut self) -> Result<u32> {
        if let Some(known) = self.loop_limit {
            return Ok(known);
        }
        self.create(BufferId::ScanTotal, 4)?;
        let mut recording = Recording::new();
        recording.dispatch(StageDesc::new(&shaders::LOOP_PROBE, 1).push(shaders::CountPush { count: ASKED }));
        self.run(&recording)?;
        let done: Vec<u32> = self.download(BufferId::ScanTotal, Some(1))?;
        let limit = match done.first() {
            Some(&done) if done < ASKED => done,
            _ => u32::MAX,
        };
        self.loop_limit = Some(limit);
        Ok(limit)
    }

    /// Bytes per second that a copying kernel reads and writes together.
    ///
    /// # Errors
    /// No memory, or a failed Vulkan call.
    pub fn copy_bandwidth(&mut self) -> Result<f64> {
        let texels = u64::from(self.summary().max_texels);
        let bytes = COPIED.min(self.summary().max_storage_buffer_bytes).min(texels * 16);
        self.create(BufferId::ProbeFrom, bytes)?;
        self.create(BufferId::ProbeTo, bytes)?;
        let mut recording = Recording::new();
        recording.fill(BufferId::ProbeFrom, 1);
        for _ in 0..COPIES {
            recording.dispatch(StageDesc::new(&shaders::COPY_PROBE, (bytes / 16) as u32));
        }
        let run = self.run(&recording)?;
        self.remove(BufferId::ProbeFrom);
        self.remove(BufferId::ProbeTo);
        let mut times: Vec<f64> = run.launches.iter().map(|launch| launch.duration_ns).collect();
        times.sort_by(f64::total_cmp);
        Ok(2.0 * bytes as f64 / (times[times.len() / 2] * 1e-9))
    }
}
