//! Conversions between the device's layout and f64.

use glam::DVec3;

/// The first three of four components.
pub(super) fn xyz(v: [f32; 4]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The fourth component as a word.
pub(super) fn word(v: [f32; 4]) -> u32 {
    v[3].to_bits()
}

/// Three components, rounded to f32, and a word.
pub(super) fn with_word(v: DVec3, word: u32) -> [f32; 4] {
    let v = v.as_vec3();
    [v.x, v.y, v.z, f32::from_bits(word)]
}

/// Linear RGB.
pub(super) fn rgb(v: [f32; 3]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The mean of the channels.
pub(super) fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}
