//! Tests of the estimate.

use super::*;
use crate::metrics::REL_MSE_FLOOR;

fn of_radiance(radiance: f64) -> OnePhoton {
    OnePhoton { radiance, radius2: 1.0 }
}

/// Uniform in [0, 1), the same in every run.
fn random(index: u32, seed: u32) -> f64 {
    f64::from(crate::random::pcg4d([index, seed, 7, 11])[0]) / 4_294_967_296.0
}

/// A picture after so many iterations, each of which gives pixels what `of_iteration` says: RGB and curvature, infinite where
/// the pixel waits for a photon.
fn picture(resolution: [u32; 2], iterations: u32, mut of_iteration: impl FnMut(u32) -> Vec<[f64; 4]>) -> Resolved {
    let pixels = (resolution[0] * resolution[1]) as usize;
    let mut sums = vec![[0.0; 4]; SEQUENCES as usize * pixels];
    let mut counts = [0.0f64; SEQUENCES as usize];
    for iteration in 0..iterations {
        let sequence = (iteration % SEQUENCES) as usize;
        counts[sequence] += 1.0;
        let own = &mut sums[sequence * pixels..(sequence + 1) * pixels];
        for (sum, value) in own.iter_mut().zip(of_iteration(iteration)) {
            (0..4).for_each(|channel| sum[channel] += value[channel]);
        }
    }
    let film: Vec<[f32; 4]> = (0..pixels)
        .map(|pixel| {
            std::array::from_fn(|channel| {
                let whole: f64 = sums.iter().skip(pixel).step_by(pixels).map(|sum| sum[channel]).sum();
                (whole / f64::from(iterations)) as f32
            })
        })
        // Where no photon has come.
        .map(|[r, g, b, curvature]: [f32; 4]| [r, g, b, if curvature.is_infinite() { -1.0 } else { 1.0 }])
        .collect();
    let mean = |(index, sum): (usize, &[f64; 4])| sum.map(|sum| (sum / counts[index / pixels].max(1.0)) as f32);
    let sequences = sums.iter().enumerate().map(mean).collect();
    Resolved::from_film(resolution, &film, Vec::new(), sequences)
}

/// The same whatever the iteration.
fn still(resolution: [u32; 2], iterations: u32, pixels: &[[f32; 4]]) -> Resolved {
    picture(resolution, iterations, |_| {
        pixels.iter().map(|pixel| pixel.map(f64::from)).collect()
    })
}

fn by_default() -> ErrorEstimate {
    ErrorEstimate::new(&RenderConfig::default(), OnePhoton::default())
}

/// A picture of 1 everywhere after so many iterations, with noise of this deviation in each, a bias of
/// `bias`·i^(α−1) in iteration i, and the curvature that smooth light of that bias has, as noisy as the picture; and its error.
fn rendered(iterations: u32, deviation: f64, bias: f64, alpha: f64) -> (Resolved, f64) {
    const PIXELS: u32 = 2000;
    let rendered = picture([50, PIXELS / 50], iterations, |iteration| {
        let now = bias * f64::from(iteration + 1).powf(alpha - 1.0);
        let value = |index: u32| {
            let noise = (random(index, iteration + 1) - 0.5) * 12f64.sqrt() * deviation;
            noise + if index % 4 == 3 { -now / 3.0 } else { 1.0 + now }
        };
        (0..PIXELS)
            .map(|pixel| std::array::from_fn(|channel| value(4 * pixel + channel as u32)))
            .collect()
    });
    let channels = rendered.image.pixels().as_flattened();
    let squares: f64 = channels.iter().map(|&value| (f64::from(value) - 1.0).powi(2)).sum();
    let rel_mse = squares / f64::from(3 * PIXELS) / 1.01;
    (rendered, rel_mse.sqrt())
}

#[test]
fn noise_is_estimated_from_the_spread_of_sequences() {
    for iterations in [8, 16, 100, 257] {
        let (rendered, truth) = rendered(iterations, 0.5, 0.0, 2.0 / 3.0);
        let found = by_default().relative(iterations, &rendered).expect("an estimate");
        // Where noise is large it makes what relMSE divides by small, of the other sequences in particular.
        assert!(
            (found.noise / truth - 1.0).abs() < if iterations < 100 { 0.12 } else { 0.03 },
            "{iterations} iterations: {found:?}, the truth is {truth}"
        );
    }
}

#[test]
fn light_that_comes_seldom_and_is_bright_counts_against_what_pixels_have_without_it() {
    const SIDE: u32 = 100;
    const ITERATIONS: u32 = 16;
    // One look in 200 brings 100 beside the 1 that there always is.
    let rendered = picture([SIDE; 2], ITERATIONS, |iteration| {
        let seldom = |pixel| {
            if random(pixel, iteration + 1) < 0.005 {
                101.0
            } else {
                1.0
            }
        };
        (0..SIDE * SIDE)
            .map(|pixel| [seldom(pixel), seldom(pixel), seldom(pixel), 0.0])
            .collect()
    });
    let squares = |pixel: &[f32; 3]| (f64::from(pixel[0]) - 1.5).powi(2);
    let mean_square = rendered.image.pixels().iter().map(squares).sum::<f64>() / f64::from(SIDE * SIDE);
    let truth = (mean_square / (1.01 * 1.5 * 1.5)).sqrt();
    let found = by_default().relative(ITERATIONS, &rendered).expect("an estimate").total;
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
            let estimate = ErrorEstimate::new(&config, OnePhoton::default());
            let rendered = still([SIDE as u32; 2], 4, &pixels);
            estimate.relative(4, &rendered).expect("an estimate").total
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
        let (rendered, truth) = rendered(192, 0.05, 0.1, alpha);
        let found = by_default().relative(192, &rendered).expect("an estimate");
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
    let (rendered, _) = rendered(192, 0.1, 0.1, 2.0 / 3.0);
    let picture = by_default().relative(192, &rendered).expect("an estimate");
    let pixels = by_default().of_pixels(192, &rendered).expect("errors");
    let samples = pixels.pixels().as_flattened();
    let mean_square = samples.iter().map(|&error| f64::from(error).powi(2)).sum::<f64>() / samples.len() as f64;
    // All pixels have about one value, and relMSE's floor is a hundredth of its square; without what R brings them, a little
    // less.
    let [value, ..] = crate::metrics::mean(&rendered.image);
    let found = (mean_square / 1.01).sqrt() / value;
    assert!(
        (found / picture.total - 1.0).abs() < 0.03,
        "{found}, of the picture {picture:?}"
    );
}

#[test]
fn a_black_picture_has_no_estimate_and_pixels_without_photons_may_lack_one() {
    let taken = |pixels: &[[f32; 4]]| {
        let estimate = ErrorEstimate::new(&RenderConfig::default(), of_radiance(6.0));
        estimate.relative(8, &still([2, 1], 8, pixels))
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
fn the_first_iterations_give_no_estimate_and_it_is_due_when_the_sequences_have_had_as_many() {
    let is_known = |iterations| {
        let rendered = still([1, 1], iterations, &[[1.0; 4]]);
        by_default().relative(iterations, &rendered).is_some()
    };
    assert!(!is_known(SEQUENCES - 1));
    assert!(is_known(SEQUENCES));
    let due: Vec<u32> = (1..100)
        .filter(|&iterations| ErrorEstimate::is_due(iterations))
        .collect();
    assert_eq!(due, [4, 8, 12, 16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96]);
}
