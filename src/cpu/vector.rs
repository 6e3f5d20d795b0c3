//! Between the device's layout and f64.

use glam::{DVec3, DVec4, Vec4};

/// The first three of four.
pub(super) fn xyz(v: [f32; 4]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The word that stands in the fourth.
pub(super) fn word(v: [f32; 4]) -> u32 {
    v[3].to_bits()
}

/// Three numbers, rounded to f32, and a word.
pub(super) fn with_word(v: DVec3, word: u32) -> [f32; 4] {
    let v = v.as_vec3();
    [v.x, v.y, v.z, f32::from_bits(word)]
}

/// Linear RGB.
pub(super) fn rgb(v: [f32; 3]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The value that two f32 stand for.
pub(super) fn from_two_float(high: f32, low: f32) -> f64 {
    f64::from(high) + f64::from(low)
}

/// The nearest f32, and the f32 nearest to what is left.
pub(super) fn to_two_float(value: f64) -> (f32, f32) {
    let high = value as f32;
    (high, (value - f64::from(high)) as f32)
}

/// [`from_two_float`] of each of four.
pub(super) fn from_two_floats(high: [f32; 4], low: [f32; 4]) -> DVec4 {
    Vec4::from(high).as_dvec4() + Vec4::from(low).as_dvec4()
}

/// [`to_two_float`] of each of four.
pub(super) fn to_two_floats(value: DVec4) -> ([f32; 4], [f32; 4]) {
    let pairs = value.to_array().map(to_two_float);
    (pairs.map(|pair| pair.0), pairs.map(|pair| pair.1))
}

/// The mean of the channels.
pub(super) fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}
