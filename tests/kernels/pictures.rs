//! Whole pictures of both backends.

use ppm_vk::config::{Direct, Estimator, RenderConfig};
use ppm_vk::cpu;
use ppm_vk::metrics;

use super::bench::{Bench, scene, small};

#[test]
fn both_backends_render_the_same_picture() {
    for (name, estimator, direct) in [
        ("cornell-spheres", Estimator::Sppm, Direct::Light),
        ("cornell-spheres", Estimator::Ppm, Direct::Photons),
        ("pool", Estimator::Sppm, Direct::Light),
    ] {
        let config = RenderConfig {
            estimator,
            direct,
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
        let (radius, expected_radius) = (bench.renderer.radius(), renderer.radius());
        assert!((radius / expected_radius - 1.0).abs() < 1e-3, "{what}: radius {radius}, {expected_radius} on the CPU");

        let expected = renderer.resolve().expect("a picture");
        let found = bench.renderer.resolve().expect("a picture");
        let comparison = metrics::compare(&found, &expected).expect("pictures of one size");
        println!("{what}: {comparison:?}, counters {:?} {:?}", bench.renderer.counters(), renderer.counters());
        // The same paths: what differs is the few of them that rounding sends another way.
        for ratio in comparison.mean_ratio {
            assert!((ratio - 1.0).abs() < 1e-3, "{what}: ratio of means {:?}", comparison.mean_ratio);
        }
        assert!(comparison.rel_mse < 1e-3, "{what}: relMSE {}", comparison.rel_mse);
    }
}
