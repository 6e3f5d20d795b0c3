//! Numbers read from pictures, with their standard errors.

use std::ops::Range;

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{RenderConfig, Sampler};
use ppm_vk::internals::film::Image;

use crate::picture::Subject;

/// Batches that the iterations of a render are dealt to.
const BATCHES: u32 = 32;
/// What the magnitude of Student's t with 31 degrees of freedom exceeds with a probability of 1e-8.
const STUDENT: f64 = 7.74;
/// Samples, beyond which Student's t is all but normal, and what a normal number then exceeds with a probability of 1e-8.
const MANY: u32 = 1000;
const NORMAL: f64 = 5.8;
/// Relative rounding of f32 along a path and in sums: single roundings are 6e-8.
const ROUNDING: f64 = 1e-5;

/// A mean of independent samples.
#[derive(Debug, Clone)]
pub struct Measured {
    samples: Vec<f64>,
    pub mean: f64,
    /// Standard error of the mean.
    pub error: f64,
}

impl Measured {
    /// Of 32 samples, or of more than a thousand.
    pub fn of(samples: Vec<f64>) -> Self {
        let count = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / count;
        let squares: f64 = samples.iter().map(|sample| (sample - mean).powi(2)).sum();
        Self {
            samples,
            mean,
            error: (squares / (count * (count - 1.0))).sqrt(),
        }
    }

    /// Its difference from another one, sample by sample: where both come from the same random numbers, it has less noise.
    pub fn minus(&self, other: &Self) -> Self {
        let pairs = self.samples.iter().zip(&other.samples);
        Self::of(pairs.map(|(one, other)| one - other).collect())
    }

    /// How far chance may move it.
    pub fn chance(&self) -> f64 {
        match self.samples.len() as u32 {
            BATCHES => STUDENT * self.error,
            count if count >= MANY => NORMAL * self.error,
            count => panic!("no quantile is known for {count} samples"),
        }
    }

    #[track_caller]
    pub fn assert_is(&self, expected: f64, what: &str) {
        self.assert_between(expected, expected, what);
    }

    /// Checks a value that lies between two bounds, in either order, but for chance.
    #[track_caller]
    pub fn assert_between(&self, one: f64, other: f64, what: &str) {
        let (low, high) = (one.min(other), one.max(other));
        let slack = self.chance() + ROUNDING * low.abs().max(high.abs());
        let text = format!(
            "{what}: {} ± {:.1e} (standard error), between {low} and {high} expected",
            self.mean, self.error
        );
        println!("{text}; tolerance {:.2} %", 100.0 * (slack + high - low) / high.abs());
        assert!(low - slack <= self.mean && self.mean <= high + slack, "{text}");
    }
}

/// What `read`, which must be linear, reads from a picture; the samples are 32 batches of iterations. A picture is the mean
/// of the pictures that its iterations make, since eq. 3 scales τ as eq. 2 does R², and an iteration's expectation doesn't
/// depend on the photons of those before: only its radius does.
pub fn measure(
    subject: &Subject,
    config: RenderConfig,
    iterations: u32,
    read: impl Fn(&Image) -> Vec<f64>,
) -> Vec<Measured> {
    assert!(iterations.is_multiple_of(BATCHES), "whole batches");
    let batch = iterations / BATCHES;
    let (resolution, of_a_pixel) = (config.resolution, config.camera_paths());
    // Samples of one Sobol' sequence lean on each other: they spread less than their mean errs.
    let mut renderer = subject.renderer(RenderConfig {
        sampler: Sampler::Independent,
        ..config
    });
    let mut before: Vec<f64> = Vec::new();
    let mut samples: Vec<Vec<f64>> = Vec::new();
    for number in 1..=BATCHES {
        (0..batch).for_each(|_| drop(renderer.iterate().expect("iteration")));
        let sums: Vec<f64> = read(&subject.clean_picture(&mut renderer))
            .iter()
            .map(|value| value * f64::from(number))
            .collect();
        before.resize(sums.len(), 0.0);
        samples.resize(sums.len(), Vec::new());
        for ((samples, sum), before) in samples.iter_mut().zip(&sums).zip(&before) {
            samples.push(sum - before);
        }
        before = sums;
    }
    let counters = renderer.counters();
    let camera_paths = f64::from(resolution[0] * resolution[1]) * f64::from(iterations) * f64::from(of_a_pixel);
    assert!(
        (counters.truncated_paths as f64) < ROUNDING * (renderer.emitted() as f64 + camera_paths),
        "{counters:?}: the light of paths that the bounce limit ended is missing"
    );
    samples.into_iter().map(Measured::of).collect()
}

/// A rectangle of a picture.
#[derive(Debug, Clone)]
pub struct Region {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

impl Region {
    /// A square of pixels around one.
    pub fn around([column, row]: [usize; 2], half_side: usize) -> Self {
        Self {
            columns: column - half_side..column + half_side,
            rows: row - half_side..row + half_side,
        }
    }

    pub fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.rows
            .clone()
            .flat_map(|row| self.columns.clone().map(move |column| [column, row]))
    }

    /// Mean of what `value` gives for each pixel.
    pub fn mean(&self, value: impl Fn([usize; 2]) -> f64) -> f64 {
        self.pixels().map(value).sum::<f64>() / (self.columns.len() * self.rows.len()) as f64
    }

    /// Mean of a picture's channel.
    pub fn of(&self, image: &Image, channel: usize) -> f64 {
        self.mean(|[column, row]| f64::from(image.pixels()[row * image.width() + column][channel]))
    }
}
