//! The gather methods: each finds the same photons as testing every photon on the CPU, with N and M exact.

use glam::DVec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::cpu;
use ppm_vk::internals::gather::{self, METHODS};
use ppm_vk::internals::layout::{Gathered, ObjectGrid, Photon, Statistics, VisiblePoint};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::shaders;
use ppm_vk::internals::sizes::Probe;
use ppm_vk::internals::stage::{BufferId, StageDesc};

use super::agreement::relative_difference;
use super::bench::{Bench, Seen, photon, random_numbers, small, visible_point, xyz};

/// Statistics with a radius for all visible points, in each photon map.
fn with_radius(bench: &Bench, radius2: f32) -> Vec<Statistics> {
    vec![Statistics::of_radius2(radius2); bench.renderer.sizes().receivers() as usize]
}

/// R² of each.
fn radii2(statistics: &[Statistics]) -> Vec<f32> {
    statistics.iter().map(|statistics| statistics.radius2_high).collect()
}

/// M of each slot.
fn counts(gathered: &[Gathered]) -> Vec<u32> {
    gathered.iter().map(|gathered| gathered.count).collect()
}

/// Gathers with every method on the device, updates the statistics, and compares both with the CPU's. Returns M.
fn assert_methods_agree(
    bench: &mut Bench,
    case: &str,
    points: &[VisiblePoint],
    statistics: &[Statistics],
    photons: &[Photon],
) -> Vec<u32> {
    let seen = Seen {
        points: points.to_vec(),
        bsdfs: Vec::new(),
    };
    assert_methods_agree_on(bench, case, &seen, statistics, photons)
}

fn assert_methods_agree_on(
    bench: &mut Bench,
    case: &str,
    seen: &Seen,
    statistics: &[Statistics],
    photons: &[Photon],
) -> Vec<u32> {
    let points = &seen.points;
    assert_eq!(
        points.len(),
        bench.renderer.sizes().slots() as usize,
        "one visible point a slot"
    );
    assert!(
        photons.len() <= bench.renderer.sizes().photon_capacity as usize,
        "more photons than the buffers hold"
    );
    let radii2 = radii2(statistics);
    let expected = cpu::gather_naive(&seen.with(&radii2), photons);
    let alpha = f64::from(bench.config.alpha);
    let update = |(index, (gathered, before)): (usize, (&cpu::Gathered, &Statistics))| {
        let weight = xyz(points[index % points.len()].weight);
        let mut updated = cpu::Statistics::from(before);
        updated.take(gathered.count, weight * gathered.flux, alpha);
        // The curvature is accumulated like the flux.
        let mut curvature = cpu::Statistics::from(before);
        curvature.flux = DVec3::splat((before.flux_high[3] + before.flux_low[3]).into());
        let of_disc = weight.element_sum() / 3.0 * gathered.curvature(before.radius2_high.into());
        curvature.take(gathered.count, DVec3::splat(of_disc), alpha);
        (updated, curvature.flux.x)
    };
    let updated: Vec<_> = expected.iter().zip(statistics).enumerate().map(update).collect();

    bench.upload(BufferId::VisiblePoints, points);
    if !seen.bsdfs.is_empty() {
        bench.upload(BufferId::PackedBsdfs, &seen.bsdfs);
    }
    bench.upload(BufferId::Photons, photons);
    bench.upload(BufferId::PhotonCount, &[photons.len() as u32]);
    for (index, method) in METHODS.iter().enumerate() {
        if method.stages().is_none() {
            continue;
        }
        let what = format!("{case}, {}", method.name);
        bench.upload(BufferId::StatisticsOf, statistics);
        bench.upload(BufferId::Radii2, &radii2);
        bench
            .renderer
            .gather(index, Probe::default())
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        let found: Vec<Gathered> = bench.download(BufferId::GatheredOf);
        assert_same_photons(&what, &found, &expected);

        let mut recording = Recording::new();
        recording.fill(BufferId::Status, 0);
        let update = StageDesc::new(&shaders::UPDATE, points.len() as u32);
        recording.dispatch(
            update
                .push(shaders::UpdatePush {
                    photons: bench.config.photons as f32,
                })
                .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
        );
        bench
            .renderer
            .run(&recording)
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
        assert_same_statistics(&what, &found, &updated);
    }
    expected.iter().map(|gathered| gathered.count).collect()
}

fn assert_same_photons(what: &str, found: &[Gathered], expected: &[cpu::Gathered]) {
    for (slot, (found, expected)) in found.iter().zip(expected).enumerate() {
        let counts = (found.count, expected.count);
        assert_eq!(counts.0, counts.1, "{what}, slot {slot}: M on the device, M on the CPU");
    }
    for (slot, (found, expected)) in found.iter().zip(expected).enumerate() {
        let (found, expected) = (found.moment.into(), expected.moment);
        assert!(
            relative_difference(found, expected) <= 5e-5,
            "{what}, slot {slot}: moment {found} on the device, {expected} on the CPU"
        );
    }
}

fn assert_same_statistics(what: &str, found: &[Statistics], expected: &[(cpu::Statistics, f64)]) {
    for (slot, (found, (expected, curvature))) in found.iter().zip(expected).enumerate() {
        let found_curvature = f64::from(found.flux_high[3]) + f64::from(found.flux_low[3]);
        let found = cpu::Statistics::from(found);
        // A difference of sums that are as large as the flux.
        let off =
            (found_curvature - curvature).abs() / (expected.flux.element_sum() / 3.0 + curvature.abs()).max(1e-30);
        assert!(
            off <= 1e-4,
            "{what}, slot {slot}: curvature {found_curvature} on the device, {curvature} on the CPU"
        );
        assert_eq!(
            found.accepted, expected.accepted,
            "{what}, slot {slot}: photons accepted"
        );
        // Sums of f32 in another order: √M roundings.
        for (tau, expected) in found.flux.to_array().into_iter().zip(expected.flux.to_array()) {
            let difference = relative_difference(tau, expected);
            assert!(
                difference <= 1e-5,
                "{what}, slot {slot}: τ {tau} on the device, {expected} on the CPU"
            );
        }
        let difference = relative_difference(found.radius2, expected.radius2);
        assert!(
            difference <= 1e-6,
            "{what}, slot {slot}: R² {} on the device, {} on the CPU",
            found.radius2,
            expected.radius2
        );
    }
}

/// Gives the scene this number of objects, each as large as the scene.
fn with_objects(count: u32) -> impl FnOnce(&mut PackedScene) {
    move |scene| {
        let grid = |object| ObjectGrid {
            low: [-1.0; 3],
            inverse_cell: 2.0,
            cells: [4; 3],
            first_cell: 64 * object,
        };
        scene.object_grids = (0..count).map(grid).collect();
        scene.object_cells = 64 * count;
    }
}

#[test]
fn all_methods_agree_in_every_scene_at_any_radius_early_and_late() {
    let mut scenes: Vec<String> = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes"))
        .expect("scenes")
        .filter_map(|entry| Some(entry.ok()?.file_name().to_str()?.strip_suffix(".gltf")?.to_owned()))
        .collect();
    scenes.sort();
    assert!(scenes.len() >= 10, "{scenes:?}");
    for scene in scenes {
        let config = RenderConfig {
            resolution: [32, 32],
            photons: 1501,
            ..RenderConfig::default()
        };
        let mut bench = Bench::new(&scene, config);
        for iterations in [1, 30] {
            while bench.renderer.iterations() < iterations {
                bench.renderer.iterate().expect("an iteration");
            }
            let (seen, photons) = (bench.seen(), bench.photons());
            let now: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
            for factor in [0.25f32, 1.0, 4.0] {
                let scaled = |s: &Statistics| Statistics {
                    radius2_high: s.radius2_high * factor * factor,
                    ..*s
                };
                let statistics: Vec<Statistics> = now.iter().map(scaled).collect();
                let case = format!("{scene} after {iterations} iterations, {factor} times the radii");
                assert_methods_agree_on(&mut bench, &case, &seen, &statistics, &photons);
            }
            bench.upload(BufferId::StatisticsOf, &now);
        }
    }
}

#[test]
fn more_than_ten_thousand_meshes_some_without_photons_or_visible_points_are_distinguished() {
    const MESHES: u32 = 10_007;
    let config = RenderConfig {
        resolution: [64, 64],
        photons: 4000,
        radius: Some(0.1),
        ..small()
    };
    let mut bench = Bench::with("cornell", config, with_objects(MESHES));
    let slots = bench.renderer.sizes().slots();
    // Most of 10,007 meshes have none of the 4,096 points; photons lie on every second mesh.
    let mesh = |u: f32| (u * MESHES as f32) as u32;
    let points: Vec<VisiblePoint> = random_numbers(slots)
        .map(|[x, y, u, _]| visible_point([2.0 * x - 1.0, 2.0 * y - 1.0, 0.0], mesh(u)))
        .collect();
    let photons: Vec<Photon> = random_numbers(10_001)
        .map(|[u, x, y, r]| photon([2.0 * x - 1.0, 2.0 * y - 1.0, 0.0], mesh(u) & !1, [r, 1.0, 0.5]))
        .collect();
    let statistics = with_radius(&bench, 1.0);
    let m = assert_methods_agree(&mut bench, "10,007 meshes", &points, &statistics, &photons);
    assert!(m.contains(&0) && m.contains(&1), "some find none, some find one");
}

#[test]
fn all_methods_agree_on_traced_photons_at_any_radius() {
    let mut bench = Bench::new("cornell-spheres", small());
    let (points, photons): (Vec<VisiblePoint>, _) = (bench.download(BufferId::VisiblePoints), bench.photons());
    let batches = bench.renderer.sizes().batches(bench.config.photons);
    if batches > 1 {
        println!(
            "skipped by a limit: the device holds the photons of an iteration in {batches} batches, and one is gathered"
        );
        return;
    }
    let radius2 = bench.renderer.radius().powi(2);
    let mut means = Vec::new();
    for factor in [0.25f32, 1.0, 4.0] {
        let statistics = with_radius(&bench, radius2 * factor * factor);
        let case = format!("{} photons, {factor} times the automatic radius", photons.len());
        let m = assert_methods_agree(&mut bench, &case, &points, &statistics, &photons);
        means.push(m.iter().map(|&m| f64::from(m)).sum::<f64>() / m.len() as f64);
    }
    // The radius is chosen for 8 to 64 photons at the median visible point.
    println!("mean M at a quarter of, at, and at four times the automatic radius: {means:?}");
    assert!(means[1] > 4.0 && means[1] < 128.0, "mean M {means:?}");
    assert!(means[0] < means[1] && means[1] < means[2], "mean M {means:?}");
}

#[test]
fn all_methods_agree_on_light_that_glossy_surfaces_scatter_to_the_viewer() {
    let mut bench = Bench::new("glossy", small());
    let (seen, photons) = (bench.seen(), bench.photons());
    let statistics = with_radius(&bench, bench.renderer.radius().powi(2));
    assert_methods_agree_on(&mut bench, "glossy surfaces", &seen, &statistics, &photons);
}

#[test]
fn all_methods_agree_where_radii_differ() {
    let mut bench = Bench::new("cornell-spheres", small());
    let (points, photons): (Vec<VisiblePoint>, _) = (bench.download(BufferId::VisiblePoints), bench.photons());
    let radius = bench.renderer.radius();
    let statistics: Vec<Statistics> = random_numbers(bench.renderer.sizes().receivers())
        .map(|[u, ..]| Statistics::of_radius2((radius * 4f32.powf(2.0 * u - 1.0)).powi(2)))
        .collect();
    assert_methods_agree(
        &mut bench,
        "radii from a quarter to four times",
        &points,
        &statistics,
        &photons,
    );
}

/// 8×8 visible points, room for more than 65,535 photons.
fn tiny() -> RenderConfig {
    RenderConfig {
        resolution: [8, 8],
        photons: 20_000,
        radius: Some(0.1),
        ..small()
    }
}

/// A visible point for each slot, on object 0 in the plane z = 0.
fn plane(bench: &Bench) -> Vec<VisiblePoint> {
    let slots = bench.renderer.sizes().slots();
    random_numbers(slots)
        .map(|[x, y, ..]| visible_point([2.0 * x - 1.0, 2.0 * y - 1.0, 0.0], 0))
        .collect()
}

#[test]
fn no_photon_and_one_photon_are_gathered() {
    let mut bench = Bench::new("cornell", tiny());
    let points = plane(&bench);
    let statistics = with_radius(&bench, 0.25);
    let m = assert_methods_agree(&mut bench, "no photon", &points, &statistics, &[]);
    assert!(m.iter().all(|&m| m == 0));
    let photons = [photon([0.1, 0.2, 0.0], 0, [1.0, 2.0, 3.0])];
    let m = assert_methods_agree(&mut bench, "one photon", &points, &statistics, &photons);
    assert!(m.contains(&0) && m.contains(&1), "{m:?}");
}

#[test]
fn a_photon_at_distance_r_counts_and_the_next_one_beyond_does_not() {
    let mut bench = Bench::with("cornell", tiny(), with_objects(64));
    // Coordinates are multiples of 2⁻²⁰ and 5² = 4² + 3²: f32 represents all distances exactly. Each visible point has its own
    // object.
    let grid = |u: f32| ((2.0 * u - 1.0) * 512.0).round() / 1024.0;
    let radius = 5.0f32 / 64.0;
    let (mut points, mut photons) = (Vec::new(), Vec::new());
    for (slot, [x, y, z, _]) in (0..).zip(random_numbers(64)) {
        let [x, y, z] = [grid(x), grid(y), grid(z)];
        points.push(visible_point([x, y, z], slot));
        let flux = [1.0; 3];
        for (dx, dy, dz) in [
            (5.0, 0.0, 0.0),
            (-5.0, 0.0, 0.0),
            (0.0, 4.0, -3.0),
            (-3.0, 0.0, 4.0),
            (-4.0, -3.0, 0.0),
        ] {
            let [dx, dy, dz]: [f32; 3] = [dx / 64.0, dy / 64.0, dz / 64.0];
            photons.push(photon([x + dx, y + dy, z + dz], slot, flux));
        }
        // A millionth farther, on either side.
        let beyond = radius + 1.0 / 1_048_576.0;
        photons.extend([x + beyond, x - beyond].map(|farther| photon([farther, y, z], slot, flux)));
    }
    let statistics = with_radius(&bench, radius * radius);
    let m = assert_methods_agree(&mut bench, "photons at distance R", &points, &statistics, &photons);
    assert_eq!(m, vec![5; 64], "five photons lie at R, two just beyond");
}

#[test]
fn photons_of_another_object_or_from_behind_do_not_count() {
    let mut bench = Bench::new("cornell", tiny());
    let points = plane(&bench);
    let statistics = with_radius(&bench, 9.0);
    let from_behind = |mut photon: Photon| {
        photon.direction = cpu::encode_direction(glam::DVec3::Z);
        photon
    };
    let here = photon([0.0; 3], 0, [1.0; 3]);
    let photons = [here, photon([0.0; 3], 1, [1.0; 3]), from_behind(here)];
    let m = assert_methods_agree(&mut bench, "one of three photons", &points, &statistics, &photons);
    assert_eq!(m, vec![1; 64]);
}

#[test]
fn photons_that_lie_in_one_cell_are_all_found() {
    let mut bench = Bench::new("cornell", tiny());
    let points = plane(&bench);
    // Cells are as large as the radii: 4,099 photons, a prime, lie within a thousandth of one.
    let photons: Vec<Photon> = random_numbers(4099)
        .map(|[x, y, r, g]| photon([0.3 + 1e-4 * x, -0.2 + 1e-4 * y, 0.0], 0, [r, g, 1.0]))
        .collect();
    let statistics = with_radius(&bench, 0.16);
    let m = assert_methods_agree(&mut bench, "photons in one cell", &points, &statistics, &photons);
    assert!(m.contains(&0) && m.contains(&4099), "{m:?}");
}

#[test]
fn more_photons_than_a_loop_may_test_are_all_tested() {
    // Some drivers silently end an invocation's loops at 65,535 iterations. A prime again, so that no range or block is full.
    let mut bench = Bench::new("cornell", tiny());
    let points = plane(&bench);
    let photons: Vec<Photon> = random_numbers(70_001)
        .map(|[x, y, r, g]| photon([2.0 * x - 1.0, 2.0 * y - 1.0, 0.0], 0, [r, g, 0.5]))
        .collect();
    let statistics = with_radius(&bench, 9.0);
    let m = assert_methods_agree(&mut bench, "70,001 photons within R", &points, &statistics, &photons);
    assert_eq!(m, vec![70_001; 64]);
}

#[test]
fn photons_beyond_a_cells_maximum_are_lost_and_counted() {
    let config = RenderConfig {
        cell_photons: Some(100),
        ..tiny()
    };
    let mut bench = Bench::with("cornell", config, with_objects(2));
    let points = plane(&bench);
    // Both within a cell of side 0.5 of their object's grid.
    let photons: Vec<Photon> = random_numbers(1000)
        .map(|[x, y, ..]| photon([0.1 + 0.1 * x, 0.1 + 0.1 * y, 0.0], 0, [1.0; 3]))
        .chain([photon([0.7, 0.7, 0.0], 0, [1.0; 3])])
        .collect();
    bench.upload(BufferId::VisiblePoints, &points);
    bench.upload(BufferId::Photons, &photons);
    bench.upload(BufferId::PhotonCount, &[photons.len() as u32]);
    bench.upload(BufferId::Radii2, &radii2(&with_radius(&bench, 9.0)));
    let method = gather::method("cluster-grid").expect("cluster-grid");
    let (_, status) = bench.renderer.gather(method, Probe::default()).expect("a gather");
    assert_eq!((status.lost_photons, status.full_cells), (900, 1));
    let m = counts(&bench.download::<Gathered>(BufferId::GatheredOf));
    assert_eq!(m, vec![101; 64], "the cell's first hundred, and the one elsewhere");
}
