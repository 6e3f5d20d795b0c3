//! Whole pictures against answers that are known without this program, and against each other.
//!
//! Each picture has a fixed seed, so that on one device a test passes or fails always. The tolerances are several
//! standard deviations of what other seeds give (stated at each), which keeps them meaningful on other devices.

use std::path::{Path, PathBuf};

use ppm_vk::backend::Backend;
use ppm_vk::config::{Accel, Direct, Estimator, RenderConfig};
use ppm_vk::film::{Image, read_exr};
use ppm_vk::gather;
use ppm_vk::gpu::Device;
use ppm_vk::metrics::{Defects, compare, defects, mean};
use ppm_vk::pipeline::Renderer;
use ppm_vk::scene::{PackedScene, Scene};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn load(name: &str) -> (Scene, PackedScene) {
    let scene = Scene::load(&folder().join("scenes").join(name).with_extension("gltf")).expect("scene");
    let packed = PackedScene::new(&scene).expect("hierarchy");
    (scene, packed)
}

/// A picture without NaN, infinity or negative value.
fn render(name: &str, iterations: u32, config: RenderConfig) -> Image {
    let (scene, packed) = load(name);
    let device = Device::open(None).expect("a Vulkan device");
    let mut renderer = Renderer::new(device, &packed, &scene.cameras[0], config).expect("renderer");
    for _ in 0..iterations {
        renderer.iterate().expect("iteration");
    }
    assert_eq!(renderer.counters().non_finite, 0, "{name}: NaN or infinity in a stage");
    assert_eq!(
        renderer.counters().cut_paths,
        0,
        "{name}: paths cut by the driver's loop limit"
    );
    let image = renderer.resolve().expect("picture");
    assert_eq!(defects(&image), Defects::default(), "{name}");
    image
}

/// Le / (1 − ρ) of `furnace-closed`.
const FURNACE: [f64; 3] = [1.0 / 0.8, 1.0 / 0.5, 1.0 / 0.2];

fn small(side: u32, photons: u32) -> RenderConfig {
    RenderConfig {
        resolution: [side, side],
        photons,
        ..RenderConfig::default()
    }
}

fn assert_means(image: &Image, expected: [f64; 3], tolerance: f64, what: &str) {
    let mean = mean(image);
    for channel in 0..3 {
        let ratio = mean[channel] / expected[channel];
        assert!(
            (ratio - 1.0).abs() <= tolerance,
            "{what}: channel {channel} has mean {} instead of {} ({:+.2} %)",
            mean[channel],
            expected[channel],
            100.0 * (ratio - 1.0)
        );
    }
}

fn reference(name: &str) -> Image {
    read_exr(&folder().join("tests/references").join(name).with_extension("exr")).expect("reference")
}

fn long() -> bool {
    std::env::var_os("PPM_VK_LONG").is_some()
}

fn assert_matches_reference(name: &str, direct: Direct, iterations: u32, mean_tolerance: f64, rel_mse: f64) {
    let config = RenderConfig {
        direct,
        ..small(256, 100_000)
    };
    let image = render(name, iterations, config);
    let comparison = compare(&image, &reference(Path::new(name).to_str().expect("UTF-8"))).expect("sizes");
    assert!(
        comparison.rel_mse <= rel_mse,
        "{name}: relMSE {} instead of {rel_mse} at most",
        comparison.rel_mse
    );
    for ratio in comparison.mean_ratio {
        assert!(
            (ratio - 1.0).abs() <= mean_tolerance,
            "{name}: ratios of means {:?}",
            comparison.mean_ratio
        );
    }
}

/// Standard deviation of the picture's mean over seeds: 0.06 % in the last channel; what photons lose at the edges of the
/// walls is 0.1 % of it.
#[test]
fn a_closed_furnace_shines_with_le_over_one_minus_rho() {
    let image = render(
        "furnace-closed",
        96,
        RenderConfig {
            radius: Some(0.01),
            ..small(96, 100_000)
        },
    );
    assert_means(&image, FURNACE, 0.003, "light by shadow rays and photons");
}

/// Standard deviation of the picture's mean over seeds: 0.1 %. Photons alone lose what lies beyond an object's edge
/// within R, here 0.2 %.
#[test]
fn a_closed_furnace_lit_by_photons_alone_shines_alike() {
    let config = RenderConfig {
        radius: Some(0.01),
        direct: Direct::Photons,
        ..small(96, 100_000)
    };
    let image = render("furnace-closed", 48, config);
    assert_means(&image, FURNACE, 0.006, "light by photons");
}

#[test]
fn mirrors_and_glass_vanish_in_a_uniform_environment() {
    let image = render("furnace-specular", 8, small(64, 1000));
    let off = image
        .pixels()
        .iter()
        .filter(|pixel| pixel.iter().any(|value| (value - 1.0).abs() > 1e-3))
        .count();
    assert!(
        off <= 64 * 64 / 100,
        "{off} of 4,096 pixels aren't 1 (a few at silhouettes may)"
    );
}

#[test]
fn a_short_render_of_cornell_spheres_matches_the_path_traced_reference() {
    assert_matches_reference("cornell-spheres", Direct::Light, 32, 0.005, 0.009);
}

#[test]
fn long_renders_match_the_path_traced_references() {
    if !long() {
        return;
    }
    for name in ["cornell-spheres", "cornell"] {
        assert_matches_reference(name, Direct::Light, 256, 0.005, 0.003);
        assert_matches_reference(name, Direct::Photons, 256, 0.01, 0.01);
    }
}

/// Standard deviation of the ratio of means over seeds: 0.15 %.
#[test]
fn photons_and_shadow_rays_give_the_same_direct_light() {
    let lights = render("cornell-spheres", 32, small(64, 50_000));
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.02),
        ..small(64, 50_000)
    };
    let photons = render("cornell-spheres", 32, config);
    assert_means(&photons, mean(&lights), 0.012, "photons against shadow rays");
}

/// Standard deviation of the ratio of means over seeds: 0.2 %. Only where neither picture sees the lamp, directly or by
/// a mirror: whether a pixel's centre lies in it makes more difference than anything else.
#[test]
fn both_estimators_agree() {
    let sppm = render("cornell-spheres", 24, small(63, 50_000));
    let ppm = render(
        "cornell-spheres",
        24,
        RenderConfig {
            estimator: Estimator::Ppm,
            ..small(63, 50_000)
        },
    );
    let pairs = sppm.pixels().iter().zip(ppm.pixels());
    let (a, b): (Vec<_>, Vec<_>) = pairs
        .filter(|(a, b)| a.iter().chain(b.iter()).all(|value| *value < 1.0))
        .map(|(a, b)| (*a, *b))
        .unzip();
    assert!(a.len() > 3500, "only {} pixels are darker than the lamp", a.len());
    let picture = |pixels: Vec<[f32; 3]>| Image::new(pixels.len(), 1, pixels);
    assert_means(&picture(b), mean(&picture(a)), 0.015, "ppm against sppm");
}

#[test]
fn every_gather_method_gives_the_same_picture() {
    let config = |index| RenderConfig {
        gather: Some(index),
        ..small(48, 20_000)
    };
    let first = render("cornell-spheres", 3, config(0));
    for (index, method) in gather::METHODS.iter().enumerate().skip(1) {
        if method.stages().is_none() {
            continue;
        }
        let other = render("cornell-spheres", 3, config(index));
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
fn rays_meet_the_same_triangles_with_and_without_the_hierarchy() {
    let config = small(32, 2000);
    let with = render("cornell", 2, config.clone());
    let without = render(
        "cornell",
        2,
        RenderConfig {
            accel: Accel::Brute,
            ..config
        },
    );
    assert!(
        compare(&without, &with).expect("sizes").rel_mse < 1e-9,
        "the BVH loses or adds hits"
    );
}

#[test]
fn photons_that_do_not_fit_make_room_and_lose_nothing() {
    let (scene, packed) = load("furnace-closed");
    let render = |photons: u32| {
        let config = RenderConfig {
            radius: Some(0.05),
            direct: Direct::Photons,
            ..small(16, photons)
        };
        let device = Device::open(None).expect("a Vulkan device");
        let mut renderer = Renderer::new(device, &packed, &scene.cameras[0], config).expect("renderer");
        (0..2).for_each(|_| drop(renderer.iterate().expect("iteration")));
        (renderer.counters(), renderer.resolve().expect("picture"))
    };
    // One path a lane: the lanes' room for an average path doesn't hold the longest.
    let (counters, image) = render(2000);
    assert!(
        counters.repeated_iterations > 0,
        "the buffer was never too small: this test shows nothing"
    );
    // The CPU's buffers grow by themselves.
    let config = RenderConfig {
        radius: Some(0.05),
        direct: Direct::Photons,
        ..small(16, 2000)
    };
    let mut cpu = ppm_vk::cpu::Renderer::new(&packed, &scene.cameras[0], config).expect("renderer");
    (0..2).for_each(|_| drop(cpu.iterate().expect("iteration")));
    let (stored, expected) = (counters.photons_stored as f64, cpu.counters().photons_stored as f64);
    assert!(
        (stored / expected - 1.0).abs() < 2e-3,
        "{stored} photons stored, {expected} on the CPU"
    );
    assert_eq!(defects(&image), Defects::default());
}

#[test]
fn debug_builds_run_under_the_validation_layer() {
    let device = Device::open(None).expect("a Vulkan device");
    assert!(
        device.is_validated() || !cfg!(debug_assertions),
        "VK_LAYER_KHRONOS_validation isn't installed: these tests would miss what it says (scripts/setup installs it)"
    );
}
