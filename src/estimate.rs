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
//!
//! The paper's estimator looks through the centres of pixels for ever. What that leaves out is told from how much pixels
//! differ from their neighbours (`estimate/parts.rs`).

mod parts;

use rayon::prelude::*;

use crate::backend::{Backend, Resolved};
use crate::config::{Estimator, RenderConfig};
use crate::film::Image;
use crate::metrics::floor_of;
use crate::scene::PackedScene;
use parts::{OfPixel, Parts};

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
    /// Whether pixels are seen through their centres alone.
    sees_centres: bool,
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
    /// By the blur of the radius.
    pub bias: f64,
    /// By looking through the centres of pixels alone, which [`Estimator::Ppm`] does.
    pub aliasing: f64,
}

impl std::fmt::Display for RelativeError {
    fn fmt(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [total, noise, bias, aliasing] =
            [self.total, self.noise, self.bias, self.aliasing].map(|part| format!("{:.2} %", 100.0 * part));
        write!(text, "relative error about {total} (noise {noise}, bias {bias}")?;
        if self.aliasing > 0.0 {
            write!(text, ", centres of pixels alone {aliasing}")?;
        }
        text.write_str(")")
    }
}

/// Radiance that a photon of average power gives a white surface in one iteration, at the initial radius. That none has come
/// to a pixel is a number that may as well have been one: what one would give is the standard error there.
pub fn of_one_photon(scene: &PackedScene, backend: &dyn Backend, config: &RenderConfig) -> f64 {
    let radius2 = f64::from(backend.radius()).powi(2);
    scene.power / f64::from(config.photons) / (std::f64::consts::PI.powi(2) * radius2)
}

impl ErrorEstimate {
    /// Before the first iteration of a render; `photon` is [`of_one_photon`].
    pub fn new(config: &RenderConfig, photon: f64) -> Self {
        Self {
            alpha: f64::from(config.alpha),
            sees_centres: config.estimator == Estimator::Ppm,
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

    /// What is known after so many iterations; `None` before there are enough, and while the picture is black.
    fn parts(&self, iterations: u32) -> Option<Parts> {
        let pictures = self.batches()?;
        let last = &pictures[pictures.len() - 1];
        let floor = floor_of(&last.image);
        if floor <= 0.0 {
            return None;
        }
        // Since the last picture the noise has fallen as n^−α, the bias as n^(α−1).
        let taken = f64::from(self.batch) * pictures.len() as f64;
        let since = f64::from(iterations.max(1)) / taken;
        let width = last.image.width();
        let channel_of = |picture: &Resolved, pixel: usize, channel: usize| picture.image.pixels()[pixel][channel];
        let around = [0, 1, 2].map(|channel| {
            let values = (0..last.curvature.len()).map(|pixel| f64::from(channel_of(last, pixel, channel)));
            parts::sums_around(&values.collect::<Vec<_>>(), width)
        });
        let of_pixel = |pixel: usize| {
            let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
            let curvature = Batches::of(pictures.iter().map(|picture| finite(picture.curvature[pixel])));
            let without_photons = last.curvature[pixel].is_infinite();
            let photon2 = if without_photons {
                (self.photon / taken).powi(2)
            } else {
                0.0
            };
            // Without the pixel itself.
            let mean_around = |channel: usize, value: f64| {
                let (sum, count) = around[channel][pixel];
                if count > 1 {
                    (sum - value) / (count - 1) as f64
                } else {
                    value
                }
            };
            let channels: [Batches; 3] = std::array::from_fn(|channel| {
                Batches::of(pictures.iter().map(|picture| channel_of(picture, pixel, channel)))
            });
            OfPixel {
                values: channels.each_ref().map(|batches| batches.mean),
                noise2: channels.each_ref().map(|batches| batches.noise2() + photon2),
                relative_noise2: std::array::from_fn(|channel| {
                    let batches = &channels[channel];
                    batches.relative_noise2(mean_around(channel, batches.mean), floor)
                        + photon2 / (batches.mean.powi(2) + floor)
                }),
                bias2: (curvature.mean.powi(2) - curvature.noise2()) * BIAS_PER_CURVATURE.powi(2),
            }
        };
        Some(Parts {
            width,
            pixels: (0..last.curvature.len()).into_par_iter().map(of_pixel).collect(),
            floor,
            fallen: [since.powf(-self.alpha), since.powf(2.0 * (self.alpha - 1.0))],
            sees_centres: self.sees_centres,
        })
    }

    /// The estimate after so many iterations; `None` before there are enough, and while the picture is black.
    pub fn relative(&self, iterations: u32) -> Option<RelativeError> {
        let parts = self.parts(iterations)?;
        let noise2 = parts.relative_noise2();
        let [bias2, aliasing2] = [parts.relative_bias2(), parts.relative_aliasing2()].map(|part| part.max(0.0));
        Some(RelativeError {
            total: (noise2 + bias2 + aliasing2).sqrt(),
            noise: noise2.sqrt(),
            bias: bias2.sqrt(),
            aliasing: aliasing2.sqrt(),
        })
    }

    /// The error of each pixel, root of the mean square, in units of radiance; `None` as in [`ErrorEstimate::relative`], of
    /// whose error it is the parts. A pixel's bias is that of the pixels around it: its own is all but lost in noise.
    pub fn of_pixels(&self, iterations: u32) -> Option<Image> {
        let parts = self.parts(iterations)?;
        let last = &self.pictures.last()?.image;
        let errors = parts
            .of_pixels()
            .into_iter()
            .map(|error2| error2.map(|part| part.sqrt() as f32));
        Some(Image::new(last.width(), last.height(), errors.collect()))
    }
}

/// One value of a pixel in each batch of iterations.
struct Batches {
    values: [f64; MOST_BATCHES],
    count: usize,
    mean: f64,
}

impl Batches {
    /// From the pictures after 1, 2, … batches.
    fn of(cumulative: impl Iterator<Item = f32>) -> Self {
        let (mut values, mut count, mut sum) = ([0.0; MOST_BATCHES], 0, 0.0);
        for (own, value) in values.iter_mut().zip(cumulative) {
            count += 1;
            let until_here = f64::from(value) * count as f64;
            *own = until_here - sum;
            sum = until_here;
        }
        let mean = sum / count as f64;
        Self { values, count, mean }
    }

    /// Squared standard error of the mean, a batch's share of it divided by what `divisor` gives for the batch.
    fn noise2_over(&self, divisor: impl Fn(f64) -> f64) -> f64 {
        let count = self.count;
        let squares: f64 = self.values[..count]
            .iter()
            .map(|value| (value - self.mean).powi(2) / divisor(*value))
            .sum();
        squares / (count * (count - 1)) as f64
    }

    /// Squared standard error of the mean.
    fn noise2(&self) -> f64 {
        self.noise2_over(|_| 1.0)
    }

    /// The same over relMSE's denominator. Light that comes seldom and is bright makes a pixel far too bright: over that
    /// value's square its error would seem small. Each batch's part is therefore over what the other batches have of the
    /// pixel, or the pixels around it if that is more, if it is less than what all have.
    fn relative_noise2(&self, around: f64, floor: f64) -> f64 {
        let count = self.count as f64;
        self.noise2_over(|value| {
            let others = (self.mean * count - value) / (count - 1.0);
            others.max(around).min(self.mean).powi(2) + floor
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::REL_MSE_FLOOR;

    /// Uniform in [0, 1), the same in every run.
    fn random(index: u32, seed: u32) -> f64 {
        f64::from(crate::cpu::pcg4d([index, seed, 7, 11])[0]) / 4_294_967_296.0
    }

    fn with_alpha(alpha: f32) -> RenderConfig {
        RenderConfig {
            alpha,
            ..RenderConfig::default()
        }
    }

    /// A picture of 1 everywhere after so many iterations, with noise of this deviation in each, a bias of
    /// `bias`·i^(α−1) in iteration i, and the curvature that smooth light of that bias has, as noisy as the picture.
    fn rendered(iterations: u32, deviation: f64, bias: f64, alpha: f32) -> (ErrorEstimate, f64) {
        const PIXELS: usize = 2000;
        let mut estimate = ErrorEstimate::new(&with_alpha(alpha), 0.0);
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
    fn light_that_comes_seldom_and_is_bright_counts_against_what_pixels_have_without_it() {
        const SIDE: usize = 100;
        const ITERATIONS: u32 = 16;
        let mut estimate = ErrorEstimate::new(&RenderConfig::default(), 0.0);
        let mut sums = vec![0.0; SIDE * SIDE];
        // One look in 200 brings 100 beside the 1 that there always is.
        for i in 1..=ITERATIONS {
            let seldom = (0..).map(|pixel| if random(pixel, i) < 0.005 { 101.0 } else { 1.0 });
            sums.iter_mut().zip(seldom).for_each(|(sum, value)| *sum += value);
            let picture = |sum: &f64| {
                [[(sum / f64::from(i)) as f32; 3].as_slice(), &[0.0]]
                    .concat()
                    .try_into()
                    .expect("four")
            };
            let pixels: Vec<[f32; 4]> = sums.iter().map(picture).collect();
            estimate.add(i, Resolved::from_film([SIDE as u32; 2], &pixels));
        }
        let squares: f64 = sums.iter().map(|sum| (sum / f64::from(ITERATIONS) - 1.5).powi(2)).sum();
        let truth = (squares / (SIDE * SIDE) as f64 / (1.01 * 1.5 * 1.5)).sqrt();
        let found = estimate.relative(ITERATIONS).expect("an estimate").total;
        assert!((found / truth - 1.0).abs() < 0.25, "{found}, the truth is {truth}");
    }

    #[test]
    fn what_lies_beside_the_centres_of_pixels_is_estimated_from_their_neighbours() {
        const SIDE: usize = 100;
        const ROWS: usize = 64;
        // A strip of another brightness whose edges lean by so many pixels a row.
        for (lean, brightness) in [(0.01, 2.0), (0.2, 2.0), (0.5, 2.0), (0.9, 2.0), (0.2, 20.0), (0.9, 0.1)] {
            let at = |x: f64, y: f64| {
                let inside = (30.3..60.8).contains(&(x - lean * (y - 50.0)));
                if inside { brightness } else { 1.0 }
            };
            let centre = |pixel: usize| at((pixel % SIDE) as f64 + 0.5, (pixel / SIDE) as f64 + 0.5);
            let whole = |pixel: usize| {
                let place = |index: usize| (index as f64 + 0.5) / ROWS as f64;
                let (x, y) = ((pixel % SIDE) as f64, (pixel / SIDE) as f64);
                let sum: f64 = (0..ROWS * ROWS)
                    .map(|index| at(x + place(index % ROWS), y + place(index / ROWS)))
                    .sum();
                sum / (ROWS * ROWS) as f64
            };
            let pixels: Vec<[f32; 4]> = (0..SIDE * SIDE)
                .map(|pixel| {
                    let value = centre(pixel) as f32;
                    [value, value, value, 0.0]
                })
                .collect();
            let mean = (0..SIDE * SIDE).map(whole).sum::<f64>() / (SIDE * SIDE) as f64;
            let relative2 = |pixel| {
                let truth = whole(pixel);
                (centre(pixel) - truth).powi(2) / (truth * truth + REL_MSE_FLOOR * mean * mean)
            };
            let truth = ((0..SIDE * SIDE).map(relative2).sum::<f64>() / (SIDE * SIDE) as f64).sqrt();
            let estimated = |estimator| {
                let config = RenderConfig {
                    estimator,
                    ..RenderConfig::default()
                };
                let mut estimate = ErrorEstimate::new(&config, 0.0);
                (1..=4).for_each(|i| estimate.add(i, Resolved::from_film([SIDE as u32; 2], &pixels)));
                estimate.relative(4).expect("an estimate").total
            };
            assert_eq!(estimated(Estimator::Sppm), 0.0);
            let found = estimated(Estimator::Ppm);
            println!("{lean} {brightness}: {found} {truth}");
            assert!(
                found < 1.5 * truth && truth < 1.5 * found,
                "edges that lean by {lean}: {found}, the truth is {truth}"
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
            let mut estimate = ErrorEstimate::new(&with_alpha(0.5), 6.0);
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
        let mut estimate = ErrorEstimate::new(&with_alpha(0.5), 0.0);
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
