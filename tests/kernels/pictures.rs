//! Whole pictures of both backends.

use ppm_vk::backend::Backend;
use ppm_vk::config::{Direct, EmissionChoice, Estimator, RenderConfig};
use ppm_vk::cpu;
use ppm_vk::gpu::Device;
use ppm_vk::layout::Statistics;
use ppm_vk::metrics;
use ppm_vk::pipeline;
use ppm_vk::stage::BufferId;

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, packed, scene, small};

/// R of each slot.
fn radii(statistics: &[Statistics]) -> Vec<f64> {
    statistics.iter().map(|s| f64::from(s.radius2_high).sqrt()).collect()
}

#[test]
fn both_backends_choose_the_same_radii() {
    for name in ["cornell-spheres", "pool"] {
        let loaded = scene(name);
        let scene = packed(&loaded);
        let device = Device::open(None).expect("a Vulkan device");
        let mut found = pipeline::Renderer::new(device, &scene, &loaded.cameras[0], small()).expect("a renderer");
        let expected = cpu::Renderer::new(&scene, &loaded.cameras[0], small()).expect("a renderer");
        let (radius, expected_radius) = (found.radius(), expected.radius());
        // A photon that rounding sends elsewhere moves the median of the distances by a rank.
        assert!(
            (radius / expected_radius - 1.0).abs() < 5e-3,
            "{name}: radius {radius}, {expected_radius} on the CPU"
        );
        let statistics = found.gpu().download(BufferId::StatisticsOf, None).expect("a download");
        let mut agreement = Agreement::default();
        for (slot, (found, expected)) in radii(&statistics)
            .into_iter()
            .zip(radii(expected.statistics()))
            .enumerate()
        {
            // A photon more or less among ten makes a difference of a twentieth.
            agreement.note(relative_difference(found, expected) < 0.06, || {
                format!("slot {slot}: {found} on the device, {expected} on the CPU")
            });
        }
        agreement.assert(&format!("radii in {name}"), 0.99, 4096);
    }
}

#[test]
fn both_backends_render_the_same_picture() {
    for (name, estimator, direct) in [
        ("cornell-spheres", Estimator::Sppm, Direct::Light),
        ("cornell-spheres", Estimator::Ppm, Direct::Photons),
        ("pool", Estimator::Sppm, Direct::Light),
        ("glossy", Estimator::Sppm, Direct::Light),
        ("glossy", Estimator::Ppm, Direct::Photons),
        ("glasses", Estimator::Sppm, Direct::Light),
        ("coats", Estimator::Sppm, Direct::Light),
        ("coats", Estimator::Ppm, Direct::Photons),
        ("textures", Estimator::Sppm, Direct::Light),
        ("textures", Estimator::Ppm, Direct::Photons),
        ("instances", Estimator::Sppm, Direct::Light),
        ("glossy, lit", Estimator::Sppm, Direct::Light),
        ("glossy, patterned", Estimator::Sppm, Direct::Light),
        ("ring, lit", Estimator::Ppm, Direct::Photons),
    ] {
        let config = RenderConfig {
            estimator,
            direct,
            // Of an odd height: see the camera's test of split paths.
            resolution: [64, 63],
            radius: Some(0.05),
            // What is learned on the device from a path that rounding sends another way aims others.
            emission: EmissionChoice::Power,
            ..small()
        };
        let mut bench = Bench::new(name, config.clone());
        let loaded = scene(name);
        let mut renderer = cpu::Renderer::new(&bench.scene, &loaded.cameras[0], config).expect("a renderer");
        renderer.iterate().expect("an iteration");
        for _ in 1..4 {
            bench.renderer.iterate().expect("an iteration");
            renderer.iterate().expect("an iteration");
        }
        let what = format!("{name}, {estimator:?}, direct light from {direct:?}");
        assert_eq!(renderer.iterations(), bench.renderer.iterations(), "{what}");
        assert_eq!(renderer.emitted(), bench.renderer.emitted(), "{what}");

        let accepted = |statistics: &[Statistics]| statistics.iter().map(|s| f64::from(s.accepted_low)).sum::<f64>();
        let found = accepted(&bench.download(BufferId::StatisticsOf));
        let expected = accepted(renderer.statistics());
        assert!(
            (found / expected - 1.0).abs() < 1e-3,
            "{what}: {found} photons accepted, {expected} on the CPU"
        );

        let expected = renderer.resolve().expect("a picture");
        let found = bench.renderer.resolve().expect("a picture");
        let comparison = metrics::compare(&found, &expected).expect("pictures of one size");
        println!(
            "{what}: {comparison:?}, counters {:?} {:?}",
            bench.renderer.counters(),
            renderer.counters()
        );
        // The same paths: what differs is the few of them that rounding sends another way.
        for ratio in comparison.mean_ratio {
            assert!(
                (ratio - 1.0).abs() < 1e-3,
                "{what}: ratio of means {:?}",
                comparison.mean_ratio
            );
        }
        assert!(comparison.rel_mse < 1e-3, "{what}: relMSE {}", comparison.rel_mse);
    }
}
