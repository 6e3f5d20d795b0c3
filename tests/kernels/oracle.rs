//! The CPU's functions compared with each other and with known results.

use glam::DVec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Accel, Direct, RenderConfig};
use ppm_vk::internals::cpu::{self, DeviceReceivers, Inputs, Ray, Renderer};
use ppm_vk::internals::film::Image;
use ppm_vk::internals::layout::{Settings, VisiblePoint};
use ppm_vk::internals::metrics;
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::random::CameraTurn;

use super::bench::{Bench, packed, random_numbers, scene, small, visible_point};

fn inputs<'a>(scene: &'a PackedScene, settings: &'a Settings, config: &'a RenderConfig) -> Inputs<'a> {
    Inputs {
        scene,
        settings,
        config,
    }
}

/// Rays from near the centre of the scene in all directions.
fn rays(count: u32) -> impl Iterator<Item = Ray> {
    random_numbers(count).map(|[x, y, u, v]| {
        let (z, phi) = (2.0 * f64::from(u) - 1.0, std::f64::consts::TAU * f64::from(v));
        let r = (1.0 - z * z).sqrt();
        Ray {
            origin: DVec3::new(f64::from(x) - 0.5, f64::from(y) - 0.5, 0.1) * 0.5,
            direction: DVec3::new(r * phi.cos(), r * phi.sin(), z),
        }
    })
}

#[test]
fn the_hierarchy_finds_the_hits_that_testing_every_triangle_finds() {
    let settings: Settings = bytemuck::Zeroable::zeroed();
    let with_bvh = small();
    let without = RenderConfig {
        accel: Accel::Brute,
        ..small()
    };
    for name in ["cornell-spheres", "pool", "ring", "instances"] {
        let scene = packed(&scene(name));
        let (bvh, brute) = (
            inputs(&scene, &settings, &with_bvh),
            inputs(&scene, &settings, &without),
        );
        let mut hits = 0;
        for ray in rays(1000) {
            let (found, expected) = (
                cpu::nearest_hit(&bvh, ray, 1e30, None),
                cpu::nearest_hit(&brute, ray, 1e30, None),
            );
            assert_eq!(found.map(|hit| hit.t), expected.map(|hit| hit.t), "{name}: {ray:?}");
            if let Some(hit) = expected {
                hits += 1;
                for limit in [0.5 * hit.t, hit.t, 1.5 * hit.t] {
                    let before = cpu::nearest_hit(&bvh, ray, limit, None);
                    assert_eq!(before.is_some(), limit > hit.t, "{name}: {ray:?} before {limit}");
                }
            }
        }
        assert!(hits > 300, "{name}: only {hits} of 1000 rays hit something");
    }
}

#[test]
fn no_ray_leaves_a_closed_room() {
    let scene = packed(&scene("furnace-closed"));
    let settings: Settings = bytemuck::Zeroable::zeroed();
    let config = small();
    for ray in rays(20_000) {
        assert!(
            cpu::nearest_hit(&inputs(&scene, &settings, &config), ray, 1e30, None).is_some(),
            "{ray:?}"
        );
    }
}

#[test]
fn the_kd_tree_finds_the_same_as_testing_every_photon() {
    let bench = Bench::new("cornell-spheres", small());
    let plain = bench.plain();
    let paths = plain.trace_camera_paths(CameraTurn::FIRST);
    let points: Vec<VisiblePoint> = paths
        .iter()
        .flat_map(|path| &path.points)
        .map(|point| {
            let [x, y, z] = point.surface.position.as_vec3().to_array();
            let mut of_kernels = visible_point([x, y, z], point.surface.object);
            of_kernels.geometric_normal = cpu::encode_direction(point.bsdf.normals().geometric);
            of_kernels
        })
        .collect();
    let (photons, _) = plain.trace_photon_paths(0, 0..bench.config.photons);
    for radius in [0.2, 1.0, 5.0] {
        let radii2 = vec![(radius * plain.radius()).powi(2); points.len()];
        let seen = DeviceReceivers {
            points: &points,
            bsdfs: &[],
            radii2: &radii2,
        };
        let found = cpu::gather_kd_tree(&seen, &photons);
        let expected = cpu::gather_naive(&seen, &photons);
        let differing = found.iter().zip(&expected).position(|(a, b)| a.count != b.count);
        assert_eq!(
            differing, None,
            "slot that differs at {radius} times the automatic radius"
        );
        // Sums of f64 in another order.
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                (found.flux - expected.flux).length() <= 1e-12 * expected.flux.length(),
                "{found:?}"
            );
        }
        assert!(
            expected.iter().any(|gathered| gathered.count > 0),
            "nothing is gathered at {radius}"
        );
    }
}

fn render(name: &str, config: RenderConfig, iterations: u32) -> Image {
    let loaded = scene(name);
    let scene = packed(&loaded);
    let mut renderer = Renderer::new(&scene, &loaded.cameras[0], config).expect("a renderer");
    for _ in 0..iterations {
        renderer.iterate().expect("an iteration");
    }
    assert_eq!(renderer.counters().non_finite, 0, "{name}");
    renderer.resolve().expect("a picture")
}

#[test]
fn one_seed_gives_the_same_bits_whatever_the_number_of_threads() {
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| render("cornell-spheres", small(), 2))
    };
    let (one, three) = (with_threads(1), with_threads(3));
    assert_eq!(one.pixels(), three.pixels());
    let other_seed = RenderConfig { seed: 1, ..small() };
    assert_ne!(one.pixels(), render("cornell-spheres", other_seed, 2).pixels());
}

#[test]
fn a_closed_furnace_has_radiance_emission_over_one_minus_albedo() {
    // Le = 1, ρ = (0.2, 0.5, 0.8).
    let expected = [1.25, 2.0, 5.0];
    for direct in [Direct::Light, Direct::Photons] {
        let config = RenderConfig {
            direct,
            resolution: [32, 32],
            photons: 20_000,
            // A larger disc reaches past the walls' edges, where there are no photons.
            radius: Some(0.02),
            ..small()
        };
        let mean = metrics::mean(&render("furnace-closed", config, 64));
        println!("direct light from {direct:?}: {mean:?}");
        for channel in 0..3 {
            let ratio = mean[channel] / expected[channel];
            // Noise of a few thousandths.
            assert!(
                (ratio - 1.0).abs() < 0.01,
                "direct light from {direct:?}: {mean:?}, {expected:?} expected"
            );
        }
    }
}
