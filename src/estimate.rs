//! How far the picture is from the truth, as far as it can tell by itself.
//!
//! The picture after n iterations is the mean of n pictures: eq. 3 scales τ as eq. 2 scales R², so τ / R² is the sum of
//! every iteration's flux over its own R². Pictures that are taken now and then therefore give the means of batches of
//! iterations, which are independent of each other ([`crate::config::RenderConfig::block_of`]); their spread tells the
//! noise.
//!
//! The bias is what R blurs. Photons are summed up a second time, weighed with 1 − 2 d²/R² by their distance d: where their
//! density is even or falls evenly that sum vanishes, where it bends it is a third of what the blur adds, with the opposite
//! sign. (Hachisuka and others, «A Progressive Error Estimation Framework for Photon Density Estimation», 2010, have the same
//! two parts, and derivatives from a kernel of their own.)

use crate::backend::{Backend, Resolved};
use crate::config::RenderConfig;
use crate::film::Image;
use crate::metrics::REL_MSE_FLOOR;
use crate::scene::PackedScene;

/// Batches at the most; then neighbours are joined. Even, so that the halves are alike.
const MOST_BATCHES: usize = 8;
/// Batches from which an estimate is made.
const FEWEST_BATCHES: usize = 4;
/// Bias over curvature, root of the mean square: 3 where the density bends evenly, for a disc's means of r² and of
/// r² (1 − 2 r²) are 1/2 and −1/6; 5.46 across the edge of a shadow, by integrating both over its distance. Between them.
const BIAS_PER_CURVATURE: f64 = 4.05;

/// Pictures taken while a render goes on, and what follows from them.
#[derive(Debug)]
pub struct ErrorEstimate {
    alpha: f64,
    /// Radiance that a photon gives a pixel in an iteration, see [`of_one_photon`].
    photon: f64,
    /// Iterations of a batch.
    batch: u32,
    /// Pictures after 1, 2, … batches.
    pictures: Vec<Resolved>,
}

/// An estimate of the relative error, as root of relMSE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeError {
    /// All of it.
    pub total: f64,
    /// By noise.
    pub noise: f64,
    /// By bias.
    pub bias: f64,
}

/// Radiance that a photon of average power gives a white surface in one iteration, at the initial radius. That none has come
/// to a pixel is a number that may as well have been one: what one would give is the standard error there.
pub fn of_one_photon(scene: &PackedScene, backend: &dyn Backend, config: &RenderConfig) -> f64 {
    let radius2 = f64::from(backend.radius()).powi(2);
    scene.power / f64::from(config.photons) / (std::f64::consts::PI.powi(2) * radius2)
}

/// The squared errors of each pixel after some iterations.
struct Parts {
    /// Of each channel, as the last picture has it.
    values: Vec<[f64; 3]>,
    /// Of each channel.
    noise2: Vec<[f64; 3]>,
    /// Of the mean of the channels; of noise alone it is 0 on average.
    bias2: Vec<f64>,
    /// relMSE's denominator beside the square.
    floor: f64,
}

impl Parts {
    /// A channel's bias is in proportion to its value; its square over the pixel's.
    fn share2(values: &[f64; 3]) -> [f64; 3] {
        let mean = values.iter().sum::<f64>() / 3.0;
        values.map(|value| if mean > 0.0 { (value / mean).powi(2) } else { 0.0 })
    }

    /// Part of relMSE of these squared biases.
    fn relative_bias2(&self, bias2: &[f64]) -> f64 {
        let of_pixel = |(values, bias2): (&[f64; 3], &f64)| {
            let shares = Self::share2(values).into_iter().zip(values);
            let weighed: f64 = shares.map(|(share, value)| share / (value * value + self.floor)).sum();
            bias2 * weighed
        };
        self.values.iter().zip(bias2).map(of_pixel).sum::<f64>() / (3 * self.values.len()) as f64
    }

    /// Part of relMSE of the noise.
    fn relative_noise2(&self) -> f64 {
        let pairs = self.values.as_flattened().iter().zip(self.noise2.as_flattened());
        let sum: f64 = pairs.map(|(value, noise2)| noise2 / (value * value + self.floor)).sum();
        sum / (3 * self.values.len()) as f64
    }
}

impl ErrorEstimate {
    /// Before the first iteration of a render with eq. 2's α; `photon` is [`of_one_photon`].
    pub fn new(alpha: f32, photon: f64) -> Self {
        Self {
            alpha: f64::from(alpha),
            photon,
            batch: 1,
            pictures: Vec::new(),
        }
    }

    /// Whether a picture is wanted after so many iterations.
    pub fn wants(&self, iterations: u32) -> bool {
        iterations == self.batch * (self.pictures.len() as u32 + 1)
    }

    /// Takes the picture after so many iterations; those that aren't wanted are left out.
    pub fn add(&mut self, iterations: u32, picture: Resolved) {
        if !self.wants(iterations) {
            return;
        }
        self.pictures.push(picture);
        if self.pictures.len() > MOST_BATCHES {
            // The last one begins the next batch of twice the size, and is taken again when that is whole.
            self.pictures.truncate(MOST_BATCHES);
            let mut index = 0;
            self.pictures.retain(|_| {
                index += 1;
                index % 2 == 0
            });
            self.batch *= 2;
        }
    }

    /// Batches of which the estimate is made.
    fn batches(&self) -> Option<&[Resolved]> {
        (self.pictures.len() >= FEWEST_BATCHES).then_some(&self.pictures)
    }

    /// Mean of the batches and its squared standard error, from the values of the pictures after 1, 2, … of them.
    fn mean_and_noise2(cumulative: impl Fn(usize) -> f32, count: usize) -> (f64, f64) {
        let sum = |batches: usize| match batches {
            0 => 0.0,
            n => f64::from(cumulative(n - 1)) * n as f64,
        };
        let mean = sum(count) / count as f64;
        let squares: f64 = (0..count).map(|n| (sum(n + 1) - sum(n) - mean).powi(2)).sum();
        (mean, squares / (count * (count - 1)) as f64)
    }

    /// What is known after so many iterations; `None` before there are enough, and while the picture is black.
    fn parts(&self, iterations: u32) -> Option<Parts> {
        let pictures = self.batches()?;
        let count = pictures.len();
        // Since the last picture the noise has fallen as n^−α, the bias as n^(α−1).
        let taken = f64::from(self.batch) * count as f64;
        let since = f64::from(iterations.max(1)) / taken;
        let (fallen_noise, fallen_bias) = (since.powf(-self.alpha), since.powf(2.0 * (self.alpha - 1.0)));
        let photon2 = (self.photon / taken).powi(2);
        let mut parts = Parts {
            values: Vec::new(),
            noise2: Vec::new(),
            bias2: Vec::new(),
            floor: 0.0,
        };
        for (pixel, last) in pictures[count - 1].curvature.iter().enumerate() {
            let without_photons = last.is_infinite();
            let channels = [0, 1, 2]
                .map(|channel: usize| Self::mean_and_noise2(|n| pictures[n].image.pixels()[pixel][channel], count));
            let (curvature, curvature_noise2) = Self::mean_and_noise2(
                |n| {
                    let curvature = pictures[n].curvature[pixel];
                    if curvature.is_finite() { curvature } else { 0.0 }
                },
                count,
            );
            parts.values.push(channels.map(|(value, _)| value));
            parts.noise2.push(
                channels.map(|(_, noise2)| (noise2 + if without_photons { photon2 } else { 0.0 }) * fallen_noise),
            );
            let bias2 = (curvature * curvature - curvature_noise2) * BIAS_PER_CURVATURE.powi(2);
            parts.bias2.push(bias2 * fallen_bias);
        }
        let mean = parts.values.as_flattened().iter().sum::<f64>() / (3 * parts.values.len()) as f64;
        parts.floor = REL_MSE_FLOOR * mean * mean;
        (parts.floor > 0.0).then_some(parts)
    }

    /// The estimate after so many iterations; `None` before there are enough, and while the picture is black.
    pub fn relative(&self, iterations: u32) -> Option<RelativeError> {
        let parts = self.parts(iterations)?;
        let noise2 = parts.relative_noise2();
        let bias2 = parts.relative_bias2(&parts.bias2).max(0.0);
        Some(RelativeError {
            total: (noise2 + bias2).sqrt(),
            noise: noise2.sqrt(),
            bias: bias2.sqrt(),
        })
    }

    /// The error of each pixel by noise and bias, root of the mean square, in units of radiance; `None` as in
    /// [`ErrorEstimate::relative`], whose error is that of all these together. A pixel's bias is that of the pixels around it:
    /// its own is all but lost in noise.
    pub fn of_pixels(&self, iterations: u32) -> Option<Image> {
        let parts = self.parts(iterations)?;
        let last = &self.pictures.last()?.image;
        let around: Vec<f64> = mean_around(&parts.bias2, last.width())
            .into_iter()
            .map(|bias2| bias2.max(0.0))
            .collect();
        // What noise made negative is missing: without this the picture's error were smaller than that of its pixels.
        let [whole, of_pixels] = [&parts.bias2, &around].map(|bias2| parts.relative_bias2(bias2).max(0.0));
        let scale = if of_pixels > 0.0 { whole / of_pixels } else { 0.0 };
        let pixels = parts.values.iter().zip(&parts.noise2).zip(around);
        let pixels = pixels.map(|((values, noise2), bias2)| {
            let share2 = Parts::share2(values);
            [0, 1, 2].map(|channel: usize| (noise2[channel] + scale * bias2 * share2[channel]).sqrt() as f32)
        });
        Some(Image::new(last.width(), last.height(), pixels.collect()))
    }
}

/// Mean over the pixels that are no more than two columns or rows away.
fn mean_around(values: &[f64], width: usize) -> Vec<f64> {
    const REACH: usize = 2;
    let height = values.len() / width;
    let near = |at: usize, side: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(side);
    let mean = |pixel: usize| {
        let (columns, rows) = (near(pixel % width, width), near(pixel / width, height));
        let count = columns.len() * rows.len();
        let sum: f64 = rows
            .map(|row| values[row * width..][columns.clone()].iter().sum::<f64>())
            .sum();
        sum / count as f64
    };
    (0..values.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform in [0, 1), the same in every run.
    fn random(index: u32, seed: u32) -> f64 {
        f64::from(crate::cpu::pcg4d([index, seed, 7, 11])[0]) / 4_294_967_296.0
    }

    /// A picture of 1 everywhere after so many iterations, with noise of this deviation in each, a bias of
    /// `bias`·i^(α−1) in iteration i, and the curvature that smooth light of that bias has, as noisy as the picture.
    fn rendered(iterations: u32, deviation: f64, bias: f64, alpha: f32) -> (ErrorEstimate, f64) {
        const PIXELS: usize = 2000;
        let mut estimate = ErrorEstimate::new(alpha, 0.0);
        let mut sums = vec![[0.0f64; 4]; PIXELS];
        let mut last = Vec::new();
        for i in 1..=iterations {
            let now = bias * f64::from(i).powf(f64::from(alpha) - 1.0);
            for (index, sum) in sums.iter_mut().flatten().enumerate() {
                let noise = (random(index as u32, i) - 0.5) * 12f64.sqrt() * deviation;
                *sum += noise + if index % 4 == 3 { -now / 3.0 } else { 1.0 + now };
            }
            last = sums
                .iter()
                .map(|sum| sum.map(|value| (value / f64::from(i)) as f32))
                .collect();
            estimate.add(i, Resolved::from_film([50, PIXELS as u32 / 50], &last));
        }
        let channels = last.iter().flat_map(|pixel: &[f32; 4]| &pixel[..3]);
        let squares: f64 = channels.map(|&value| (f64::from(value) - 1.0).powi(2)).sum();
        let rel_mse = squares / (3 * PIXELS) as f64 / 1.01;
        (estimate, rel_mse.sqrt())
    }

    #[test]
    fn noise_is_estimated_from_the_spread_of_batches() {
        for iterations in [8, 16, 100, 257] {
            let (estimate, truth) = rendered(iterations, 0.5, 0.0, 2.0 / 3.0);
            let found = estimate.relative(iterations).expect("an estimate");
            // This noise falls as n^−1, not n^−α: between pictures the estimate lags by a few per cent.
            assert!(
                (found.noise / truth - 1.0).abs() < 0.12,
                "{iterations} iterations: {found:?}, the truth is {truth}"
            );
        }
    }

    #[test]
    fn bias_is_estimated_from_the_curvature() {
        for alpha in [0.5, 2.0 / 3.0, 0.8] {
            let (estimate, truth) = rendered(192, 0.05, 0.1, alpha);
            let found = estimate.relative(192).expect("an estimate");
            // Smooth light's bias is 3 times the curvature; edges have more, and the estimate lies between.
            let expected = truth * BIAS_PER_CURVATURE / 3.0;
            assert!(
                (found.total / expected - 1.0).abs() < 0.1,
                "α {alpha}: {found:?}, the truth is {truth}"
            );
            assert!(found.bias > found.noise, "α {alpha}: {found:?}");
        }
    }

    #[test]
    fn the_error_of_pixels_has_noise_and_bias_and_its_mean_square_is_that_of_the_picture() {
        let (estimate, _) = rendered(192, 0.1, 0.1, 2.0 / 3.0);
        let picture = estimate.relative(192).expect("an estimate");
        let pixels = estimate.of_pixels(192).expect("errors");
        let samples = pixels.pixels().as_flattened();
        let mean_square = samples.iter().map(|&error| f64::from(error).powi(2)).sum::<f64>() / samples.len() as f64;
        // All pixels have about one value, and relMSE's floor is a hundredth of its square.
        let [value, ..] = crate::metrics::mean(&estimate.pictures[estimate.pictures.len() - 1].image);
        let found = (mean_square / 1.01).sqrt() / value;
        assert!(
            (found / picture.total - 1.0).abs() < 0.01,
            "{found}, of the picture {picture:?}"
        );
    }

    #[test]
    fn a_black_picture_has_no_estimate_and_pixels_without_photons_may_lack_one() {
        let taken = |pixels: &[[f32; 4]]| {
            let mut estimate = ErrorEstimate::new(0.5, 6.0);
            (1..=8).for_each(|i| estimate.add(i, Resolved::from_film([2, 1], pixels)));
            estimate.relative(8)
        };
        assert_eq!(taken(&[[0.0; 4]; 2]), None);
        let lit = [1.0, 1.0, 1.0, 0.0];
        assert_eq!(taken(&[lit; 2]).expect("an estimate").total, 0.0);
        // Half of the pixels, each off by what one photon gives in eight iterations, against a hundredth of the mean's square.
        let half = taken(&[lit, [0.0, 0.0, 0.0, f32::INFINITY]]).expect("an estimate");
        let expected = (0.5 * 0.75f64.powi(2) / (0.01 * 0.25)).sqrt();
        assert!(
            (half.noise / expected - 1.0).abs() < 1e-9,
            "{half:?}, {expected} expected"
        );
    }

    #[test]
    fn the_first_iterations_give_no_estimate_and_memory_stays_bounded() {
        let mut estimate = ErrorEstimate::new(0.5, 0.0);
        for i in 1..=1000 {
            assert_eq!(
                estimate.relative(i).is_some(),
                estimate.pictures.len() >= FEWEST_BATCHES
            );
            estimate.add(i, Resolved::from_film([1, 1], &[[1.0; 4]]));
            assert!(estimate.pictures.len() <= MOST_BATCHES);
        }
        assert!(estimate.relative(1000).is_some());
    }
}
