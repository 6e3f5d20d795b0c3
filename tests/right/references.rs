//! Pictures of other renderers, and the program's own by other settings.

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, Estimator, RenderConfig};
use ppm_vk::internals::film::Image;
use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::{Environment, Scene};

use crate::measure::{Measured, measure};
use crate::picture::{Subject, folder, reference, small};

/// Which pixels of a picture of this size are read: those that don't see the lamp, directly or by a mirror, nor are next to
/// one that does. What a pixel's place in the lamp's picture makes would drown all other noise.
pub fn dim_pixels(reference: &Image, side: usize) -> Vec<bool> {
    let scale = reference.width() / side;
    let bright = |column: usize, row: usize| {
        let block = |at: usize| at * scale..(at + 1) * scale;
        let mut pixels = block(row).flat_map(|y| block(column).map(move |x| y * reference.width() + x));
        pixels.any(|pixel| reference.pixels()[pixel].iter().any(|value| *value >= 1.0))
    };
    let around = |at: usize| at.saturating_sub(1)..(at + 2).min(side);
    (0..side * side)
        .map(|pixel| {
            let mut near = around(pixel / side).flat_map(|row| around(pixel % side).map(move |column| (column, row)));
            !near.any(|(column, row)| bright(column, row))
        })
        .collect()
}

/// Means of a picture's squares, so many along each side: the channels of each one after the other. `dim` may be of a
/// smaller picture.
fn means(image: &Image, dim: &[bool], along: usize) -> Vec<f64> {
    let side = dim.len().isqrt();
    let scale = image.width() / side;
    let mut sums = vec![0.0; along * along * 3];
    let mut counts = vec![0.0; along * along];
    for (pixel, values) in image.pixels().iter().enumerate() {
        let (column, row) = (pixel % image.width() / scale, pixel / image.width() / scale);
        if dim[row * side + column] {
            let square = row * along / side * along + column * along / side;
            counts[square] += 1.0;
            for (sum, value) in sums[3 * square..].iter_mut().zip(values) {
                *sum += f64::from(*value);
            }
        }
    }
    sums.iter()
        .enumerate()
        .map(|(index, sum)| sum / counts[index / 3])
        .collect()
}

/// What squares show, and how far that is from the truth at the most, but for its own noise.
struct Squares {
    found: Vec<Measured>,
    bias: Vec<f64>,
}

/// The bias falls in proportion to the radius or faster: twice the radius changes at least as much as there is bias.
fn measure_squares(subject: &Subject, config: &RenderConfig, dim: &[bool], along: usize, iterations: u32) -> Squares {
    let measure = |config| measure(subject, config, iterations, |image| means(image, dim, along));
    let found = measure(config.clone());
    // Where it is found automatically, this is its largest value.
    let radius = f64::from(subject.renderer(config.clone()).radius()) / subject.scene.normalisation.scale;
    let blurred = measure(RenderConfig {
        radius: Some(2.0 * radius),
        ..config.clone()
    });
    let changes = blurred.iter().zip(&found).map(|(blurred, found)| blurred.minus(found));
    Squares {
        bias: changes.map(|change| change.mean.abs() + change.chance()).collect(),
        found,
    }
}

/// Standard error of a square's mean in a reference, relative to √(mean² + 0.01), from that of a pixel: see
/// tests/references/README.md.
pub fn error_of_reference(name: &str, pixels: usize) -> f64 {
    let path = folder().join("tests/references").join(name).with_extension("json");
    let text = std::fs::read_to_string(path).expect("reference");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    match value["rel_rmse_of_mean"].as_f64() {
        Some(of_pixel) => of_pixel / (pixels as f64).sqrt(),
        // By photons too: its pixels aren't independent. A second renderer's picture agrees with it within 0.05 %.
        None => 5e-4,
    }
}

/// Compares the means of squares.
fn assert_squares_match(name: &str, config: &RenderConfig, along: usize, iterations: u32) {
    let reference = reference(name);
    let dim = dim_pixels(&reference, config.resolution[0] as usize);
    let expected = means(&reference, &dim, along);
    let relative = error_of_reference(name, reference.pixels().len() / (2 * along * along));
    let squares = measure_squares(&Subject::named(name), config, &dim, along, iterations);
    for (index, (found, bias)) in squares.found.iter().zip(squares.bias).enumerate() {
        let (square, channel) = (index / 3, index % 3);
        // Six of the reference's own standard errors, as if it were half as large: few pixels are left out.
        let slack = bias + 6.0 * relative * expected[index].hypot(0.1);
        let what = format!(
            "{name}, {iterations} iterations, direct light by {:?}: square {square} of {along} by {along}, channel \
             {channel}, {} in the reference",
            config.direct, expected[index]
        );
        found.assert_between(expected[index] - slack, expected[index] + slack, &what);
    }
}

#[test]
fn a_short_render_of_cornell_spheres_is_as_bright_as_the_path_traced_reference() {
    assert_squares_match("cornell-spheres", &small(64, 25_000), 1, 32);
}

#[test]
#[ignore = "takes minutes: scripts/test --long"]
fn every_part_of_long_renders_is_as_bright_as_in_the_references() {
    for (name, along) in [("cornell", 4), ("cornell-spheres", 4), ("ring", 4), ("pool", 1)] {
        for direct in [Direct::Light, Direct::Photons] {
            let config = RenderConfig {
                direct,
                ..small(128, 100_000)
            };
            assert_squares_match(name, &config, along, 128);
        }
    }
}

/// Relative standard error of the mean of a reference, of its worst channel.
fn error_of_whole(name: &str) -> f64 {
    let path = folder().join("tests/references").join(name).with_extension("json");
    let text = std::fs::read_to_string(path).expect("reference");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let errors = value["rel_error_of_whole"].as_array().expect("errors");
    errors.iter().filter_map(serde_json::Value::as_f64).fold(0.0, f64::max)
}

/// Compares the mean of a whole picture with a path-traced one's: what chance does on both sides, the bias by the radius, and
/// `known`, the part that the other renderer does otherwise (see tests/references/README.md), is all that they may differ by.
/// Returns the ratios of means.
fn assert_mean_matches(name: &str, subject: &Subject, config: &RenderConfig, iterations: u32, known: f64) -> [f64; 3] {
    let all = vec![true; (config.resolution[0] * config.resolution[1]) as usize];
    let expected = means(&reference(name), &all, 1);
    let squares = measure_squares(subject, config, &all, 1, iterations);
    std::array::from_fn(|channel| {
        let (found, expected) = (&squares.found[channel], expected[channel]);
        let slack = squares.bias[channel] + (known + 6.0 * error_of_whole(name)) * expected;
        let what = format!("{name}, {iterations} iterations, channel {channel}, {expected} in the reference");
        found.assert_between(expected - slack, expected + slack, &what);
        println!("{name}, channel {channel}: ratio of means {:.4}", found.mean / expected);
        found.mean / expected
    })
}

/// Scenes with all that glTF files have, and what of them is known to differ: the other renderer's ways of tracing frosted glass
/// differ by 1 % there.
const PATH_TRACED: [(&str, f64); 7] = [
    ("glossy", 0.0),
    ("textures", 0.0),
    ("glasses", 0.001),
    ("plaza", 0.0),
    ("plaza-sky", 0.0),
    ("instances", 0.0),
    ("slab", 0.0),
];

/// The sky of `plaza-sky` is the picture of a room with a lamp.
fn path_traced(name: &str) -> Subject {
    let Some(name) = name.strip_suffix("-sky") else {
        return Subject::named(name);
    };
    let options = LoadOptions {
        environment: Some(Environment::new(reference("cornell")).expect("an environment")),
        ..LoadOptions::default()
    };
    let path = folder().join("scenes").join(name).with_extension("gltf");
    Subject::of(Scene::load_with(&path, options).expect("scene"))
}

#[test]
fn short_renders_of_what_gltf_files_have_are_as_bright_as_path_traced_ones() {
    // Aimed, more paths are in glass for long.
    let config = RenderConfig {
        max_depth: 256,
        ..small(32, 10_000)
    };
    for (name, known) in PATH_TRACED {
        assert_mean_matches(name, &path_traced(name), &config, 32, known);
    }
}

#[test]
#[ignore = "takes minutes: scripts/test --long"]
fn long_renders_of_what_gltf_files_have_are_as_bright_as_path_traced_ones_within_two_percent() {
    for (name, known) in PATH_TRACED {
        let ratios = assert_mean_matches(name, &path_traced(name), &small(128, 50_000), 128, known);
        assert!(
            ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.02),
            "{name}: ratios of means {ratios:?}"
        );
    }
}

/// The pixels of `cornell-spheres` that don't see the lamp.
fn dim_pixels_of_spheres(side: usize) -> Vec<bool> {
    let dim = dim_pixels(&reference("cornell-spheres"), side);
    let count = dim.iter().filter(|dim| **dim).count();
    assert!(
        count > side * side * 3 / 4,
        "only {count} pixels are darker than the lamp"
    );
    dim
}

#[test]
fn photons_and_shadow_rays_give_the_same_direct_light() {
    const SIDE: u32 = 64;
    let subject = Subject::named("cornell-spheres");
    let dim = dim_pixels_of_spheres(SIDE as usize);
    let by_rays = measure_squares(&subject, &small(SIDE, 25_000), &dim, 1, 32);
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.02),
        ..small(SIDE, 25_000)
    };
    let by_photons = measure_squares(&subject, &config, &dim, 1, 32);
    for channel in 0..3 {
        let (photons, rays) = (&by_photons.found[channel], &by_rays.found[channel]);
        let slack = by_rays.bias[channel] + by_photons.bias[channel];
        let what = format!("channel {channel} by photons less {} by shadow rays", rays.mean);
        photons.minus(rays).assert_between(-slack, slack, &what);
    }
}

/// Standard deviation of the mean of pixels' centres from that of whole pixels: a straight edge through a pixel is worth
/// a uniform deviation of its contrast to the neighbours, of variance contrast² / 12.
fn aliasing(image: &Image, dim: &[bool], channel: usize) -> f64 {
    let (width, pixels) = (image.width(), image.pixels());
    let contrast2 = |pixel: usize, other: usize| f64::from(pixels[pixel][channel] - pixels[other][channel]).powi(2);
    let read = (0..pixels.len() - width - 1).filter(|&pixel| dim[pixel]);
    let variance: f64 = read
        .map(|pixel| (contrast2(pixel, pixel + 1) + contrast2(pixel, pixel + width)) / 12.0)
        .sum();
    variance.sqrt() / dim.iter().filter(|dim| **dim).count() as f64
}

/// `ppm` looks through the centres of pixels alone.
#[test]
fn both_estimators_agree() {
    const SIDE: u32 = 64;
    let subject = Subject::named("cornell-spheres");
    let dim = dim_pixels_of_spheres(SIDE as usize);
    let config = |estimator| RenderConfig {
        estimator,
        ..small(SIDE, 25_000)
    };
    let measured = |estimator| measure(&subject, config(estimator), 32, |image| means(image, &dim, 1));
    let [sppm, ppm] = [Estimator::Sppm, Estimator::Ppm].map(measured);
    let picture = subject.render(32, config(Estimator::Sppm));
    for (channel, (sppm, ppm)) in sppm.iter().zip(&ppm).enumerate() {
        // Both have the same radius and bias. A normal deviation exceeds 5.8 standard ones with a probability of 1e-8.
        let slack = 5.8 * aliasing(&picture, &dim, channel);
        let what = format!("channel {channel} by ppm less {} by sppm", sppm.mean);
        ppm.minus(sppm).assert_between(-slack, slack, &what);
    }
}
