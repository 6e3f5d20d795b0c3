//! What renders say of their own error, against references.

use glam::{Vec3, dvec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{EmissionChoice, Estimator, RenderConfig};
use ppm_vk::internals::estimate::{ErrorEstimate, RelativeError, of_one_photon};
use ppm_vk::internals::film::Image;
use ppm_vk::internals::metrics::{compare, relative_errors};
use ppm_vk::internals::scene::{Environment, LightKind, PunctualLight};

use crate::document::{Document, clear, matte};
use crate::mesh::Mesh;
use crate::picture::{Subject, reference, small};
use crate::stage::subject_under;

/// A reference at a smaller size: the mean of each square of pixels.
fn reduced(image: &Image, side: usize) -> Image {
    let scale = image.width() / side;
    let pixel = |index: usize| {
        let (column, row) = (index % side * scale, index / side * scale);
        let places = (row..row + scale).flat_map(|y| (column..column + scale).map(move |x| y * image.width() + x));
        let sum = places.fold([0.0; 3], |sum, place| {
            [0, 1, 2].map(|channel: usize| sum[channel] + f64::from(image.pixels()[place][channel]))
        });
        sum.map(|sum| (sum / (scale * scale) as f64) as f32)
    };
    Image::new(side, side, (0..side * side).map(pixel).collect())
}

/// Not a matter of chance but of the estimate's quality; the references' own error is far smaller. Measured: true over
/// estimated.
#[test]
fn the_true_error_lies_within_a_factor_of_one_and_a_half_of_its_estimate() {
    const SIDE: u32 = 64;
    let of_defaults = [
        "cornell",
        "cornell-spheres",
        "ring",
        "pool",
        "glossy",
        "textures",
        "plaza",
    ];
    let of_centres = ["cornell-spheres", "textures"];
    let cases = of_defaults.map(|name| (name, Estimator::Sppm)).into_iter();
    for (name, estimator) in cases.chain(of_centres.map(|name| (name, Estimator::Ppm))) {
        let subject = Subject::named(name);
        let reference = reduced(&reference(name), SIDE as usize);
        let config = RenderConfig {
            estimator,
            ..small(SIDE, 25_000)
        };
        let mut renderer = subject.renderer(config.clone());
        let photon = of_one_photon(subject.packed.power, &renderer, &config);
        let estimate = ErrorEstimate::new(&config, photon);
        for iterations in 1..=64 {
            renderer.iterate().expect("iteration");
            if ![16, 64].contains(&iterations) {
                continue;
            }
            let picture = subject.clean_picture(&mut renderer);
            let truth = compare(&picture, &reference).expect("one size").rel_mse.sqrt();
            let resolved = renderer.resolve_all().expect("picture");
            let estimated = estimate.relative(iterations, &resolved).expect("an estimate").total;
            println!(
                "{name}, {estimator:?}, {iterations} iterations: {:.2} %, {:.2} % estimated, ratio {:.2}",
                100.0 * truth,
                100.0 * estimated,
                truth / estimated
            );
            assert!(
                truth < 1.5 * estimated && estimated < 1.5 * truth,
                "{name}, {estimator:?}, {iterations} iterations: an error of {truth}, {estimated} estimated"
            );
            // The estimate of pixels says where the errors are: they are larger where it says more. Radii that follow the
            // photons' density make them alike, so that there is little to tell in a pool that is all caustic.
            let of_pixels = estimate.of_pixels(iterations, &resolved).expect("an estimate");
            let errors = relative_errors(&picture, &reference).expect("one size");
            let claims: Vec<f32> = of_pixels
                .pixels()
                .iter()
                .zip(reference.pixels())
                .map(|(error, value)| error[1].powi(2) / (value[1].powi(2) + 1e-3))
                .collect();
            let mut sorted = claims.clone();
            sorted.sort_by(f32::total_cmp);
            let median = sorted[sorted.len() / 2];
            let mean = |above: bool| {
                let chosen = errors
                    .iter()
                    .zip(&claims)
                    .filter(|(_, claim)| (**claim > median) == above);
                let (sum, count) = chosen.fold((0.0, 0.0), |(sum, count), (error, _)| {
                    (sum + f64::from(*error), count + 1.0)
                });
                sum / count
            };
            assert!(
                mean(true) > 1.25 * mean(false),
                "{name}, {estimator:?}: mean squared errors {} where more is claimed, {} where less",
                mean(true),
                mean(false)
            );
        }
    }
}

/// What shines on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shining {
    Sun,
    Sky,
}

/// A block of index 1, which can't be seen, on a ground of albedo 0.5 that has 0.5 everywhere; a ground without one.
fn ground(half_side: f64, has_block: bool, shining: Shining) -> Subject {
    let mut document = Document::new("ground");
    let grey = document.material(matte("ground", [0.5; 3]));
    document.object("ground", &Mesh::facing_up(half_side, 0.0), grey);
    if has_block {
        let air = document.material(clear("air", 1.0));
        let block = Mesh::cuboid(dvec3(-0.25, 0.1, -0.25), dvec3(0.25, 0.5, 0.25));
        document.object("block", &block, air);
    }
    document.camera([3.0, 0.1], [0.0, 0.0], 20.0);
    let white = Environment::new(Image::new(16, 8, vec![[1.0; 3]; 128])).expect("an environment");
    let mut subject = subject_under(document, Some(white));
    if shining == Shining::Sun {
        subject.scene.lights = vec![PunctualLight {
            kind: LightKind::Directional { direction: Vec3::NEG_Y },
            position: Vec3::ZERO,
            intensity: Vec3::splat(std::f32::consts::PI),
            extent: 0.0,
            range: None,
        }];
        subject.scene.environment = None;
        subject = Subject::of(subject.scene);
    }
    subject
}

/// The estimate after 24 iterations, and the true error against 0.5 everywhere.
fn estimated_on(subject: &Subject, photons: u32, radius: Option<f64>) -> (RelativeError, f64) {
    const SIDE: u32 = 48;
    const ITERATIONS: u32 = 24;
    let config = RenderConfig {
        radius,
        // Aimed photons find the block.
        emission: EmissionChoice::Power,
        ..small(SIDE, photons)
    };
    let mut renderer = subject.renderer(config.clone());
    let estimate = ErrorEstimate::new(&config, of_one_photon(subject.packed.power, &renderer, &config));
    for _ in 0..ITERATIONS {
        renderer.iterate().expect("iteration");
    }
    let picture = subject.clean_picture(&mut renderer);
    let flat = Image::new(SIDE as usize, SIDE as usize, vec![[0.5; 3]; (SIDE * SIDE) as usize]);
    let truth = compare(&picture, &flat).expect("one size").rel_mse.sqrt();
    let resolved = renderer.resolve_all().expect("picture");
    let estimated = estimate.relative(ITERATIONS, &resolved).expect("an estimate");
    println!(
        "{}: {estimated}, the truth is {:.2} %",
        subject.scene.name,
        100.0 * truth
    );
    (estimated, truth)
}

/// Photons that are few on a large ground miss the block, or come one by one into discs that are far larger; on a small one
/// they find it. One in fifty times a photon hits the block by chance on one of the large ones.
#[test]
fn light_behind_glass_that_no_photon_has_found_counts() {
    for shining in [Shining::Sun, Shining::Sky] {
        for (half_side, radius, photons, is_missing) in [
            (500.0, None, 1000, true),
            (500.0, Some(0.02), 1000, true),
            (100.0, Some(0.02), 100, true),
            (1.0, None, 10_000, false),
        ] {
            let subject = ground(half_side, true, shining);
            let (estimated, truth) = estimated_on(&subject, photons, radius);
            let what =
                format!("{shining:?}, ground of {half_side}, radius {radius:?}: {estimated:?}, the truth is {truth}");
            assert!(truth < 1.5 * estimated.total, "{what}");
            assert_eq!(estimated.missing > 0.5 * truth, is_missing, "{what}");
            let says_so = estimated.to_string().contains("light behind glass");
            assert_eq!(says_so, is_missing, "{what}");
        }
    }
}

/// Direct light is all that there is.
#[test]
fn pixels_in_the_open_need_no_photon() {
    let (estimated, truth) = estimated_on(&ground(100.0, false, Shining::Sun), 1000, Some(0.02));
    assert!(
        truth < 1e-3 && estimated.total < 1e-3,
        "{estimated:?}, the truth is {truth}"
    );
    assert_eq!(estimated.waiting, 0.0);
}
