//! An animation sampler's value at a time (glTF 2.0, appendix C).

use std::collections::HashSet;

use glam::DQuat;
use gltf_json::animation::{Interpolation, Sampler};
use gltf_json::validation::Checked;

use super::diagnostic::{Check, damaged};
use super::file::accessor::{FLOATS, Formats, Vectors};
use super::file::document::Document;

/// The position of a time between the keyframes of a sampler.
#[derive(Clone, Copy)]
pub(crate) struct Keyframes {
    count: usize,
    /// The last keyframe that is not later, or the first.
    before: usize,
    /// The next keyframe; the same before the first and after the last.
    after: usize,
    /// Position of the time between them, 0 to 1.
    fraction: f64,
    /// Seconds between them.
    interval: f64,
}

impl Keyframes {
    /// Finds `time` in a sampler. `checked` contains the accessors of times that have been checked to increase.
    pub(crate) fn at(document: &Document, sampler: &Sampler, time: f64, checked: &mut HashSet<usize>) -> Check<Self> {
        let fail = |what: String| format!("input, {what}");
        let times = Vectors::<1>::open(document, sampler.input, &FLOATS).map_err(fail)?;
        let count = times.len();
        if count == 0 {
            return Err(damaged("its sampler has no keyframes"));
        }
        if checked.insert(sampler.input.value()) {
            let mut last = f64::NEG_INFINITY;
            for key in 0..count {
                let [next] = times.get(key);
                // NaN is not later either.
                if !(next > last && next.is_finite()) {
                    return Err(damaged(format_args!(
                        "keyframe {key} is at {next} seconds, after one at {last}"
                    )));
                }
                last = next;
            }
        }
        let (mut low, mut high) = (0, count);
        while low < high {
            let middle = low + (high - low) / 2;
            if times.get(middle)[0] <= time {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let before = low.saturating_sub(1);
        let after = low.min(count - 1);
        let interval = times.get(after)[0] - times.get(before)[0];
        let fraction = if interval > 0.0 {
            (time - times.get(before)[0]) / interval
        } else {
            0.0
        };
        Ok(Self {
            count,
            before,
            after,
            fraction,
            interval,
        })
    }
}

/// The output of a sampler at a time: `width` vectors of `N` numbers.
pub(crate) struct Curve<'a, const N: usize> {
    keyframes: Keyframes,
    interpolation: Interpolation,
    outputs: Vectors<'a, N>,
    width: usize,
}

/// The three outputs of a keyframe of a cubic spline; other interpolations have only the value.
const IN_TANGENT: usize = 0;
const VALUE: usize = 1;
const OUT_TANGENT: usize = 2;

impl<'a, const N: usize> Curve<'a, N> {
    /// Opens the output of a sampler with `width` vectors per keyframe.
    pub(crate) fn open(
        document: &'a Document,
        sampler: &Sampler,
        keyframes: Keyframes,
        width: usize,
        formats: &Formats,
    ) -> Check<Self> {
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err(damaged("its interpolation is not LINEAR, STEP or CUBICSPLINE"));
        };
        let outputs = Vectors::open(document, sampler.output, formats).map_err(|what| format!("output, {what}"))?;
        let parts = if interpolation == Interpolation::CubicSpline {
            3
        } else {
            1
        };
        let wanted = keyframes.count.saturating_mul(parts).saturating_mul(width);
        if outputs.len() != wanted {
            return Err(damaged(format_args!(
                "output: it has {} elements, but {} keyframes need {wanted}",
                outputs.len(),
                keyframes.count
            )));
        }
        Ok(Self {
            keyframes,
            interpolation,
            outputs,
            width,
        })
    }

    /// The vector at `at`, which is less than `width`.
    pub(crate) fn value(&self, at: usize) -> Check<[f64; N]> {
        let Keyframes {
            before,
            after,
            fraction: t,
            interval,
            ..
        } = self.keyframes;
        let first = self.output(before, VALUE, at)?;
        if before == after || self.interpolation == Interpolation::Step {
            return Ok(first);
        }
        let second = self.output(after, VALUE, at)?;
        if self.interpolation == Interpolation::Linear {
            return Ok(std::array::from_fn(|i| first[i] + t * (second[i] - first[i])));
        }
        let leaving = self.output(before, OUT_TANGENT, at)?;
        let arriving = self.output(after, IN_TANGENT, at)?;
        let (t2, t3) = (t * t, t * t * t);
        Ok(std::array::from_fn(|i| {
            (2.0 * t3 - 3.0 * t2 + 1.0) * first[i]
                + interval * (t3 - 2.0 * t2 + t) * leaving[i]
                + (3.0 * t2 - 2.0 * t3) * second[i]
                + interval * (t3 - t2) * arriving[i]
        }))
    }

    fn output(&self, key: usize, part: usize, at: usize) -> Check<[f64; N]> {
        let row = if self.interpolation == Interpolation::CubicSpline {
            3 * key + part
        } else {
            key
        };
        self.outputs
            .finite(row * self.width + at)
            .ok_or_else(|| damaged(format_args!("output: keyframe {key} isn't finite")))
    }
}

impl Curve<'_, 4> {
    /// The first vector as a rotation. Linear means along the shorter arc.
    pub(crate) fn rotation(&self) -> Check<DQuat> {
        let unit = |quaternion: [f64; 4]| {
            let quaternion = DQuat::from_array(quaternion);
            if quaternion.length_squared() > 0.0 {
                Ok(quaternion.normalize())
            } else {
                Err(damaged("output: a rotation is the quaternion 0 0 0 0"))
            }
        };
        let Keyframes {
            before,
            after,
            fraction,
            ..
        } = self.keyframes;
        if self.interpolation == Interpolation::Linear && before != after {
            let first = unit(self.output(before, VALUE, 0)?)?;
            return Ok(first.slerp(unit(self.output(after, VALUE, 0)?)?, fraction));
        }
        unit(self.value(0)?)
    }
}
