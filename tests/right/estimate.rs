//! What renders say of their own error, against references.

use ppm_vk::backend::Backend;
use ppm_vk::config::{Estimator, RenderConfig};
use ppm_vk::estimate::{ErrorEstimate, of_one_photon};
use ppm_vk::film::Image;
use ppm_vk::metrics::{compare, relative_errors};

use crate::picture::{Subject, reference, small};

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
        let photon = of_one_photon(&subject.packed, &renderer, &config);
        let mut estimate = ErrorEstimate::new(&config, photon);
        for iterations in 1..=64 {
            renderer.iterate().expect("iteration");
            if estimate.wants(iterations) {
                estimate.add(iterations, renderer.resolve_all().expect("picture"));
            }
            if ![16, 64].contains(&iterations) {
                continue;
            }
            let picture = subject.clean_picture(&mut renderer);
            let truth = compare(&picture, &reference).expect("one size").rel_mse.sqrt();
            let estimated = estimate.relative(iterations).expect("an estimate").total;
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
            // The estimate of pixels says where the errors are: they are larger where it says more.
            let of_pixels = estimate.of_pixels(iterations).expect("an estimate");
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
                mean(true) > 1.5 * mean(false),
                "{name}, {estimator:?}: mean squared errors {} where more is claimed, {} where less",
                mean(true),
                mean(false)
            );
        }
    }
}
