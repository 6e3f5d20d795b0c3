//! Tests of the estimate.

fn of_radiance(radiance: f64) -> OnePhoton {
    OnePhoton { radiance, radius2: 1.0 }
}

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
    let mut estimate = ErrorEstimate::new(&with_alpha(alpha), OnePhoton::default());
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
        estimate.add(i, Resolved::from_film([50, PIXELS as u32 / 50], &last, Vec::new()));
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
    let mut estimate = ErrorEstimate::new(&RenderConfig::default(), OnePhoton::default());
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
        estimate.add(i, Resolved::from_film([SIDE as u32; 2], &pixels, Vec::new()));
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
            let mut estimate = ErrorEstimate::new(&config, OnePhoton::default());
            (1..=4).for_each(|i| estimate.add(i, Resolved::from_film([SIDE as u32; 2], &pixels, Vec::new())));
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
    // All pixels have about one value, and relMSE's floor is a hundredth of its square; without what R brings them, a little
    // less.
    let [value, ..] = crate::metrics::mean(&estimate.pictures[estimate.pictures.len() - 1].image);
    let found = (mean_square / 1.01).sqrt() / value;
    assert!(
        (found / picture.total - 1.0).abs() < 0.03,
        "{found}, of the picture {picture:?}"
    );
}

#[test]
fn a_black_picture_has_no_estimate_and_pixels_without_photons_may_lack_one() {
    let taken = |pixels: &[[f32; 4]]| {
        let mut estimate = ErrorEstimate::new(&with_alpha(0.5), of_radiance(6.0));
        (1..=8).for_each(|i| estimate.add(i, Resolved::from_film([2, 1], pixels, Vec::new())));
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
    let mut estimate = ErrorEstimate::new(&with_alpha(0.5), OnePhoton::default());
    for i in 1..=1000 {
        assert_eq!(
            estimate.relative(i).is_some(),
            estimate.pictures.len() >= FEWEST_BATCHES
        );
        estimate.add(i, Resolved::from_film([1, 1], &[[1.0; 4]], Vec::new()));
        assert!(estimate.pictures.len() <= MOST_BATCHES);
    }
    assert!(estimate.relative(1000).is_some());
}
