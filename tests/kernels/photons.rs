//! The stages `emission`, `photons` and `compact`.

use glam::{DVec3, dvec2};
use ppm_vk::internals::config::{Accel, Direct, EmissionChoice, RenderConfig, Sampler};
use ppm_vk::internals::cpu;
use ppm_vk::internals::layout::{PathStart, Photon};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::random::Random;
use ppm_vk::internals::stage::BufferId;

use super::agreement::Agreement;
use super::bench::{Bench, object, small, xyz};

/// The photons of each lane as the device stores them: `[number][lane]`.
fn lanes_on_device(bench: &mut Bench) -> Vec<Vec<Photon>> {
    let counts: Vec<u32> = bench.download(BufferId::LaneCounts);
    let stored: Vec<Photon> = bench.download(BufferId::LanePhotons);
    let lanes = counts.len();
    let lane = |(lane, &count): (usize, &u32)| {
        (0..count as usize)
            .map(|number| stored[number * lanes + lane])
            .collect()
    };
    counts.iter().enumerate().map(lane).collect()
}

/// Mean, and variance of the mean, of the flux that each object receives, from the photons of this number of groups of paths.
fn flux_of_objects(groups: &[Vec<Photon>], paths: u32, objects: usize) -> Vec<[f64; 2]> {
    let count = groups.len() as f64;
    let of_object = |wanted: u32| {
        let sums = groups.iter().map(|photons| {
            let on_it = photons.iter().filter(|photon| object(photon.object) == Some(wanted));
            on_it.map(|photon| xyz(photon.flux).element_sum()).sum::<f64>()
        });
        let sums: Vec<f64> = sums.collect();
        let mean = sums.iter().sum::<f64>() / count;
        let squares: f64 = sums.iter().map(|sum| (sum - mean).powi(2)).sum();
        let paths = f64::from(paths) / count;
        [mean / paths, squares / (count * (count - 1.0)) / (paths * paths)]
    };
    (0..objects as u32).map(of_object).collect()
}

fn is_coated(scene: &PackedScene, object: u32) -> bool {
    let triangle = scene
        .shading_triangles
        .iter()
        .find(|triangle| triangle.object == object);
    triangle.is_some_and(|triangle| scene.materials[triangle.material as usize].coat > 0.0)
}

/// Paths of a batch: the same number in each lane, or one more.
const PATHS: u32 = 65_536;

/// Flux that each object receives: of aimed paths, of paths started by power, and of the CPU's. Sums of a thousand groups and
/// more are nearly normal: with six standard errors a correct program fails once in 5·10⁸ times for each of fewer than 400
/// numbers.
fn assert_flux_agrees(name: &str, accel: Accel) {
    let config = |emission| RenderConfig {
        direct: Direct::Photons,
        photons: PATHS,
        sampler: Sampler::Independent,
        drop_unwanted: false,
        aims_anyway: true,
        max_depth: 128,
        radius: Some(0.05),
        accel,
        emission,
        ..small()
    };
    let mut by_power = Bench::new(name, config(EmissionChoice::Power));
    let objects = by_power.scene.object_grids.len();
    let plain = by_power.plain();
    let groups: Vec<Vec<Photon>> = (0..PATHS / 16)
        .map(|group| plain.trace_photon_paths(0, 16 * group..16 * (group + 1)).0)
        .collect();
    let expected = flux_of_objects(&groups, PATHS, objects);
    let mut aimed = Bench::new(name, config(EmissionChoice::Aimed));
    for (what, bench) in [("by power", &mut by_power), ("aimed", &mut aimed)] {
        let lanes = lanes_on_device(bench);
        assert!((1000..=PATHS as usize).contains(&lanes.len()), "{} lanes", lanes.len());
        let found = flux_of_objects(&lanes, PATHS, objects);
        for (object, (found, expected)) in found.iter().zip(&expected).enumerate() {
            // On coated materials the flux of the kernels' photons is per area across the ray.
            if is_coated(&bench.scene, object as u32) {
                continue;
            }
            let error = (found[1] + expected[1]).sqrt();
            println!(
                "{name}, {what}, object {object}: {} on the device, {} on the CPU, ± {error}",
                found[0], expected[0]
            );
            assert!(
                (found[0] - expected[0]).abs() <= 6.0 * error + 1e-6 * expected[0],
                "{name}, {what}, object {object}: {} on the device, {} on the CPU, ± {error}",
                found[0],
                expected[0]
            );
        }
        assert!(found.iter().any(|flux| flux[0] > 0.0), "{name}: no photon");
    }
}

#[test]
fn photons_bring_each_object_the_flux_that_the_cpus_bring() {
    for name in [
        "cornell",
        "cornell-spheres",
        "glossy",
        "glasses",
        "coats",
        "textures",
        "cornell-spheres, patterned",
        "instances",
        "cornell-spheres, lit",
        "ring, lit",
        "glasses, lit",
        "glasses, softly lit",
    ] {
        assert_flux_agrees(name, Accel::Bvh);
    }
    assert_flux_agrees("cornell", Accel::Brute);
}

/// Starts by power: the same numbers choose the same light, position and direction.
#[test]
fn paths_start_where_the_cpus_start() {
    for name in [
        "cornell-spheres, patterned",
        "glossy, lit",
        "glossy, softly lit",
        "instances",
        "many-lamps",
    ] {
        let config = RenderConfig {
            emission: EmissionChoice::Power,
            ..small()
        };
        let mut bench = Bench::new(name, config);
        let starts: Vec<PathStart> = bench.download(BufferId::PathStarts);
        let mut agreement = Agreement::default();
        for (path, found) in (0..bench.config.photons).zip(&starts) {
            let mut random = Random::of_photon(&bench.config, path, 0);
            let (u, w) = (random.next4(), random.next4());
            let (light, rest) = cpu::choose_by_power(&bench.scene.lights, u[0], [w[0], w[2]]);
            let (place, direction) = (dvec2(rest, u[1]), dvec2(u[2], u[3]));
            let expected = cpu::sample_emission(&bench.inputs(), light, place, direction, w[1]);
            let flux = expected.flux / f64::from(bench.scene.lights[light as usize].probability);
            let v = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
            // Rounding of coordinates within ±2, and of sines and cosines.
            let same = found.light == light
                && v(found.origin).distance(expected.ray.origin) < 4e-6
                && v(found.direction).distance(expected.ray.direction) < 4e-6
                && v(found.flux).distance(flux) <= 1e-4 * flux.length()
                && (found.triangle == u32::MAX) == expected.ignored.is_none();
            agreement.note(same, || {
                format!("path {path}: {found:?} on the device, {expected:?}, flux {flux} on the CPU")
            });
        }
        // Rounding decides on which side of the edge of a light's part, of a pixel or of a texel a number lies.
        agreement.assert(&format!("starts in {name}"), 0.995, 4000);
    }
}

fn photons_carry_all_light() -> RenderConfig {
    RenderConfig {
        direct: Direct::Photons,
        ..small()
    }
}

#[test]
fn photons_lie_together_in_the_order_of_lanes() {
    let mut bench = Bench::new("cornell", photons_carry_all_light());
    let lanes = lanes_on_device(&mut bench);
    let expected = lanes.concat();
    let found = bench.photons();
    assert_eq!(found.len(), expected.len(), "photons");
    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
        // An object's number may be a NaN's bits.
        assert_eq!(
            bytemuck::bytes_of(found),
            bytemuck::bytes_of(expected),
            "photon {i}: {found:?}, {expected:?}"
        );
    }
    let before = lanes.iter().scan(0, |before, lane| {
        let offset = *before;
        *before += lane.len() as u32;
        Some(offset)
    });
    let offsets: Vec<u32> = before.collect();
    assert_eq!(bench.download::<u32>(BufferId::LaneOffsets), offsets);
}
