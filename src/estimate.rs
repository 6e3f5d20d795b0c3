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

use crate::backend::Resolved;
use crate::film::Image;
use crate::metrics::REL_MSE_FLOOR;

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

impl ErrorEstimate {
    /// Before the first iteration of a render with eq. 2's α.
    pub fn new(alpha: f32) -> Self {
        Self {
            alpha: f64::from(alpha),
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

    /// Each channel of each pixel: value, and squared standard error.
    fn values(pictures: &[Resolved]) -> impl Iterator<Item = (f64, f64)> + '_ {
        let count = pictures.len();
        let samples = pictures[0].curvature.len() * 3;
        (0..samples)
            .map(move |index| Self::mean_and_noise2(|n| pictures[n].image.pixels().as_flattened()[index], count))
    }

    /// The squared bias of each pixel, in the mean of its channels; of noise alone it is 0 on average.
    fn bias2(pictures: &[Resolved]) -> impl Iterator<Item = f64> + '_ {
        let count = pictures.len();
        (0..pictures[0].curvature.len()).map(move |pixel| {
            let (mean, noise2) = Self::mean_and_noise2(|n| pictures[n].curvature[pixel], count);
            (mean * mean - noise2) * BIAS_PER_CURVATURE.powi(2)
        })
    }

    /// The estimate after so many iterations; `None` before there are enough.
    pub fn relative(&self, iterations: u32) -> Option<RelativeError> {
        let pictures = self.batches()?;
        let values: Vec<(f64, f64)> = Self::values(pictures).collect();
        let count = values.len() as f64;
        let mean = values.iter().map(|(value, _)| value).sum::<f64>() / count;
        let floor = REL_MSE_FLOOR * mean * mean;
        if floor == 0.0 {
            return Some(RelativeError {
                total: 0.0,
                noise: 0.0,
                bias: 0.0,
            });
        }
        let (mut noise2, mut bias2) = (0.0, 0.0);
        for (channels, bias) in values.chunks_exact(3).zip(Self::bias2(pictures)) {
            let mean = channels.iter().map(|(value, _)| value).sum::<f64>() / 3.0;
            for (value, noise) in channels {
                let weight = 1.0 / (value * value + floor);
                noise2 += noise * weight;
                // Each channel has its share of the bias.
                if mean > 0.0 {
                    bias2 += bias * (value / mean).powi(2) * weight;
                }
            }
        }
        // Since the last picture the noise has fallen as n^−α, the bias as n^(α−1).
        let taken = f64::from(self.batch) * pictures.len() as f64;
        let since = f64::from(iterations.max(1)) / taken;
        let noise2 = noise2 / count * since.powf(-self.alpha);
        let bias2 = (bias2 / count).max(0.0) * since.powf(2.0 * (self.alpha - 1.0));
        Some(RelativeError {
            total: (noise2 + bias2).sqrt(),
            noise: noise2.sqrt(),
            bias: bias2.sqrt(),
        })
    }

    /// The error of each pixel by noise and bias, root of the mean square, in units of radiance; `None` before there are
    /// enough iterations. A pixel's bias is that of the pixels around it: its own is all but lost in noise.
    pub fn of_pixels(&self) -> Option<Image> {
        let pictures = self.batches()?;
        let last = &pictures[pictures.len() - 1].image;
        let values: Vec<(f64, f64)> = Self::values(pictures).collect();
        let bias2 = mean_around(&Self::bias2(pictures).collect::<Vec<_>>(), last.width());
        let pixels = values.as_chunks::<3>().0.iter().zip(bias2);
        let pixels = pixels.map(|(channels, bias2)| {
            let mean = channels.iter().map(|(value, _)| value).sum::<f64>() / 3.0;
            channels.map(|(value, noise2)| {
                let share = if mean > 0.0 { value / mean } else { 0.0 };
                (noise2 + bias2.max(0.0) * share * share).sqrt() as f32
            })
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
        let mut estimate = ErrorEstimate::new(alpha);
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
        let pixels = estimate.of_pixels().expect("errors");
        let samples = pixels.pixels().as_flattened();
        let mean_square = samples.iter().map(|&error| f64::from(error).powi(2)).sum::<f64>() / samples.len() as f64;
        // Values of 1 with relMSE's floor. A negative squared bias, which noise makes, counts 0 in a pixel.
        let found = (mean_square / 1.01).sqrt();
        assert!(
            (found / picture.total - 1.0).abs() < 0.05,
            "{found}, of the picture {picture:?}"
        );
    }

    #[test]
    fn the_first_iterations_give_no_estimate_and_memory_stays_bounded() {
        let mut estimate = ErrorEstimate::new(0.5);
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
