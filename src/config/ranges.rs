//! Ranges of settings, for arguments and for [`RenderConfig::check`](super::RenderConfig::check). Each function returns the
//! value, or a text that says what it must be.

use super::{MAX_SIDE, Part, Region};

/// The value, or what it must be.
pub type Checked<T> = Result<T, String>;

fn checked<T>(value: T, fits: bool, range: impl FnOnce() -> String) -> Checked<T> {
    if fits { Ok(value) } else { Err(range()) }
}

/// Pixels, width and height.
pub fn resolution(sides: [u32; 2]) -> Checked<[u32; 2]> {
    let fits = sides.iter().all(|side| (1..=MAX_SIDE).contains(side));
    checked(sides, fits, || format!("each side must lie between 1 and {MAX_SIDE}"))
}

/// A part of a picture of this size.
pub fn crop(crop: Region, [width, height]: [u32; 2]) -> Checked<Region> {
    let fits = |axis: usize, side: u32| {
        crop.size[axis] > 0 && u64::from(crop.origin[axis]) + u64::from(crop.size[axis]) <= u64::from(side)
    };
    checked(crop, fits(0, width) && fits(1, height), || {
        format!("must have at least one pixel, and lie within the picture of {width}x{height}")
    })
}

/// A count of at least one.
pub fn count(count: u32) -> Checked<u32> {
    checked(count, count > 0, || "must be at least 1".to_owned())
}

/// A part of several.
pub fn part(part: Part) -> Checked<Part> {
    checked(part, (1..=part.of).contains(&part.number), || {
        "must be K/N with K from 1 to N".to_owned()
    })
}

/// Eq. 2's α.
pub fn alpha(alpha: f32) -> Checked<f32> {
    checked(alpha, alpha > 0.0 && alpha < 1.0, || {
        "must lie between 0 and 1, both excluded".to_owned()
    })
}

/// A length, or another quantity above 0.
pub fn positive(value: f64) -> Checked<f64> {
    checked(value, value > 0.0 && value.is_finite(), || {
        "must be above 0 and finite".to_owned()
    })
}
