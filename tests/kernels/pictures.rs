//! Pictures of the kernels and of the plain renderer: two programs that share the scene's layout and the random numbers, but no
//! code that transports light.

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, EmissionChoice, Estimator, RenderConfig, SEQUENCES};

use super::bench::{Bench, small};

/// Standard errors, see below.
const STUDENT: f64 = 7.5;
/// Samples of each number.
const SAMPLES: u32 = 12;
const SIDE: u32 = 32;
/// Pixels of a block's side.
const BLOCK: u32 = 8;

/// Mean of each block and channel, and of all, in each picture.
fn blocks(pixels: &[[f32; 4]]) -> Vec<f64> {
    let across = SIDE / BLOCK;
    let count = 3 * (across * across) as usize;
    let mut sums = vec![0.0; count + 3];
    for (pixel, rgb) in (0..).zip(pixels) {
        let block = (pixel / SIDE / BLOCK * across + pixel % SIDE / BLOCK) as usize;
        for channel in 0..3 {
            let value = f64::from(rgb[channel]);
            sums[3 * block + channel] += value / f64::from(BLOCK * BLOCK);
            sums[count + channel] += value / f64::from(SIDE * SIDE);
        }
    }
    sums
}

/// The pictures of a render's sequences, which are independent of each other unless their visible points are the same.
fn samples(renderer: &mut dyn Backend, estimator: Estimator) -> Vec<Vec<f64>> {
    while renderer.iterations() < 8 {
        renderer.iterate().expect("an iteration");
    }
    let resolved = renderer.resolve_all().expect("a picture");
    assert_eq!(renderer.counters().non_finite, 0);
    if estimator == Estimator::Sppm {
        resolved.sequences.chunks((SIDE * SIDE) as usize).map(blocks).collect()
    } else {
        let pixels: Vec<_> = resolved
            .image
            .pixels()
            .iter()
            .map(|&[r, g, b]| [r, g, b, 0.0])
            .collect();
        vec![blocks(&pixels)]
    }
}

/// Mean and variance of the mean.
fn mean_of(samples: &[f64]) -> (f64, f64) {
    let count = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / count;
    let squares: f64 = samples.iter().map(|sample| (sample - mean).powi(2)).sum();
    (mean, squares / (count * (count - 1.0)))
}

/// A difference of means of 12 samples exceeds 7.5 of its standard errors with a probability of 2·10⁻⁷ (Student, 22 degrees of
/// freedom): 51 numbers of each of 24 cases fail a correct pair of programs once in 4,000 runs. Blurring by the radii is the same
/// except for the number of maps: allowances of half a percent for a block and three thousandths for the whole picture are
/// subtracted.
#[test]
fn both_renderers_converge_to_the_same_picture() {
    let mut wrong = Vec::new();
    for (name, estimator, direct, max_depth) in [
        ("cornell-spheres", Estimator::Sppm, Direct::Light, 128),
        ("cornell-spheres", Estimator::Ppm, Direct::Photons, 128),
        ("pool", Estimator::Sppm, Direct::Light, 128),
        ("glossy", Estimator::Sppm, Direct::Light, 128),
        ("glasses", Estimator::Sppm, Direct::Light, 128),
        ("coats", Estimator::Sppm, Direct::Light, 128),
        ("coats", Estimator::Sppm, Direct::Photons, 128),
        ("textures", Estimator::Sppm, Direct::Light, 128),
        ("textures", Estimator::Sppm, Direct::Photons, 128),
        ("instances", Estimator::Sppm, Direct::Light, 128),
        ("ring", Estimator::Sppm, Direct::Light, 128),
        ("glossy, lit", Estimator::Sppm, Direct::Light, 128),
        ("glossy, softly lit", Estimator::Sppm, Direct::Light, 128),
        ("glossy, patterned", Estimator::Sppm, Direct::Light, 128),
        ("glossy, brushed", Estimator::Sppm, Direct::Light, 128),
        ("glossy, brushed", Estimator::Sppm, Direct::Photons, 128),
        ("glasses, brushed", Estimator::Sppm, Direct::Light, 128),
        ("glasses, lit", Estimator::Sppm, Direct::Light, 128),
        ("glasses, softly lit", Estimator::Sppm, Direct::Light, 128),
        // One bounce: direct light alone, without the photons' noise.
        ("many-lamps", Estimator::Sppm, Direct::Light, 1),
        ("cornell, lit", Estimator::Sppm, Direct::Light, 1),
        ("cornell, patterned", Estimator::Sppm, Direct::Light, 1),
        ("cornell, softly lit", Estimator::Sppm, Direct::Light, 1),
        ("glossy", Estimator::Sppm, Direct::Light, 1),
    ] {
        let what = format!("{name}, {estimator:?}, direct light from {direct:?}, {max_depth} bounces");
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        let seeds = if estimator == Estimator::Sppm {
            SAMPLES / SEQUENCES
        } else {
            SAMPLES
        };
        for seed in 0..seeds {
            let config = RenderConfig {
                estimator,
                direct,
                emission: EmissionChoice::of(estimator),
                resolution: [SIDE; 2],
                photons: 10_000,
                radius: Some(0.05),
                max_depth,
                seed,
                ..small()
            };
            // The paper's estimator samples the pixels' centres. In the middle of a room, those on the picture's diagonals hit
            // the edges of walls, where rounding decides which wall is seen.
            let mut bench = Bench::seen_with(name, config, |_, camera| {
                camera.forward += 0.01 * camera.right + 0.007 * camera.up;
            });
            found.extend(samples(&mut bench.renderer, estimator));
            expected.extend(samples(&mut bench.plain(), estimator));
        }
        let count = found[0].len();
        let (mut worst, mut worst_text) = (0.0, String::new());
        for number in 0..count {
            let of = |samples: &[Vec<f64>]| mean_of(&samples.iter().map(|sample| sample[number]).collect::<Vec<_>>());
            let ((found, variance), (expected, expected_variance)) = (of(&found), of(&expected));
            let is_whole = number >= count - 3;
            let slack = if is_whole { 0.003 } else { 0.005 } * found.max(expected);
            let error = (variance + expected_variance).sqrt();
            let off = ((found - expected).abs() - slack).max(0.0) / error;
            let place = if is_whole {
                "the whole".to_owned()
            } else {
                format!("block {}", number / 3)
            };
            let text = format!(
                "{place}, channel {}: {found} by kernels, {expected} plainly, ± {error}",
                number % 3
            );
            if is_whole {
                println!("{what}: {text}");
            }
            if off >= worst {
                (worst, worst_text) = (off, text);
            }
        }
        println!("{what}: {worst:.1} standard errors at the most, {worst_text}");
        if worst >= STUDENT {
            wrong.push(format!("{what}: {worst} standard errors, {worst_text}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Photons that all discs together have counted. Where visible points stay, their number shows whether it is the shrunk disc that
/// gathers. The bound is that above: it fails a right pair of programs once in 5 million runs.
#[test]
fn discs_that_shrink_count_as_many_photons_as_the_kernels_do() {
    let (mut found, mut expected) = (Vec::new(), Vec::new());
    for seed in 0..SAMPLES {
        let config = RenderConfig {
            estimator: Estimator::Ppm,
            direct: Direct::Photons,
            emission: EmissionChoice::Power,
            resolution: [SIDE; 2],
            photons: 2500,
            radius: Some(0.15),
            seed,
            ..small()
        };
        let mut bench = Bench::new("cornell", config);
        let mut plain = bench.plain();
        let counted = |renderer: &mut dyn Backend| {
            while renderer.iterations() < 8 {
                renderer.iterate().expect("an iteration");
            }
            renderer.resolve_all().expect("a picture");
            renderer.counters().photons_accepted as f64
        };
        found.push(counted(&mut bench.renderer));
        expected.push(counted(&mut plain));
    }
    let ((found, variance), (expected, expected_variance)) = (mean_of(&found), mean_of(&expected));
    let error = (variance + expected_variance).sqrt();
    let text = format!("{found} photons counted by kernels, {expected} plainly, ± {error}");
    println!("{text}");
    assert!(error < 0.01 * expected, "{text}: too few to tell");
    assert!((found - expected).abs() < STUDENT * error, "{text}");
}
