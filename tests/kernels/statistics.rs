//! The stages `reset`, `update` and `resolve`.

use bytemuck::Zeroable;
use ppm_vk::backend::Backend;
use ppm_vk::config::{Estimator, RenderConfig, Totals};
use ppm_vk::cpu::{self, Counts, GatheredWith};
use ppm_vk::gather::METHODS;
use ppm_vk::layout::{
    BehindGlass, Coverage, DirectSum, Gathered, GridShape, NO_OBJECT, Photon, Settings, ShellRadii, Statistics,
    VisiblePoint,
};
use ppm_vk::record::Recording;
use ppm_vk::shaders;
use ppm_vk::stage::{BufferId, SEQUENCE_SUMS, StageDesc};

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, photon, random_numbers, scene, small, visible_point};

/// Values of 1e-6 relative: the device keeps two f32 of each, 48 bits, but rounds the factors of eq. 2 to f32.
const TOLERANCE: f64 = 1e-6;

fn tiny() -> RenderConfig {
    RenderConfig {
        resolution: [8, 8],
        photons: 64,
        radius: Some(0.1),
        ..small()
    }
}

fn accepted(statistics: &Statistics) -> u64 {
    u64::from(statistics.accepted_low) | u64::from(statistics.accepted_high) << 32
}

fn radius2(statistics: &Statistics) -> f64 {
    f64::from(statistics.radius2_high) + f64::from(statistics.radius2_low)
}

#[test]
fn radii_and_flux_follow_equations_2_and_3_over_ten_thousand_iterations() {
    const ITERATIONS: u32 = 10_000;
    let mut bench = Bench::new("cornell", tiny());
    // Slot i lies on object i; so many photons arrive there in each iteration.
    let arriving = |slot: u32| {
        if slot == 63 {
            0
        } else {
            [0, 1, 2, 3, 7, 30][slot as usize % 6]
        }
    };
    let mut points: Vec<VisiblePoint> = (0..64).map(|slot| visible_point([0.0; 3], slot)).collect();
    points[63].position_object[3] = f32::from_bits(NO_OBJECT);
    let mut photons: Vec<Photon> = Vec::new();
    for slot in 0..64 {
        photons.extend((0..arriving(slot)).map(|i| photon([0.0; 3], slot, [1.0, 0.1 + i as f32, 1e-3])));
    }
    let mut statistics = vec![cpu::reset(0.01); 64];
    for (slot, statistics) in statistics.iter_mut().enumerate() {
        // What came before: nothing, or so much that one photon changes less than the precision of an f32.
        let before: u64 = [0, 100_000_000, u64::from(u32::MAX) - 5][slot / 6 % 3];
        (statistics.accepted_low, statistics.accepted_high) = (before as u32, (before >> 32) as u32);
        statistics.flux_high = [before as f32, 0.0, 1.0, 0.0];
    }
    bench.upload(BufferId::VisiblePoints, &points);
    bench.upload(BufferId::StatisticsOf, &statistics);
    bench.upload(BufferId::Photons, &photons);
    bench.upload(BufferId::PhotonCount, &[photons.len() as u32]);
    // In runs of 500: each launch has its timestamps.
    let mut recording = Recording::new();
    recording.fill(BufferId::GatheredOf, 0);
    let (_, naive) = METHODS[0].stages().expect("a method of devices");
    for _ in 0..500 {
        recording.dispatch(StageDesc::new(&shaders::RADII, 64));
        naive(bench.renderer.sizes(), &mut recording);
        recording.dispatch(
            StageDesc::new(&shaders::UPDATE, 64)
                .push([1f32])
                .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
        );
    }
    for _ in 0..ITERATIONS / 500 {
        bench.renderer.run(&recording).expect("a run");
    }
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);

    let before = statistics.clone();
    let mut expected = statistics;
    let mut gathered = vec![Gathered::zeroed(); 64];
    let coverage = vec![Coverage::zeroed(); 64];
    let mut sums = vec![[0.0; 4]; 64];
    for _ in 0..ITERATIONS {
        let radii2: Vec<f32> = expected.iter().map(|s: &Statistics| s.radius2_high).collect();
        cpu::gather_naive(&points, &radii2, &photons, &mut gathered);
        cpu::update(
            &points,
            GatheredWith {
                radii2: &radii2,
                coverage: &coverage,
                photons: 1,
                alpha: bench.config.alpha,
            },
            &Counts::default(),
            &mut gathered,
            &mut expected,
            &mut sums,
        );
    }
    for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let m = arriving(slot as u32);
        if m == 0 {
            assert_eq!(found, &before[slot], "slot {slot} without photons has changed");
        }
        assert_eq!(
            accepted(found),
            accepted(&before[slot]) + u64::from(m * ITERATIONS),
            "slot {slot}: accepted"
        );
        let difference = relative_difference(radius2(found), radius2(expected));
        assert!(
            difference < TOLERANCE,
            "slot {slot}, M = {m}: R² off by {difference:e}: {found:?}, {expected:?}"
        );
        let tau = |s: &Statistics| [0, 1, 2, 3].map(|i| f64::from(s.flux_high[i]) + f64::from(s.flux_low[i]));
        for (found, expected) in tau(found).into_iter().zip(tau(expected)) {
            let difference = relative_difference(found, expected);
            assert!(
                difference < TOLERANCE,
                "slot {slot}, M = {m}: τ {found}, {expected} expected"
            );
        }
    }
    // The product of eq. 2 over the iterations, where nothing came before: N = α·i·M.
    let alpha = f64::from(bench.config.alpha);
    let ratio = |i: u32| (alpha * f64::from(i) + alpha) / (alpha * f64::from(i) + 1.0);
    let by_hand = 0.01 * (0..ITERATIONS).map(ratio).product::<f64>();
    let difference = relative_difference(radius2(&found[1]), by_hand);
    assert!(
        difference < TOLERANCE,
        "R² {} after one photon a time, {by_hand} by hand",
        radius2(&found[1])
    );
}

#[test]
fn radii_shrink_where_more_photons_than_wanted_were_found_but_not_below_a_part_of_a_footprint() {
    let mut bench = Bench::new("cornell-spheres", tiny());
    let receivers = bench.renderer.sizes().receivers();
    assert_eq!(receivers, 128, "64 slots, two photon maps");
    let (wanted, least) = ([7.5f32, 20.0], 0.5f32);
    let gathered: Vec<Gathered> = (0..receivers)
        .map(|i| Gathered {
            flux: [1.0, 2.0, 3.0],
            count: i * i,
            moment: 0.5,
            ..Gathered::zeroed()
        })
        .collect();
    let numbers: Vec<[f32; 4]> = random_numbers(receivers).collect();
    let statistics: Vec<Statistics> = numbers.iter().map(|[u, ..]| cpu::reset(0.01 + u)).collect();
    let footprints: Vec<f32> = numbers[..64].iter().map(|[_, v, ..]| 0.1 * v).collect();
    bench.upload(BufferId::GatheredOf, &gathered);
    bench.upload(BufferId::StatisticsOf, &statistics);
    bench.upload(BufferId::Footprints, &footprints);
    let mut recording = Recording::new();
    let push = [wanted[0], wanted[1], least];
    recording.dispatch(StageDesc::new(&shaders::FIT_RADIUS, receivers).push(push));
    bench.renderer.run(&recording).expect("a run");

    let mut expected = statistics.clone();
    cpu::fit_radius(wanted, least, &footprints, &mut gathered.clone(), &mut expected);
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let difference = relative_difference(radius2(found), radius2(expected));
        assert!(
            difference < TOLERANCE,
            "receiver {i}: R² {}, {} on the CPU",
            radius2(found),
            radius2(expected)
        );
        let before = radius2(&statistics[i]);
        let shrunk = before * (f64::from(wanted[i / 64]) / (i * i) as f64).min(1.0);
        let by_hand = shrunk.max(before.min((0.5 * f64::from(footprints[i % 64])).powi(2)));
        let difference = relative_difference(radius2(found), by_hand);
        assert!(
            difference < TOLERANCE,
            "receiver {i}: R² {}, {by_hand} by hand",
            radius2(found)
        );
    }
    for (i, gathered) in bench.download::<Gathered>(BufferId::GatheredOf).iter().enumerate() {
        assert_eq!(*gathered, Gathered::zeroed(), "receiver {i}");
    }
}

#[test]
fn discs_follow_footprints_and_are_counted_in_their_shells() {
    // Radii found automatically have bounds.
    let mut bench = Bench::new("cornell-spheres", small());
    let seen = bench.seen();
    let receivers = bench.renderer.sizes().receivers();
    // Some slots see something for the first time, some have discs that are too large here.
    let statistics: Vec<Statistics> = random_numbers(receivers)
        .map(|[u, v, ..]| cpu::reset(if u < 0.3 { 0.0 } else { 0.1 * v * v }))
        .collect();
    bench.upload(BufferId::StatisticsOf, &statistics);
    let step = bench.renderer.sizes().radius_step();
    let mut recording = Recording::new();
    recording.dispatch(StageDesc::new(&shaders::RADII, receivers));
    recording.fill(BufferId::RadiiOfShells, 0);
    recording.dispatch(StageDesc::new(&shaders::GRID_RADII, receivers).push(step));
    recording.dispatch(StageDesc::new(&shaders::GRID_SETUP, shaders::GRID_SETUP.workgroup));
    bench.renderer.run(&recording).expect("radii");

    let mut expected_statistics = statistics;
    let expected = cpu::radii(&bench.settings, &seen, &mut expected_statistics);
    let found: Vec<f32> = bench.download(BufferId::Radii2);
    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let difference = relative_difference((*found).into(), (*expected).into());
        assert!(difference < 1e-6, "receiver {i}: R² {found}, {expected} on the CPU");
    }
    let set: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    for (i, (found, expected)) in set.iter().zip(&expected_statistics).enumerate() {
        let difference = relative_difference(radius2(found), radius2(expected));
        assert!(difference < 1e-6, "receiver {i}: {found:?}, {expected:?} on the CPU");
    }
    let expected = cpu::shell_radii(&bench.settings, &seen.points, &found, step);
    let found: Vec<ShellRadii> = bench.download(BufferId::RadiiOfShells);
    let grid: Vec<GridShape> = bench.download(BufferId::Grid);
    let shape = cpu::grid_shape(&found);
    let mut shells = 0;
    for (shell, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!(
            (found.count, found.largest),
            (expected.count, expected.largest),
            "shell {shell}"
        );
        // A step of rounding each.
        assert!(
            found.logs.abs_diff(expected.logs) <= found.count,
            "shell {shell}: {found:?}, {expected:?}"
        );
        shells += u32::from(found.count > 0);
        let (found, expected) = (grid[0].inverse_cell_size[shell], shape.inverse_cell_size[shell]);
        let difference = relative_difference(found.into(), expected.into());
        assert!(difference < 1e-5, "shell {shell}: 1/s {found}, {expected} on the CPU");
    }
    assert!(shells >= 2, "one for each photon map at the least: {found:?}");
}

#[test]
fn what_visible_points_want_of_photons_is_what_the_cpu_says() {
    for name in ["cornell-spheres", "glossy", "pool"] {
        let mut bench = Bench::new(name, small());
        for _ in 0..3 {
            bench.renderer.iterate().expect("an iteration");
        }
        // The buffers hold the state after the iteration, the table that before it.
        let (iterations, emitted) = (bench.renderer.iterations(), bench.renderer.emitted());
        let receivers = bench.renderer.sizes().receivers();
        let mut recording = Recording::new();
        recording.fill(BufferId::Demand, 0);
        let push = [iterations, (emitted as f32).to_bits()];
        recording.dispatch(StageDesc::new(&shaders::DEMAND, receivers).push(push));
        bench.renderer.run(&recording).expect("demand");
        let found: Vec<f32> = bench.download(BufferId::Demand);
        let settings: Vec<Settings> = bench.download(BufferId::Settings);
        let (statistics, coverage) = (
            bench.download(BufferId::StatisticsOf),
            bench.download(BufferId::CoverageOf),
        );
        let direct_sums = bench.download(BufferId::DirectSums);
        let progress = cpu::Progress {
            statistics: &statistics,
            coverage: &coverage,
            direct_sums: &direct_sums,
            iterations,
            emitted,
        };
        let (seen, radii2) = (bench.seen(), bench.download::<f32>(BufferId::Radii2));
        let grid = bench.download::<GridShape>(BufferId::Grid)[0];
        let expected = cpu::demand(&settings[0], &seen, &radii2, progress, grid);
        let mut agreement = Agreement::default();
        for (entry, (found, expected)) in found.iter().zip(&expected.entries).enumerate() {
            if *found > 0.0 || *expected > 0.0 {
                let difference = relative_difference((*found).into(), (*expected).into());
                agreement.note(difference < 1e-3, || {
                    format!("entry {entry}: {found} on the device, {expected} on the CPU")
                });
            }
        }
        agreement.assert(&format!("what is wanted in {name}"), 0.999, 90);
    }
}

#[test]
fn updates_clear_what_was_gathered() {
    let mut bench = Bench::new("cornell-spheres", small());
    for (slot, gathered) in bench.download::<Gathered>(BufferId::GatheredOf).iter().enumerate() {
        assert_eq!(*gathered, Gathered::zeroed(), "slot {slot}");
    }
}

#[test]
fn pictures_are_resolved_by_equation_4() {
    for (estimator, resolution) in [(Estimator::Sppm, [37, 21]), (Estimator::Ppm, [19, 8])] {
        let config = RenderConfig {
            estimator,
            resolution,
            ..tiny()
        };
        let mut bench = Bench::new("cornell", config);
        let slots = bench.renderer.sizes().slots();
        let (mut statistics, mut direct_sums, mut coverage) = (Vec::new(), Vec::new(), Vec::new());
        for [a, b, c, d] in random_numbers(slots) {
            // Flux of up to 10⁹ photons, radii from 10⁻⁴ to 0.1.
            let flux = 1e9 * a;
            statistics.push(Statistics {
                flux_high: [flux, flux * b, flux * c, 0.0],
                flux_low: [flux * 1e-8, 0.0, 0.0, 0.0],
                accepted_low: (3.0 * a) as u32,
                ..cpu::reset(10f32.powf(-2.0 - 6.0 * d))
            });
            direct_sums.push(DirectSum {
                high: [d, 1e6 * c, b, if a < 0.7 { 3.0 * b } else { 0.0 }],
                low: [0.0, 1e-2 * a, 0.0, if a < 0.9 { 2.0 } else { 0.0 }],
            });
            // Of some nothing is known yet.
            coverage.push(Coverage {
                covered: (16.0 * b) as u32,
                asked: 16,
                surrounded: u32::from(c < 0.5),
                met: (12.0 * c) as u32,
            });
        }
        bench.upload(BufferId::StatisticsOf, &statistics);
        bench.upload(BufferId::DirectSums, &direct_sums);
        bench.upload(BufferId::CoverageOf, &coverage);
        let iterations = bench.renderer.iterations();
        let totals = Totals {
            iterations,
            emitted: bench.renderer.emitted(),
            camera_paths: iterations * bench.config.camera_paths(),
        };
        let points: Vec<VisiblePoint> = bench.download(BufferId::VisiblePoints);
        let resolved = bench.renderer.resolve_all().expect("a picture");
        let (expected, behind_glass, _) =
            cpu::resolve(&bench.settings, &points, &statistics, &direct_sums, &coverage, totals);
        for (pixel, (found, expected)) in resolved.image.pixels().iter().zip(&expected).enumerate() {
            for channel in 0..3 {
                let difference = relative_difference(found[channel].into(), expected[channel].into());
                assert!(
                    difference < TOLERANCE,
                    "{estimator:?}, pixel {pixel}: {found:?} on the device, {expected:?} on the CPU"
                );
            }
            let (waits, alpha) = (resolved.waits[pixel], f64::from(resolved.alpha[pixel]));
            assert_eq!(waits, expected[3] < 0.0, "{estimator:?}, pixel {pixel}: waits");
            let difference = relative_difference(alpha, expected[3].abs().into());
            assert!(
                difference < TOLERANCE,
                "{estimator:?}, pixel {pixel}: alpha {alpha}, not {}",
                expected[3]
            );
        }
        for (pixel, (found, expected)) in resolved.behind_glass.iter().zip(&behind_glass).enumerate() {
            let values =
                |glass: &BehindGlass| [glass.unbent, glass.arrived, glass.photons, glass.radius, glass.radius2];
            for (found, expected) in values(found).into_iter().zip(values(expected)) {
                let difference = relative_difference(found.into(), expected.into());
                assert!(
                    difference < 4.0 * TOLERANCE,
                    "{estimator:?}, pixel {pixel}: {found} on the device, {expected} on the CPU"
                );
            }
        }
        assert!(behind_glass.iter().filter(|glass| glass.radius > 0.0).count() > 20);
        let sums: Vec<[f32; 4]> = SEQUENCE_SUMS
            .into_iter()
            .flat_map(|sums| bench.download(sums))
            .collect();
        let sequences = cpu::resolve_sequences(&bench.settings, &sums, iterations);
        for (index, (found, expected)) in resolved.sequences.iter().zip(&sequences).enumerate() {
            for (found, expected) in found.iter().zip(expected) {
                let difference = relative_difference((*found).into(), (*expected).into());
                assert!(
                    difference < TOLERANCE,
                    "{estimator:?}, pixel {index} of the sequences: {found} on the device, {expected} on the CPU"
                );
            }
        }
    }
}

/// Each iteration's part of the picture is in the picture of its sequence, whatever has become of R since. What is known of a
/// disc's cover, by which the picture alone is divided anew, changes: of that estimator the picture as a whole is the same.
#[test]
fn the_pictures_of_the_sequences_are_together_the_picture() {
    const ITERATIONS: u32 = 6;
    for (name, estimator) in [
        ("cornell-spheres", Estimator::Sppm),
        ("glossy", Estimator::Sppm),
        ("cornell-spheres", Estimator::Ppm),
    ] {
        let config = RenderConfig { estimator, ..small() };
        let mut bench = Bench::new(name, config.clone());
        let mut on_cpu = cpu::Renderer::new(&bench.scene, &scene(name).cameras[0], config).expect("a renderer");
        let backends: [(&str, &mut dyn Backend); 2] = [("device", &mut bench.renderer), ("CPU", &mut on_cpu)];
        for (backend, renderer) in backends {
            while renderer.iterations() < ITERATIONS {
                renderer.iterate().expect("an iteration");
            }
            let resolved = renderer.resolve_all().expect("a picture");
            let pixels = resolved.image.pixels();
            let mut agreement = Agreement::default();
            let mut sums = [0.0; 2];
            for (pixel, picture) in pixels.iter().enumerate() {
                for (channel, &value) in picture.iter().enumerate() {
                    let of_sequence = |sequence: usize| -> f64 {
                        let iterations = [2.0, 2.0, 1.0, 1.0][sequence];
                        iterations * f64::from(resolved.sequences[sequence * pixels.len() + pixel][channel])
                    };
                    let together = (0..4).map(of_sequence).sum::<f64>() / f64::from(ITERATIONS);
                    sums = [sums[0] + together, sums[1] + f64::from(value)];
                    let difference = relative_difference(together, value.into());
                    agreement.note(difference < 1e-5 || estimator == Estimator::Sppm, || {
                        format!("pixel {pixel}: {together} by the sequences, {value} in the picture")
                    });
                }
            }
            let ratio = sums[0] / sums[1];
            assert!(
                (ratio - 1.0).abs() < 0.01,
                "{name}, {estimator:?}, {backend}: {ratio} of the picture's light"
            );
            agreement.assert(&format!("{name}, {estimator:?}, {backend}"), 1.0, 10_000);
        }
    }
}
