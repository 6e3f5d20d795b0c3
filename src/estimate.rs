//! Estimates the error of a picture during the render, without a reference.
//!
//! The picture after n iterations is the mean of n pictures: eq. 3 scales τ as eq. 2 scales R², so τ / R² is the sum of every
//! iteration's flux over its own R². Iterations take turns with sequences of random numbers that are independent of each other
//! ([`SEQUENCES`]): the spread of the sequences' means estimates the noise. The bias is the blur within R. Photons are summed up
//! a second time, weighted with 1 − 2 d²/R² by their distance d: for a constant or linear density that sum is 0 on average, for a
//! quadratic one it is a third of the bias, with the opposite sign. (Hachisuka and others, «A Progressive Error Estimation
//! Framework for Photon Density Estimation», 2010, have the same two parts, with derivatives from a separate kernel.) The paper's
//! estimator samples only the centres of pixels. That error is estimated from the differences of neighbouring pixels
//! (`estimate/parts.rs`). Light behind glass, which only photons carry, is missing until they find it (`estimate/missing.rs`).

mod missing;
mod parts;
mod spread;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::backend::{Backend, Resolved};
use crate::config::{Estimator, RenderConfig, SEQUENCES, SequenceIterations};
use crate::film::Image;
use crate::metrics::floor_of;
use parts::{OfPixel, Parts};
use spread::{Spread, Weights};

/// Bias over curvature, root of the mean square: 3 for a quadratic density, for a disc's means of r² and of r² (1 − 2 r²) are 1/2
/// and −1/6; 5.46 across the edge of a shadow, by integrating both over its distance. Between them, and nearer to the former: at
/// the edges of caustics discs are small.
const BIAS_PER_CURVATURE: f64 = 3.4;
/// Minimum share of the error for a cause to be reported.
const NOTABLE: f64 = 0.2;

/// The estimator of the error of a render's pictures.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// Whether pixels are sampled at their centres only.
    sees_centres: bool,
    photon: OnePhoton,
}

/// An estimate of the relative error, as root of relMSE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeError {
    /// The total error.
    pub total: f64,
    /// Noise.
    pub noise: f64,
    /// Blur of the radius.
    pub bias: f64,
    /// Aliasing by sampling the centres of pixels only, as [`Estimator::Ppm`] does.
    pub aliasing: f64,
    /// Light behind glass that no photon has found yet.
    pub missing: f64,
    /// Share of the pixels that wait for their first photon, if the contribution of one photon is a notable part of the error;
    /// otherwise 0.
    pub waiting: f64,
}

impl std::fmt::Display for RelativeError {
    fn fmt(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [total, noise, bias, aliasing] =
            [self.total, self.noise, self.bias, self.aliasing].map(|part| format!("{:.2} %", 100.0 * part));
        write!(text, "relative error about {total} (noise {noise}, bias {bias}")?;
        if self.aliasing > 0.0 {
            write!(text, ", aliasing {aliasing}")?;
        }
        if self.missing > NOTABLE * self.total {
            let missing = 100.0 * self.missing;
            write!(text, ", light behind glass that no photon has found yet {missing:.2} %")?;
        }
        text.write_str(")")
    }
}

/// A dark pixel beside a bright area has little light of its own: relative to the light that R blurs into it, the error would
/// seem small. Four standard errors of the curvature are uncertain.
fn own_part(curvature: &Spread, channels: &[Spread; 3]) -> f64 {
    let brought = BIAS_PER_CURVATURE * (-curvature.mean - 4.0 * curvature.noise2().sqrt()).max(0.0);
    let mean = channels.iter().map(|channel| channel.mean).sum::<f64>() / 3.0;
    if mean > 0.0 {
        (1.0 - brought / mean).max(0.0)
    } else {
        1.0
    }
}

/// The radiance of a white surface by one photon in one iteration. A pixel without photons might as well have received one: that
/// contribution is its standard error.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct OnePhoton {
    /// Radiance.
    pub radiance: f64,
    /// The corresponding R², in square render units.
    pub radius2: f64,
}

/// For a photon of the pilots' average flux, or of the lights' total `power`, at the median of the initial radii.
pub fn of_one_photon(power: f64, backend: &dyn Backend, config: &RenderConfig) -> OnePhoton {
    let radius2 = f64::from(backend.radius()).powi(2);
    if radius2 == 0.0 {
        // No surface is visible.
        return OnePhoton::default();
    }
    let flux = backend.photon_flux().unwrap_or(power);
    OnePhoton {
        radiance: flux / f64::from(config.photons) / (std::f64::consts::PI.powi(2) * radius2),
        radius2,
    }
}

impl ErrorEstimate {
    /// For a render; `photon` is [`of_one_photon`].
    pub fn new(config: &RenderConfig, photon: OnePhoton) -> Self {
        Self {
            sees_centres: config.estimator == Estimator::Ppm,
            photon,
        }
    }

    /// Whether an estimate pays for its time after this number of iterations: all sequences have had the same number, and it has
    /// grown by about a quarter since the last estimate.
    pub fn is_due(iterations: u32) -> bool {
        iterations >= SEQUENCES && iterations.is_multiple_of(SEQUENCES.max(1 << iterations.ilog2().saturating_sub(2)))
    }

    /// The squared errors of the picture after `iterations` iterations; `None` before each sequence has had one, and while the
    /// picture is black.
    fn parts(&self, iterations: SequenceIterations, picture: &Resolved) -> Option<Parts> {
        let floor = floor_of(&picture.image);
        if iterations.0.contains(&0) || floor <= 0.0 {
            return None;
        }
        let weights = Weights::of(iterations);
        let (width, pixels) = (picture.image.width(), picture.waits.len());
        let spread_of = |pixel: usize, channel: usize| {
            let of_sequence = |sequence: usize| f64::from(picture.sequences[sequence * pixels + pixel][channel]);
            Spread::of(weights, std::array::from_fn(of_sequence))
        };
        let around = [0, 1, 2].map(|channel| {
            let values = picture.image.pixels().iter().map(|pixel| f64::from(pixel[channel]));
            parts::sums_around(&values.collect::<Vec<_>>(), width)
        });
        let photon = self.photon.radiance / iterations.total();
        let of_pixel = |pixel: usize| {
            let curvature = spread_of(pixel, 3);
            let without_photons = picture.waits[pixel];
            let photon2 = if without_photons { photon.powi(2) } else { 0.0 };
            // Excluding the pixel itself.
            let mean_around = |channel: usize, value: f64| {
                let (sum, count) = around[channel][pixel];
                if count > 1 {
                    (sum - value) / (count - 1) as f64
                } else {
                    value
                }
            };
            let channels: [Spread; 3] = std::array::from_fn(|channel| spread_of(pixel, channel));
            OfPixel {
                values: channels.each_ref().map(|spread| spread.mean),
                noise2: channels.each_ref().map(|spread| spread.noise2() + photon2),
                relative_noise2: std::array::from_fn(|channel| {
                    let spread = &channels[channel];
                    let value = f64::from(picture.image.pixels()[pixel][channel]);
                    spread.relative_noise2(mean_around(channel, value), floor) + photon2 / (spread.mean.powi(2) + floor)
                }),
                photon2,
                own: own_part(&curvature, &channels),
                bias2: (curvature.mean.powi(2) - curvature.noise2()) * BIAS_PER_CURVATURE.powi(2),
            }
        };
        Some(Parts {
            width,
            pixels: (0..pixels).into_par_iter().map(of_pixel).collect(),
            floor,
            sees_centres: self.sees_centres,
            missing: missing::missing(&picture.behind_glass, width, photon * self.photon.radius2),
        })
    }

    /// The error of the picture after `iterations` iterations; `None` before there are enough, and while it is black.
    pub fn relative(&self, iterations: impl Into<SequenceIterations>, picture: &Resolved) -> Option<RelativeError> {
        let parts = self.parts(iterations.into(), picture)?;
        let noise2 = parts.relative_noise2();
        let [bias2, aliasing2] = [parts.relative_bias2(), parts.relative_aliasing2()].map(|part| part.max(0.0));
        let missing2 = parts.relative_missing2();
        let total2 = noise2 + bias2 + aliasing2 + missing2;
        let (photon2, waiting) = parts.without_photons();
        Some(RelativeError {
            total: total2.sqrt(),
            noise: noise2.sqrt(),
            bias: bias2.sqrt(),
            aliasing: aliasing2.sqrt(),
            missing: missing2.max(0.0).sqrt(),
            waiting: if photon2 > NOTABLE.powi(2) * total2 {
                waiting
            } else {
                0.0
            },
        })
    }

    /// The squared noise of each pixel's channels, in units of radiance; `None` as in [`ErrorEstimate::relative`].
    pub fn noise2_of_pixels(
        &self,
        iterations: impl Into<SequenceIterations>,
        picture: &Resolved,
    ) -> Option<Vec<[f64; 3]>> {
        let parts = self.parts(iterations.into(), picture)?;
        Some(parts.pixels.into_iter().map(|pixel| pixel.noise2).collect())
    }

    /// The error of each pixel, root of the mean square, in units of radiance; `None` as in [`ErrorEstimate::relative`], whose
    /// error they add up to. A pixel's bias is that of the pixels around it: its own estimate is dominated by noise.
    pub fn of_pixels(&self, iterations: impl Into<SequenceIterations>, picture: &Resolved) -> Option<Image> {
        let parts = self.parts(iterations.into(), picture)?;
        let errors = parts
            .of_pixels()
            .into_iter()
            .map(|error2| error2.map(|part| part.sqrt() as f32));
        Some(Image::new(
            picture.image.width(),
            picture.image.height(),
            errors.collect(),
        ))
    }
}

#[cfg(test)]
mod tests;
