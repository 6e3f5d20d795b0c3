//! What the driver does that no limit of Vulkan's says.

use super::device::Device;
use crate::error::Result;
use crate::record::Recording;
use crate::shaders;
use crate::stage::{BufferId, StageDesc};

/// Mesa's llvmpipe ended loops at 65,535 iterations for years; a driver that does more than this does all.
const ASKED: u32 = 70_000;

/// Loop iterations that an invocation is really given; `u32::MAX` where it gets all that it asks for.
pub(super) fn loop_limit(device: &mut Device) -> Result<u32> {
    device.create(BufferId::ScanTotal, 4)?;
    let mut recording = Recording::new();
    recording.dispatch(StageDesc::new(&shaders::LOOP_PROBE, 1).push(ASKED));
    device.run(&recording)?;
    let done: Vec<u32> = device.download(BufferId::ScanTotal, Some(1))?;
    Ok(match done.first() {
        Some(&done) if done < ASKED => done,
        _ => u32::MAX,
    })
}
