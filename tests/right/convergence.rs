//! How fast errors fall, against the theory of progressive photon mapping: Knaus and Zwicker, «Progressive Photon Mapping: A
//! Probabilistic Approach», 2011, and Kaplanyan and Dachsbacher, «Adaptive Progressive Photon Mapping», 2013.
//!
//! R² falls as n^(α−1). An iteration's noise variance is in proportion to 1 / R², so the mean of n of them has n^−α. The
//! bias is in proportion to R² where irradiance is smooth; squared, it falls as n^(−2(1−α)). At an edge it is of the
//! size of the step within R whatever R is: the mean of its square falls as R, as n^(−(1−α)/2).

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, RenderConfig, Sampler};
use ppm_vk::internals::film::Image;
use ppm_vk::internals::metrics::REL_MSE_FLOOR;

use crate::picture::{Subject, reference, small};
use crate::references::{dim_pixels, error_of_reference};

/// Squares of a picture along each side; their errors are all but independent of each other.
const ALONG: usize = 4;
const SQUARES: usize = ALONG * ALONG;
/// What the magnitude of Student's t with 15 degrees of freedom exceeds with a probability of 1e-8.
const STUDENT: f64 = 11.28;

/// Squared errors relative to the reference after a number of iterations, summed over each of the squares.
struct Errors {
    iterations: u32,
    noise: [f64; SQUARES],
    squared_bias: [f64; SQUARES],
    /// Of the picture over the reference, in each channel.
    ratio_of_means: [f64; 3],
}

/// Sums of the pictures that single iterations make, those of even number and those of odd number apart.
struct Halves {
    sums: [Vec<f64>; 2],
    before: Vec<f64>,
}

impl Halves {
    fn new(samples: usize) -> Self {
        Self {
            sums: [vec![0.0; samples], vec![0.0; samples]],
            before: vec![0.0; samples],
        }
    }

    /// Takes the picture after one iteration more. It is the mean of the iterations' own: eq. 3 scales τ as eq. 2 does R².
    fn add(&mut self, iterations: u32, picture: &Image) {
        let half = &mut self.sums[iterations as usize % 2];
        let samples = picture.pixels().as_flattened().iter();
        for ((&value, before), sum) in samples.zip(&mut self.before).zip(half) {
            let cumulative = f64::from(value) * f64::from(iterations);
            *sum += cumulative - *before;
            *before = cumulative;
        }
    }

    /// Both halves have the same bias and independent noise: half their difference is the noise of their mean, and the
    /// product of their errors is the squared bias but for noise of either sign. Their sum is the squared error.
    fn errors(&self, iterations: u32, reference: &Image, dim: &[bool]) -> Errors {
        let references = reference.pixels().as_flattened();
        let count = 3.0 * dim.iter().filter(|dim| **dim).count() as f64;
        let mean = references.iter().map(|&value| f64::from(value)).sum::<f64>() / references.len() as f64;
        let half = f64::from(iterations) / 2.0;
        let mut errors = Errors {
            iterations,
            noise: [0.0; SQUARES],
            squared_bias: [0.0; SQUARES],
            ratio_of_means: [0.0; 3],
        };
        let mut means = [[0.0; 2]; 3];
        for (sample, &reference) in references.iter().enumerate() {
            let (pixel, side) = (sample / 3, dim.len().isqrt());
            if !dim[pixel] {
                continue;
            }
            let square = pixel / side * ALONG / side * ALONG + pixel % side * ALONG / side;
            let reference = f64::from(reference);
            let [even, odd] = [0, 1].map(|half_number| self.sums[half_number][sample] / half - reference);
            let weight = 1.0 / (reference * reference + REL_MSE_FLOOR * mean * mean) / count;
            means[sample % 3][0] += 0.5 * (even + odd) + reference;
            means[sample % 3][1] += reference;
            errors.noise[square] += weight * (0.5 * (even - odd)).powi(2);
            errors.squared_bias[square] += weight * even * odd;
        }
        errors.ratio_of_means = means.map(|[found, expected]| found / expected);
        errors
    }
}

/// Errors after 16, 32, 64, … iterations, of the pixels that don't see the lamp: its edges are no matter of photons.
fn errors(name: &str, config: RenderConfig, iterations: u32) -> Vec<Errors> {
    let (subject, reference) = (Subject::named(name), reference(name));
    let dim = dim_pixels(&reference, reference.width());
    let mut renderer = subject.renderer(config);
    let mut halves = Halves::new(reference.pixels().len() * 3);
    let mut found = Vec::new();
    for iteration in 1..=iterations {
        renderer.iterate().expect("iteration");
        halves.add(iteration, &subject.clean_picture(&mut renderer));
        if iteration.is_power_of_two() && iteration >= 16 {
            found.push(halves.errors(iteration, &reference, &dim));
        }
    }
    found
}

/// Slope of the line through the points, in logarithms, by least squares.
fn log_slope(points: impl Iterator<Item = (u32, f64)>) -> f64 {
    let logs: Vec<[f64; 2]> = points.map(|(n, error)| [f64::from(n).ln(), error.ln()]).collect();
    let mean = |axis: usize| logs.iter().map(|log| log[axis]).sum::<f64>() / logs.len() as f64;
    let (mean_x, mean_y) = (mean(0), mean(1));
    let covariance: f64 = logs.iter().map(|[x, y]| (x - mean_x) * (y - mean_y)).sum();
    covariance / logs.iter().map(|[x, _]| (x - mean_x).powi(2)).sum::<f64>()
}

/// A slope and how far chance may move it.
#[derive(Clone, Copy)]
struct Slope {
    value: f64,
    chance: f64,
}

impl Slope {
    /// Of the sum over the squares, with its deviation by the jackknife: what leaving out each of them changes. For the bias
    /// that is generous, since some squares have more edges than others.
    fn of(errors: &[Errors], part: impl Fn(&Errors, usize) -> f64) -> Self {
        let without = |left_out: usize| {
            let squares = move || (0..SQUARES).filter(move |&square| square != left_out);
            log_slope(
                errors
                    .iter()
                    .map(|error| (error.iterations, squares().map(|square| part(error, square)).sum())),
            )
        };
        let parts: Vec<f64> = (0..SQUARES).map(without).collect();
        let mean = parts.iter().sum::<f64>() / SQUARES as f64;
        let squares: f64 = parts.iter().map(|slope| (slope - mean).powi(2)).sum();
        Self {
            value: without(SQUARES),
            chance: STUDENT * (squares * (SQUARES - 1) as f64 / SQUARES as f64).sqrt(),
        }
    }

    #[track_caller]
    fn assert_between(&self, low: f64, high: f64, what: &str) {
        let text = format!(
            "{what}: slope {:.3} ± {:.3} (chance), from {low:.3} to {high:.3} expected",
            self.value, self.chance
        );
        println!("{text}");
        assert!(
            self.value > low - self.chance && self.value < high + self.chance,
            "{text}"
        );
    }
}

/// Slope of the noise by eq. 2, where a point's photons have the same density in each iteration: M in proportion to R².
fn noise_slope(alpha: f64, iterations: impl Iterator<Item = u32>) -> f64 {
    let noise_after = |count: u32| {
        let (mut radius2, mut n, mut sum) = (1.0, 0.0, 0.0);
        for _ in 0..count {
            sum += 1.0 / radius2;
            let m = radius2;
            radius2 *= (n + alpha * m) / (n + m);
            n += alpha * m;
        }
        sum / f64::from(count).powi(2)
    };
    log_slope(iterations.map(|count| (count, noise_after(count))))
}

/// relMSE's slope, printed with its parts as they fall, and the ratio of means in the end. Photons bring all light.
fn assert_falls_as_theory_says(name: &str, alpha: f32, radius: f64, iterations: u32) -> (f64, [f64; 3]) {
    let config = RenderConfig {
        direct: Direct::Photons,
        // What theory speaks of: evenly spread samples fall faster at first.
        sampler: Sampler::Independent,
        alpha,
        radius: Some(radius),
        ..small(256, 100_000)
    };
    let errors = errors(name, config, iterations);
    let own_error = error_of_reference(name, 1).powi(2) / SQUARES as f64;
    let noise = |errors: &Errors, square: usize| errors.noise[square];
    let squared_bias = |errors: &Errors, square: usize| errors.squared_bias[square] - own_error;
    let total = |errors: &Errors, square: usize| noise(errors, square) + squared_bias(errors, square);
    for error in &errors {
        let sum = |part: &dyn Fn(&Errors, usize) -> f64| (0..SQUARES).map(|square| part(error, square)).sum::<f64>();
        println!(
            "{name}, α {alpha:.3}, {} iterations: relMSE {:.3e}, noise {:.3e}, squared bias {:.3e}",
            error.iterations,
            sum(&total),
            sum(&noise),
            sum(&squared_bias)
        );
    }
    let last = errors.last().expect("errors");
    println!("{name}, α {alpha:.3}: ratio of means {:?}", last.ratio_of_means);
    let alpha = f64::from(alpha);
    let expected = noise_slope(alpha, errors.iter().map(|error| error.iterations));
    let what = format!("{name}, α {alpha:.3}");
    Slope::of(&errors, noise).assert_between(expected, expected, &format!("{what}, noise"));
    let (smooth, edges) = (-2.0 * (1.0 - alpha), -0.5 * (1.0 - alpha));
    let slope = Slope::of(&errors, squared_bias);
    if slope.chance.is_nan() {
        // Of some squares it is less than chance makes of it, or of the reference's own error: it has no slope.
        for error in &errors {
            let sum =
                |part: &dyn Fn(&Errors, usize) -> f64| (0..SQUARES).map(|square| part(error, square)).sum::<f64>();
            let (bias, all) = (sum(&squared_bias), sum(&total));
            assert!(bias < all / 7.0, "{what}: squared bias {bias:e} of {all:e}");
        }
    } else {
        slope.assert_between(smooth, edges, &format!("{what}, squared bias"));
    }
    let slope = Slope::of(&errors, total).value;
    println!("{what}, relMSE: slope {slope:.3}");
    (slope, last.ratio_of_means)
}

/// With α = 2/3 the noise and the smooth part of the squared bias fall alike, as n^(−2/3). The initial radius is a fraction
/// of the automatic one, so that what edges leave of the bias makes it a little slower only.
#[test]
#[ignore = "takes minutes: scripts/test --long"]
fn the_error_falls_as_theory_says() {
    for name in ["cornell", "cornell-spheres"] {
        let (slope, ratios) = assert_falls_as_theory_says(name, 2.0 / 3.0, 0.015, 1024);
        assert!(
            (slope + 2.0 / 3.0).abs() < 0.08,
            "{name}: relMSE falls with iterations to the power {slope:.3}"
        );
        assert!(
            ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.003),
            "{name}: ratio of means {ratios:?} after 1024 iterations"
        );
    }
}

/// With a radius at which there is about as much bias as noise.
#[test]
#[ignore = "takes minutes: scripts/test --long"]
fn noise_and_bias_fall_by_the_powers_that_alpha_gives_them() {
    for alpha in [0.5, 2.0 / 3.0, 0.8, 0.95] {
        assert_falls_as_theory_says("cornell", alpha, 0.05, 256);
    }
}
