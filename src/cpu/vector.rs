//! Conversions between the device's layout and f64.

use glam::DVec3;

/// The first three of three or four components.
pub(super) fn xyz<const N: usize>(v: [f32; N]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The fourth component as a word.
pub(super) fn word(v: [f32; 4]) -> u32 {
    v[3].to_bits()
}

/// Linear RGB.
pub(super) fn rgb(v: [f32; 3]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The mean of the channels.
pub(super) fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}
