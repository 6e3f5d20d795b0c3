//! How far the picture is from the truth, as far as it can tell by itself.
//!
//! The picture after n iterations is the mean of n pictures that hardly depend on each other: eq. 3 scales τ as eq. 2 scales
//! R², so τ / R² is the sum of every iteration's flux over its own R². Pictures that are taken now and then therefore give
//! the means of batches of iterations, whose spread tells the noise. The bias falls with the radius: what the earlier half of
//! the batches differs from the later one beyond their noise tells how much bias is left. (Hachisuka and others, «A
//! Progressive Error Estimation Framework for Photon Density Estimation», 2010, have the same two parts, with the bias from
//! derivatives of the kernel.)

use crate::film::Image;
use crate::metrics::REL_MSE_FLOOR;

/// Batches at the most; then neighbours are joined. Even, so that the halves are alike.
const MOST_BATCHES: usize = 8;
/// Batches from which an estimate is made.
const FEWEST_BATCHES: usize = 4;

/// Pictures taken while a render goes on, and what follows from them.
#[derive(Debug)]
pub struct ErrorEstimate {
    alpha: f64,
    /// Iterations of a batch.
    batch: u32,
    /// Pictures after 1, 2, … batches.
    pictures: Vec<Image>,
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
    pub fn add(&mut self, iterations: u32, picture: Image) {
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

    /// Batches of which the estimate is made: an even number.
    fn batches(&self) -> Option<&[Image]> {
        let even = self.pictures.len() / 2 * 2;
        (even >= FEWEST_BATCHES).then(|| &self.pictures[..even])
    }

    /// Each channel of each pixel.
    fn samples(pictures: &[Image]) -> impl Iterator<Item = Sample> + '_ {
        let count = pictures.len();
        let samples = pictures[count - 1].pixels().as_flattened().len();
        (0..samples).map(move |index| {
            let cumulative = |batches: usize| match batches {
                0 => 0.0,
                n => f64::from(pictures[n - 1].pixels().as_flattened()[index]) * n as f64,
            };
            let mean = |from: usize, to: usize| (cumulative(to) - cumulative(from)) / (to - from) as f64;
            // Squared standard error of the mean of some batches.
            let noise2 = |from: usize, to: usize| {
                let middle = mean(from, to);
                let squares: f64 = (from..to).map(|batch| (mean(batch, batch + 1) - middle).powi(2)).sum();
                squares / ((to - from) * (to - from - 1)) as f64
            };
            let half = count / 2;
            let difference = mean(0, half) - mean(half, count);
            Sample {
                value: mean(0, count),
                noise2: noise2(0, count),
                drift2: difference * difference - noise2(0, half) - noise2(half, count),
            }
        })
    }

    /// The estimate after so many iterations; `None` before there are enough.
    pub fn relative(&self, iterations: u32) -> Option<RelativeError> {
        let pictures = self.batches()?;
        let last = &pictures[pictures.len() - 1];
        let values = last.pixels().as_flattened();
        let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64;
        let floor = REL_MSE_FLOOR * mean * mean;
        if floor == 0.0 {
            return Some(RelativeError {
                total: 0.0,
                noise: 0.0,
                bias: 0.0,
            });
        }
        let (mut noise2, mut drift2) = (0.0, 0.0);
        for sample in Self::samples(pictures) {
            let weight = 1.0 / (sample.value * sample.value + floor);
            noise2 += sample.noise2 * weight;
            drift2 += sample.drift2 * weight;
        }
        let count = values.len() as f64;
        // Since the last picture the noise has fallen as n^−α, the bias as n^(α−1).
        let taken = f64::from(self.batch) * pictures.len() as f64;
        let since = f64::from(iterations.max(1)) / taken;
        let noise2 = noise2 / count * since.powf(-self.alpha);
        let bias2 =
            (drift2 / count).max(0.0) * self.bias_per_drift(taken).powi(2) * since.powf(2.0 * (self.alpha - 1.0));
        Some(RelativeError {
            total: (noise2 + bias2).sqrt(),
            noise: noise2.sqrt(),
            bias: bias2.sqrt(),
        })
    }

    /// The mean picture's bias over the difference between its halves': bias goes with R², and R² with i^(α−1).
    fn bias_per_drift(&self, iterations: f64) -> f64 {
        // The sum of i^(α−1) up to n, by the trapezoidal rule.
        let alpha = self.alpha;
        let up_to = |n: f64| (n.powf(alpha) - 1.0) / alpha + 0.5 * (1.0 + n.powf(alpha - 1.0));
        let half = 0.5 * iterations;
        let (early, late) = (up_to(half) / half, (up_to(iterations) - up_to(half)) / half);
        up_to(iterations) / iterations / (early - late)
    }

    /// Standard error of each pixel by noise, in units of radiance; `None` before there are enough iterations.
    pub fn standard_errors(&self) -> Option<Image> {
        let pictures = self.batches()?;
        let last = &pictures[pictures.len() - 1];
        let errors: Vec<f32> = Self::samples(pictures)
            .map(|sample| sample.noise2.sqrt() as f32)
            .collect();
        let pixels = errors
            .chunks_exact(3)
            .map(|pixel| [pixel[0], pixel[1], pixel[2]])
            .collect();
        Some(Image::new(last.width(), last.height(), pixels))
    }
}

/// A channel of a pixel.
struct Sample {
    /// Mean of all batches.
    value: f64,
    /// Its squared standard error.
    noise2: f64,
    /// Squared difference of the earlier and the later half, less its noise.
    drift2: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform in [0, 1), the same in every run.
    fn random(index: u32, seed: u32) -> f64 {
        f64::from(crate::cpu::pcg4d([index, seed, 7, 11])[0]) / 4_294_967_296.0
    }

    /// Renders a picture of 1 everywhere, with noise of this deviation and a bias of `bias`·i^(α−1) in iteration i.
    fn rendered(iterations: u32, deviation: f64, bias: f64, alpha: f32) -> (ErrorEstimate, f64) {
        const PIXELS: usize = 2000;
        let mut estimate = ErrorEstimate::new(alpha);
        let mut sums = vec![[0.0f64; 3]; PIXELS];
        let mut last = Vec::new();
        for i in 1..=iterations {
            for (index, sum) in sums.iter_mut().flatten().enumerate() {
                let noise = (random(index as u32, i) - 0.5) * 12f64.sqrt() * deviation;
                *sum += 1.0 + noise + bias * f64::from(i).powf(f64::from(alpha) - 1.0);
            }
            last = sums
                .iter()
                .map(|sum| sum.map(|value| (value / f64::from(i)) as f32))
                .collect();
            estimate.add(i, Image::new(PIXELS, 1, last.clone()));
        }
        let squares: f64 = last
            .iter()
            .flatten()
            .map(|&value| (f64::from(value) - 1.0).powi(2))
            .sum();
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
                (found.total / truth - 1.0).abs() < 0.12,
                "{iterations} iterations: {found:?}, the truth is {truth}"
            );
        }
    }

    #[test]
    fn bias_is_estimated_from_the_halves() {
        for alpha in [0.5, 2.0 / 3.0, 0.8] {
            let (estimate, truth) = rendered(192, 0.05, 0.1, alpha);
            let found = estimate.relative(192).expect("an estimate");
            assert!(
                (found.total / truth - 1.0).abs() < 0.2,
                "α {alpha}: {found:?}, the truth is {truth}"
            );
            assert!(found.bias > found.noise, "α {alpha}: {found:?}");
        }
    }

    #[test]
    fn the_first_iterations_give_no_estimate_and_memory_stays_bounded() {
        let mut estimate = ErrorEstimate::new(0.5);
        for i in 1..=1000 {
            assert_eq!(
                estimate.relative(i).is_some(),
                estimate.pictures.len() >= FEWEST_BATCHES
            );
            estimate.add(i, Image::new(1, 1, vec![[1.0; 3]]));
            assert!(estimate.pictures.len() <= MOST_BATCHES);
        }
        assert!(estimate.relative(1000).is_some());
    }
}
