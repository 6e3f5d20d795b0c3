//! Grids with more cells than memory, radii of all sizes, and photons that exceed the capacity.

use glam::Vec3;
use ppm_vk::internals::config::{Direct, EmissionChoice, RenderConfig};
use ppm_vk::internals::cpu::{self, DeviceReceivers};
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::layout::{Gathered, Photon, Statistics, VisiblePoint};
use ppm_vk::internals::scene::Scene;
use ppm_vk::internals::sizes::Probe;
use ppm_vk::internals::stage::BufferId;

use super::bench::{Bench, object, photon, random_numbers, visible_point, xyz};
use super::model::Model;
use super::sound::{assert_sound, render, render_within, square};

/// Gathers with every method of a device; each finds the same photons as testing all of them on the CPU. Returns M.
fn assert_gathers_agree(
    bench: &mut Bench,
    what: &str,
    points: &[VisiblePoint],
    radii2: &[f32],
    photons: &[Photon],
) -> Vec<u32> {
    let seen = DeviceReceivers {
        points,
        bsdfs: &[],
        radii2,
    };
    let expected = cpu::gather_naive(&seen, photons);
    bench.upload(BufferId::VisiblePoints, points);
    bench.upload(BufferId::Radii2, radii2);
    bench.upload(BufferId::Photons, photons);
    bench.upload(BufferId::PhotonCount, &[photons.len() as u32]);
    let count = |gathered: &Gathered| gathered.count;
    for (index, method) in METHODS
        .iter()
        .enumerate()
        .filter(|(_, method)| method.stages().is_some())
    {
        bench.renderer.gather(index, Probe::default()).expect("a gather");
        let found: Vec<Gathered> = bench.download(BufferId::GatheredOf);
        for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(count(found), expected.count, "{what}, {}, slot {slot}: M", method.name);
        }
        assert_sound(&mut bench.renderer);
    }
    expected.iter().map(|gathered| gathered.count).collect()
}

fn with_radius(radius: f64) -> RenderConfig {
    RenderConfig {
        radius: Some(radius),
        ..square(32, 5000)
    }
}

/// Cells of the hashed grid are 1.5 R wide: 2 / 2e-5 along each side of the scene.
#[test]
fn a_grid_of_1e15_cells_takes_no_more_memory_and_finds_every_photon() {
    const RADIUS: f32 = 1.3e-5;
    let mut bench = Bench::new("cornell", with_radius(RADIUS.into()));
    assert_sound(&mut bench.renderer);
    let large = Bench::new("cornell", with_radius(0.1));
    for id in [BufferId::CellStarts, BufferId::ObjectCells] {
        assert_eq!(
            bench.renderer.sizes().bytes(id),
            large.renderer.sizes().bytes(id),
            "{id:?}"
        );
    }
    let points: Vec<VisiblePoint> = bench.download(BufferId::VisiblePoints);
    // One photon within R of every visible point, one outside.
    let mut photons = Vec::new();
    for point in &points {
        if let Some(object) = object(point.object) {
            let normal = cpu::decode_direction(point.geometric_normal);
            let aside = normal.any_orthonormal_vector();
            for part in [0.5, 1.5] {
                let place = xyz(point.position) + aside * (part * f64::from(RADIUS));
                let mut near = photon(place.as_vec3().to_array(), object, [1.0; 3]);
                near.direction = cpu::encode_direction(-normal);
                photons.push(near);
            }
        }
    }
    let radii2 = vec![RADIUS * RADIUS; points.len()];
    let found = assert_gathers_agree(&mut bench, "1e15 cells", &points, &radii2, &photons);
    for (slot, (m, point)) in found.iter().zip(&points).enumerate() {
        let expected = u32::from(object(point.object).is_some());
        assert!(
            *m >= expected,
            "slot {slot}: the photon beside its visible point isn't found"
        );
    }
    assert!(photons.len() > 1800, "only {} photons", photons.len());
}

#[test]
fn radii_that_differ_by_a_million_in_one_picture_find_their_photons() {
    let mut bench = Bench::new("cornell", with_radius(1.0));
    let radii: Vec<f32> = random_numbers(1024).map(|[.., u]| 10f32.powf(-6.0 * u)).collect();
    let places: Vec<[f32; 3]> = random_numbers(1024)
        .map(|[x, y, ..]| [2.0 * x - 1.0, 2.0 * y - 1.0, 0.5])
        .collect();
    let points: Vec<VisiblePoint> = places.iter().map(|place| visible_point(*place, 0)).collect();
    let radii2: Vec<f32> = radii.iter().map(|radius| radius * radius).collect();
    let near = |part: f32| {
        places
            .iter()
            .zip(&radii)
            .map(move |([x, y, z], r)| photon([x + part * r, *y, *z], 0, [1.0; 3]))
    };
    let photons: Vec<Photon> = near(0.5).chain(near(1.5)).collect();
    let found = assert_gathers_agree(&mut bench, "radii from 1e-6 to 1", &points, &radii2, &photons);
    let (least, most) = (found.iter().min(), found.iter().max());
    println!("{least:?} to {most:?} photons a visible point");
    assert!(
        least >= Some(&1) && most > Some(&1000),
        "{least:?} to {most:?} photons a visible point"
    );
}

/// A closed room without absorption.
fn white_room() -> Scene {
    let mut model = Model::new();
    let white = model.matte([1.0; 3], 1.0);
    model.room(white, Vec3::NEG_ONE, Vec3::ONE);
    model.camera(Vec3::Z * 0.5, Vec3::ZERO, 1.0);
    model.scene()
}

/// In a closed room without absorption each path leaves as many photons as the bounce limit allows, forty times more than a
/// lane's capacity, and no buffer may be larger than a hundredth of them.
#[test]
fn photon_buffers_a_hundred_times_too_small_repeat_iterations_and_lose_nothing() {
    const DEPTH: u32 = 800;
    const PATHS: u32 = 256;
    let scene = white_room();
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.2),
        // Each path has the same number of photons.
        emission: EmissionChoice::Power,
        drop_unwanted: false,
        max_depth: DEPTH,
        ..square(16, PATHS)
    };
    let mut free = render(&scene, 0, 2, config.clone());
    let bytes = u64::from(PATHS * DEPTH) * size_of::<Photon>() as u64 / 100;
    let mut tight = render_within(Some(bytes), &scene, 0, 2, config);
    for (what, rendered) in [("free", &free), ("tight", &tight)] {
        let counters = rendered.counters;
        println!(
            "{what}: {} batches, {counters:?}",
            rendered.renderer.sizes().batches(PATHS)
        );
        assert!(
            counters.repeated_iterations > 0,
            "{what}: the buffers were never too small"
        );
        assert_eq!(counters.photons_stored, u64::from(2 * PATHS * DEPTH), "{what}");
        assert_eq!(counters.truncated_paths, u64::from(2 * PATHS), "{what}");
    }
    assert!(
        tight.renderer.sizes().batches(PATHS) > 50,
        "{:?}",
        tight.renderer.sizes()
    );
    let [expected, found] = [&mut free, &mut tight].map(|r| r.download::<Statistics>(BufferId::StatisticsOf));
    for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!(
            found.accepted_low, expected.accepted_low,
            "slot {slot}: photons accepted"
        );
        // Sums of f32 in another order.
        let off = f64::from(found.flux_high[0]) / f64::from(expected.flux_high[0]).max(1e-30) - 1.0;
        assert!(
            expected.accepted_low == 0 || off.abs() < 1e-5,
            "slot {slot}: τ off by {off:e}"
        );
    }
}

/// Pilot paths leave ten times as many photons as expected: rounds are repeated in smaller batches, and the learned photons are
/// limited to a batch. The ratio's standard deviation is 0.5 % (8 seeds), so that a right program fails less than once in 10⁶ times.
#[test]
fn pilot_paths_whose_photons_do_not_fit_are_learned_from_in_smaller_batches() {
    const PATHS: u32 = 20_000;
    let scene = white_room();
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.2),
        emission: EmissionChoice::Aimed,
        aims_anyway: true,
        drop_unwanted: false,
        max_depth: 50,
        ..square(16, PATHS)
    };
    let free = render(&scene, 0, 8, config.clone());
    let tight = render_within(Some(u64::from(PATHS / 10) * 50), &scene, 0, 8, config);
    let sizes = tight.renderer.sizes();
    println!("{} paths in a batch", sizes.batch_paths);
    assert!(tight.renderer.aim().is_some(), "nothing was aimed");
    assert!((20..1000).contains(&sizes.batch_paths), "{sizes:?}");
    let mean = |image| ppm_vk::internals::metrics::mean(image)[0];
    let ratio = mean(&tight.image) / mean(&free.image);
    assert!((ratio - 1.0).abs() < 0.03, "{ratio} of the light");
}
