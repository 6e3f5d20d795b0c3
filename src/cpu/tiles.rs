//! The order of pixels in memory: `glsl/shared/visible_point.glsl`.

pub use crate::config::pixel_of;
use crate::layout::{Settings, TILE};

/// Slots for pixels: whole tiles.
pub(super) fn pixel_slots(settings: &Settings) -> usize {
    let [across, down] = settings.resolution.map(|side| side.div_ceil(TILE) as usize);
    across * down * (TILE * TILE) as usize
}
