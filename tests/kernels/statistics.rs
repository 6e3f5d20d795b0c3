//! The stages `reset`, `update` and `resolve`.

use bytemuck::Zeroable;
use ppm_vk::backend::Backend;
use ppm_vk::config::{Estimator, RADIUS_GROUPS, RenderConfig};
use ppm_vk::cpu::{self, Counts};
use ppm_vk::gather::METHODS;
use ppm_vk::layout::{Coverage, DirectSum, Gathered, NO_OBJECT, Photon, RadiusSum, Statistics, VisiblePoint};
use ppm_vk::record::Recording;
use ppm_vk::shaders;
use ppm_vk::stage::{BufferId, StageDesc};

use super::agreement::relative_difference;
use super::bench::{Bench, photon, random_numbers, small, visible_point};

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
        naive(bench.renderer.sizes(), &mut recording);
        recording.dispatch(StageDesc::new(&shaders::UPDATE, 64));
    }
    for _ in 0..ITERATIONS / 500 {
        bench.renderer.run(&recording).expect("a run");
    }
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);

    let before = statistics.clone();
    let mut expected = statistics;
    let mut gathered = vec![Gathered::zeroed(); 64];
    for _ in 0..ITERATIONS {
        cpu::gather_naive(&points, &before, &photons, &mut gathered);
        cpu::update(
            &points,
            bench.config.alpha,
            &Counts::default(),
            &mut gathered,
            &mut expected,
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
fn radii_shrink_where_more_photons_than_wanted_were_found() {
    let mut bench = Bench::new("cornell", tiny());
    let wanted = 7.5f32;
    let gathered: Vec<Gathered> = (0..64)
        .map(|slot| Gathered {
            flux_count: [1.0, 2.0, 3.0, f32::from_bits(slot * slot)],
            moment: 0.5,
            ..Gathered::zeroed()
        })
        .collect();
    let statistics: Vec<Statistics> = random_numbers(64).map(|[u, ..]| cpu::reset(0.01 + u)).collect();
    bench.upload(BufferId::VisiblePoints, &[visible_point([0.0; 3], 0); 64]);
    bench.upload(BufferId::GatheredOf, &gathered);
    bench.upload(BufferId::StatisticsOf, &statistics);
    let mut recording = Recording::new();
    recording.dispatch(StageDesc::new(&shaders::FIT_RADIUS, 64).push(wanted));
    bench.renderer.run(&recording).expect("a run");

    let mut expected = statistics.clone();
    cpu::fit_radius(wanted, &mut gathered.clone(), &mut expected);
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let difference = relative_difference(radius2(found), radius2(expected));
        assert!(
            difference < TOLERANCE,
            "slot {slot}: R² {}, {} on the CPU",
            radius2(found),
            radius2(expected)
        );
        let by_hand = f64::from(statistics[slot].radius2_high) * (7.5 / (slot * slot) as f64).min(1.0);
        let difference = relative_difference(radius2(found), by_hand);
        assert!(
            difference < TOLERANCE,
            "slot {slot}: R² {}, {by_hand} by hand",
            radius2(found)
        );
    }
    for (slot, gathered) in bench.download::<Gathered>(BufferId::GatheredOf).iter().enumerate() {
        assert_eq!(*gathered, Gathered::zeroed(), "slot {slot}");
    }
}

#[test]
fn radii_are_summed_up_and_updates_clear_what_was_gathered() {
    let mut bench = Bench::new("cornell-spheres", small());
    let points: Vec<VisiblePoint> = bench.download(BufferId::VisiblePoints);
    let statistics: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    let mut recording = Recording::new();
    let threads = RADIUS_GROUPS * shaders::GRID_RADII.workgroup;
    recording.dispatch(StageDesc::new(&shaders::GRID_RADII, threads).push([RADIUS_GROUPS, 3]));
    bench.renderer.run(&recording).expect("radii");
    let found: Vec<RadiusSum> = bench.download(BufferId::RadiusSums);
    let size = shaders::GRID_RADII.workgroup as usize;
    let expected = cpu::radius_sums(&points, &statistics, [RADIUS_GROUPS as usize, size, 3]);
    assert_eq!(found.len(), expected.len());
    for (group, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!(found.count, expected.count, "group {group}");
        for (what, found, expected) in [
            ("ΣR²", found.radius2, expected.radius2),
            ("Σ1/R²", found.inverse2, expected.inverse2),
        ] {
            let difference = relative_difference(found.into(), expected.into());
            assert!(
                difference < 1e-6,
                "group {group}: {what} {found} on the device, {expected} on the CPU"
            );
        }
    }
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
                ..cpu::reset(10f32.powf(-2.0 - 6.0 * d))
            });
            direct_sums.push(DirectSum {
                high: [d, 1e6 * c, b, 0.0],
                low: [0.0, 1e-2 * a, 0.0, 0.0],
            });
            // Of some nothing is known yet.
            coverage.push(Coverage {
                covered: (16.0 * b) as u32,
                asked: 16,
            });
        }
        bench.upload(BufferId::StatisticsOf, &statistics);
        bench.upload(BufferId::DirectSums, &direct_sums);
        bench.upload(BufferId::CoverageOf, &coverage);
        let (iterations, emitted) = (bench.renderer.iterations(), bench.renderer.emitted());
        let image = bench.renderer.resolve().expect("a picture");
        let expected = cpu::resolve(
            &bench.settings,
            &statistics,
            &direct_sums,
            &coverage,
            iterations,
            emitted,
        );
        for (pixel, (found, expected)) in image.pixels().iter().zip(&expected).enumerate() {
            for channel in 0..3 {
                let difference = relative_difference(found[channel].into(), expected[channel].into());
                assert!(
                    difference < TOLERANCE,
                    "{estimator:?}, pixel {pixel}: {found:?} on the device, {expected:?} on the CPU"
                );
            }
        }
    }
}
