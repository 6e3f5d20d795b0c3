//! Pictures compared with each other pixel by pixel, and with references. `right.rs` tests their absolute brightness.

#[path = "picture/mod.rs"]
mod picture;

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Accel, Direct, EmissionChoice, RenderConfig};
use ppm_vk::internals::gather;
use ppm_vk::internals::gpu::{Device, best_device};
use ppm_vk::internals::metrics::{Defects, compare, defects};
use ppm_vk::internals::packing::SceneFeatures;

use picture::{Subject, reference, small};

fn assert_matches_reference(name: &str, direct: Direct, iterations: u32, rel_mse: f64) {
    let config = RenderConfig {
        direct,
        ..small(256, 100_000)
    };
    let image = Subject::named(name).render(iterations, config);
    let comparison = compare(&image, &reference(name)).expect("sizes");
    println!("{name}, direct light by {direct:?}: {comparison:?}");
    assert!(
        comparison.rel_mse <= rel_mse,
        "{name}: relMSE {} instead of {rel_mse} at most",
        comparison.rel_mse
    );
}

/// Kernels with all features, or specialised for a scene: only speed differs.
#[test]
fn all_features_compiled_in_give_the_same_picture() {
    for name in ["cornell", "cornell-spheres", "glasses", "textures"] {
        let mut subject = Subject::named(name);
        let own = subject.render(4, small(64, 20_000));
        let own_features = subject.packed.features;
        subject.packed.features = SceneFeatures {
            // Ways to choose light sources, of which a scene uses one.
            few_sources: own_features.few_sources,
            many_sources: own_features.many_sources,
            ..SceneFeatures::ALL
        };
        let with_all = subject.render(4, small(64, 20_000));
        let comparison = compare(&with_all, &own).expect("sizes");
        println!("{name}: {comparison:?}");
        assert!(comparison.rel_mse < 1e-5, "{name}: {comparison:?}");
    }
}

#[test]
fn mirrors_and_glass_vanish_in_a_uniform_environment() {
    let image = Subject::named("furnace-specular").render(8, small(64, 1000));
    let off = image
        .pixels()
        .iter()
        .filter(|pixel| pixel.iter().any(|value| (value - 1.0).abs() > 1e-3))
        .count();
    assert!(
        off <= 64 * 64 / 100,
        "{off} of 4,096 pixels differ from 1 (a few at silhouettes may)"
    );
}

#[test]
fn a_short_render_of_cornell_spheres_matches_the_path_traced_reference() {
    assert_matches_reference("cornell-spheres", Direct::Light, 32, 0.009);
}

#[test]
#[ignore = "takes minutes: scripts/test --long"]
fn long_renders_match_the_path_traced_references() {
    for name in ["cornell-spheres", "cornell"] {
        assert_matches_reference(name, Direct::Light, 256, 0.003);
        assert_matches_reference(name, Direct::Photons, 256, 0.01);
    }
}

#[test]
fn every_gather_method_gives_the_same_picture() {
    let config = |index| RenderConfig {
        gather: Some(index),
        ..small(48, 20_000)
    };
    let first = Subject::named("cornell-spheres").render(3, config(0));
    for (index, method) in gather::METHODS.iter().enumerate().skip(1) {
        if method.stages().is_none() {
            continue;
        }
        let other = Subject::named("cornell-spheres").render(3, config(index));
        for (pixel, (a, b)) in first.pixels().iter().zip(other.pixels()).enumerate() {
            for channel in 0..3 {
                let (a, b) = (a[channel], b[channel]);
                let close = (a - b).abs() <= 2e-5 * a.abs().max(b.abs());
                assert!(
                    close,
                    "{}: pixel {pixel} has {b}, {} has {a}",
                    method.name,
                    gather::METHODS[0].name
                );
            }
        }
    }
}

#[test]
fn rays_meet_the_same_triangles_by_every_search() {
    let by = |accel| {
        let config = small(32, 2000);
        Subject::named("cornell").render(2, RenderConfig { accel, ..config })
    };
    let device = best_device().expect("a device");
    let others = [Accel::Brute, Accel::RayQuery];
    for accel in others.into_iter().take(if device.ray_query { 2 } else { 1 }) {
        let difference = compare(&by(accel), &by(Accel::Bvh)).expect("sizes").rel_mse;
        assert!(
            difference < 1e-9,
            "{accel:?} loses or adds hits: {difference} from the BVH's picture"
        );
    }
}

#[test]
fn photons_that_do_not_fit_make_room_and_lose_nothing() {
    const PATHS: u32 = 2000;
    const ITERATIONS: u32 = 32;
    let furnace = Subject::named("furnace-closed");
    let config = RenderConfig {
        radius: Some(0.05),
        direct: Direct::Photons,
        drop_unwanted: false,
        emission: EmissionChoice::Power,
        ..small(16, PATHS)
    };
    let mut renderer = furnace.renderer(config.clone());
    (0..ITERATIONS).for_each(|_| drop(renderer.iterate().expect("iteration")));
    let (counters, image) = (renderer.counters(), renderer.resolve().expect("picture"));
    // One path per lane: a lane's capacity for an average path is too small for the longest.
    assert!(
        counters.repeated_iterations > 0,
        "the buffer was never too small: this test shows nothing"
    );
    // The walls emit to both sides: half of the paths escape, and a fifth of the others ends at each bounce. So there are 2.5
    // photons per path, with a standard deviation of √(45/2 − 2.5²). Six standard deviations of the sum: a correct program fails
    // once in 5·10⁸ runs. A lane's capacity, a quarter more than the mean, holds half of them.
    let paths = f64::from(PATHS * ITERATIONS);
    let deviation = (16.25 * paths).sqrt();
    let (stored, expected) = (counters.photons_stored as f64, 2.5 * paths);
    println!("{stored} photons stored, {expected} ± {deviation} expected");
    assert!(
        (stored - expected).abs() < 6.0 * deviation,
        "{stored} photons stored, {expected} ± {deviation} expected"
    );
    assert_eq!(defects(&image), Defects::default());
}

#[test]
fn debug_builds_run_under_the_validation_layer() {
    let device = Device::open(None).expect("a Vulkan device");
    if std::env::var("VK_LOADER_LAYERS_DISABLE").is_ok_and(|layers| layers.contains("validation")) {
        println!("skipped: VK_LOADER_LAYERS_DISABLE disables the validation layer");
        return;
    }
    assert!(
        device.is_validated() || !cfg!(debug_assertions),
        "VK_LAYER_KHRONOS_validation is not installed: these tests would miss its messages (scripts/setup installs it)"
    );
}
