//! The stages `reset`, `update` and `resolve`.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::DVec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{EmissionChoice, Estimator, RenderConfig, Totals, iterations_of, pixel_of};
use ppm_vk::internals::cpu;
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::layout::{
    CELLS_TO_RADIUS, Coverage, DirectSum, Gathered, GridShape, MOST_CELLS, NO_OBJECT, Photon, SHELLS, SMALLEST_CELL,
    Settings, ShellRadii, Statistics, VisiblePoint,
};
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, SEQUENCE_SUMS, StageDesc};

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, Seen, object, photon, random_numbers, small, visible_point, xyz};

/// Relative values of 1e-6: the device stores two f32 of each, 48 bits, but rounds the factors of eq. 2 to f32.
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
    // Slot i lies on object i; this number of photons arrives there in each iteration.
    let arriving = |slot: u32| {
        if slot == 63 {
            0
        } else {
            [0, 1, 2, 3, 7, 30][slot as usize % 6]
        }
    };
    let mut points: Vec<VisiblePoint> = (0..64).map(|slot| visible_point([0.0; 3], slot)).collect();
    points[63].object = NO_OBJECT;
    let mut photons: Vec<Photon> = Vec::new();
    for slot in 0..64 {
        photons.extend((0..arriving(slot)).map(|i| photon([0.0; 3], slot, [1.0, 0.1 + i as f32, 1e-3])));
    }
    let mut statistics = vec![Statistics::of_radius2(0.01); 64];
    for (slot, statistics) in statistics.iter_mut().enumerate() {
        // Previous statistics: none, or so large that one photon changes less than the precision of an f32.
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
                .push(shaders::UpdatePush { photons: 1.0 })
                .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
        );
    }
    for _ in 0..ITERATIONS / 500 {
        bench.renderer.run(&recording).expect("a run");
    }
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);

    let before = statistics.clone();
    let mut expected: Vec<_> = statistics.iter().map(cpu::Statistics::from).collect();
    let radii2 = vec![0.01; 64];
    let seen = Seen {
        points,
        bsdfs: Vec::new(),
    };
    let of_iteration = cpu::gather_naive(&seen.with(&radii2), &photons);
    for (expected, gathered) in expected.iter_mut().zip(&of_iteration) {
        for _ in 0..ITERATIONS {
            expected.take(gathered.count, gathered.flux, bench.config.alpha.into());
        }
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
        let found = cpu::Statistics::from(found);
        let difference = relative_difference(found.radius2, expected.radius2);
        assert!(
            difference < TOLERANCE,
            "slot {slot}, M = {m}: R² off by {difference:e}: {found:?}, {expected:?}"
        );
        for (found, expected) in found.flux.to_array().into_iter().zip(expected.flux.to_array()) {
            let difference = relative_difference(found, expected);
            assert!(
                difference < TOLERANCE,
                "slot {slot}, M = {m}: τ {found}, {expected} expected"
            );
        }
    }
    // The product of eq. 2 over the iterations, without previous statistics: N = α·i·M.
    let alpha = f64::from(bench.config.alpha);
    let ratio = |i: u32| (alpha * f64::from(i) + alpha) / (alpha * f64::from(i) + 1.0);
    let by_hand = 0.01 * (0..ITERATIONS).map(ratio).product::<f64>();
    let difference = relative_difference(radius2(&found[1]), by_hand);
    assert!(
        difference < TOLERANCE,
        "R² {} after one photon per iteration, {by_hand} by hand",
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
    let statistics: Vec<Statistics> = numbers.iter().map(|[u, ..]| Statistics::of_radius2(0.01 + u)).collect();
    let footprints: Vec<f32> = numbers[..64].iter().map(|[_, v, ..]| 0.1 * v).collect();
    bench.upload(BufferId::GatheredOf, &gathered);
    bench.upload(BufferId::StatisticsOf, &statistics);
    bench.upload(BufferId::Footprints, &footprints);
    let mut recording = Recording::new();
    let push = shaders::FitRadiusPush { wanted, least };
    recording.dispatch(StageDesc::new(&shaders::FIT_RADIUS, receivers).push(push));
    bench.renderer.run(&recording).expect("a run");

    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    for (i, found) in found.iter().enumerate() {
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
    // Radii found automatically are bounded.
    let mut bench = Bench::new("cornell-spheres", small());
    let seen = bench.seen();
    let receivers = bench.renderer.sizes().receivers();
    // Some slots see a surface for the first time; a few of the others have discs that are too large here, and determine the
    // cells.
    let statistics: Vec<Statistics> = random_numbers(receivers)
        .map(|[u, v, ..]| match u {
            ..0.1 => 0.0,
            0.98.. => 0.1 * v,
            _ => 1e-8 * v,
        })
        .map(Statistics::of_radius2)
        .collect();
    bench.upload(BufferId::StatisticsOf, &statistics);
    let step = bench.renderer.sizes().radius_step();
    let mut recording = Recording::new();
    recording.dispatch(StageDesc::new(&shaders::RADII, receivers));
    recording.fill(BufferId::RadiiOfShells, 0);
    recording.dispatch(StageDesc::new(&shaders::GRID_RADII, receivers).push(shaders::GridRadiiPush { step }));
    recording.dispatch(StageDesc::new(&shaders::GRID_SETUP, shaders::GRID_SETUP.workgroup));
    bench.renderer.run(&recording).expect("radii");

    let footprints: Vec<f32> = bench.download(BufferId::Footprints);
    let found: Vec<f32> = bench.download(BufferId::Radii2);
    let set: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    let slots = seen.points.len();
    // Of each shell, the logarithms of every step-th R, their number, and the largest R².
    let mut expected = vec![(0.0, 0, 0f32); 2 * SHELLS];
    for i in 0..receivers as usize {
        let (map, slot, before) = (i / slots, i % slots, f64::from(statistics[i].radius2_high));
        let Some(_) = object(seen.points[slot].object) else {
            continue;
        };
        let of_footprints = |count: f32| (f64::from(count) * f64::from(footprints[slot])).powi(2);
        let first = of_footprints(bench.settings.first_footprints[map]);
        let radius2 = if before == 0.0 { first } else { before };
        let disc = radius2.min(of_footprints(bench.settings.most_footprints[map]));
        for (found, expected, what) in [(found[i], disc, "disc"), (set[i].radius2_high, radius2, "R²")] {
            let difference = relative_difference(found.into(), expected);
            assert!(difference < 1e-6, "receiver {i}, {what}: {found}, {expected} expected");
        }
        let distance = xyz(seen.points[slot].position).distance(xyz(bench.settings.camera_position));
        // Shells end at 2^-12, 2^-10, …, 2^2.
        let shell = |distance: f64| {
            ((2.0 * distance.max(1e-30).log2()).floor() as i32 + 28)
                .div_euclid(4)
                .clamp(0, 7) as usize
        };
        let radius = f64::from(found[i]).sqrt();
        for shell in shell(distance - radius)..=shell(distance + radius) {
            let largest = &mut expected[map * SHELLS + shell].2;
            *largest = largest.max(found[i]);
        }
        if i % step as usize == 0 {
            let shell = &mut expected[map * SHELLS + shell(distance)];
            (shell.0, shell.1) = (shell.0 + radius.log2(), shell.1 + 1);
        }
    }
    let shells: Vec<ShellRadii> = bench.download(BufferId::RadiiOfShells);
    let grid: Vec<GridShape> = bench.download(BufferId::Grid);
    for (shell, (found, (logs, count, largest))) in shells.iter().zip(expected).enumerate() {
        assert_eq!(
            (found.count, f32::from_bits(found.largest)),
            (count, largest),
            "shell {shell}"
        );
        let balanced = if count > 0 {
            f64::from(CELLS_TO_RADIUS) * (logs / f64::from(count)).exp2()
        } else {
            0.0
        };
        let bounded = f64::from(largest).sqrt() / f64::from(MOST_CELLS);
        let size = balanced.max(bounded).max(SMALLEST_CELL.into());
        let found = f64::from(grid[0].inverse_cell_size[shell]);
        // Logarithms are counted in parts of 256, each rounded.
        assert!(
            (found * size - 1.0).abs() < 2e-3,
            "shell {shell}: 1/s {found}, s {size} expected"
        );
    }
    let used = shells.iter().filter(|shell| shell.count > 0).count();
    assert!(used >= 2, "one for each photon map at the least: {shells:?}");
}

/// The demand of a cell is that of one of its visible points, and at least that of each of them.
#[test]
fn cells_want_photons_as_the_visible_points_do_that_reach_them() {
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
        let push = shaders::DemandPush {
            iterations,
            emitted: emitted as f32,
            of_guides: 0,
        };
        recording.dispatch(StageDesc::new(&shaders::DEMAND, receivers).push(push));
        bench.renderer.run(&recording).expect("demand");
        let found: Vec<f32> = bench.download(BufferId::Demand);
        let floor2 = f64::from(bench.download::<Settings>(BufferId::Settings)[0].demand_floor2);
        let statistics: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
        let coverage: Vec<Coverage> = bench.download(BufferId::CoverageOf);
        let direct: Vec<DirectSum> = bench.download(BufferId::DirectSums);
        let footprints: Vec<f32> = bench.download(BufferId::Footprints);
        let (seen, radii2) = (bench.seen(), bench.download::<f32>(BufferId::Radii2));
        let mean = |v: glam::DVec3| v.element_sum() / 3.0;
        let slots = seen.points.len();
        let share = |coverage: &Coverage| match coverage.covered {
            0 => 1.0,
            covered => f64::from(covered) / f64::from(coverage.samples),
        };
        let wants = |receiver: usize| {
            let slot = receiver % slots;
            object(seen.points[slot].object)?;
            let by_photons = (slot..statistics.len()).step_by(slots);
            let by_photons =
                by_photons.map(|i| mean(cpu::Statistics::from(&statistics[i]).radiance(share(&coverage[i]), emitted)));
            let radiance = mean(xyz(direct[slot].high)) / f64::from(iterations) + by_photons.sum::<f64>();
            let (area, footprint) = (PI * f64::from(radii2[receiver]), f64::from(footprints[slot]));
            let of_one = mean(xyz(seen.points[slot].weight)) / area;
            Some(of_one * of_one * area / (footprint * footprint) / (radiance * radiance + floor2))
        };
        let mut wanted: Vec<f64> = (0..receivers as usize).filter_map(wants).collect();
        wanted.sort_unstable_by(f64::total_cmp);
        let mut agreement = Agreement::default();
        for &found in found.iter().filter(|&&found| found > 0.0) {
            let at = wanted.partition_point(|&wanted| wanted < f64::from(found) * (1.0 - 1e-4));
            let nearest = wanted.get(at).copied().unwrap_or(f64::INFINITY);
            agreement.note(relative_difference(found.into(), nearest) < 2e-4, || {
                format!("{found} in a cell, the nearest demand is {nearest}")
            });
        }
        agreement.assert(&format!("what is wanted in {name}"), 0.999, 90);
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let (found, wanted) = (
            most(&mut found.iter().map(|&found| found.into())),
            most(&mut wanted.into_iter()),
        );
        assert!(
            relative_difference(found, wanted) < 1e-4,
            "{name}: {found} at the most, {wanted} wanted"
        );
    }
}

/// Dropping unwanted photons removes none from any disc.
#[test]
fn dropping_photons_that_nobody_wants_changes_nothing_that_is_gathered() {
    for name in ["cornell-spheres", "pool", "instances"] {
        let [all, wanted] = [false, true].map(|drop_unwanted| {
            let config = RenderConfig {
                drop_unwanted,
                radius: Some(0.02),
                emission: EmissionChoice::Power,
                ..small()
            };
            let mut bench = Bench::new(name, config);
            bench.renderer.iterate().expect("an iteration");
            (
                bench.download::<Statistics>(BufferId::StatisticsOf),
                bench.renderer.counters().photons_stored,
            )
        });
        assert!(
            wanted.1 < all.1,
            "{name}: {} of {} photons were stored",
            wanted.1,
            all.1
        );
        for (slot, (found, expected)) in wanted.0.iter().zip(&all.0).enumerate() {
            assert_eq!(
                found.accepted(),
                expected.accepted(),
                "{name}, slot {slot}: photons accepted"
            );
        }
    }
}

/// τ belongs to a disc of R, also where a footprint has bounded the disc that was gathered from.
#[test]
fn flux_of_a_smaller_disc_counts_as_that_of_the_whole_one() {
    let mut bench = Bench::new("cornell", tiny());
    let points: Vec<VisiblePoint> = (0..64).map(|slot| visible_point([0.0; 3], slot)).collect();
    let parts = [1.0, 0.5, 0.25, 0.1];
    let radii2: Vec<f32> = (0..64).map(|slot| 0.01 * parts[slot % 4]).collect();
    let arrived = Gathered {
        flux: [1.0, 2.0, 3.0],
        count: 4,
        ..Gathered::zeroed()
    };
    bench.upload(BufferId::VisiblePoints, &points);
    bench.upload(BufferId::Radii2, &radii2);
    bench.upload(BufferId::StatisticsOf, &[Statistics::of_radius2(0.01); 64]);
    bench.upload(BufferId::GatheredOf, &[arrived; 64]);
    let mut recording = Recording::new();
    recording.dispatch(
        StageDesc::new(&shaders::UPDATE, 64)
            .push(shaders::UpdatePush { photons: 1.0 })
            .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
    );
    bench.renderer.run(&recording).expect("a run");
    for (slot, found) in bench.download::<Statistics>(BufferId::StatisticsOf).iter().enumerate() {
        let mut expected = cpu::Statistics::from(&Statistics::of_radius2(0.01));
        let flux = DVec3::new(1.0, 2.0, 3.0) / f64::from(parts[slot % 4]);
        expected.take(4, flux, bench.config.alpha.into());
        let found = cpu::Statistics::from(found);
        let same = found.flux.distance(expected.flux) < TOLERANCE * expected.flux.length()
            && relative_difference(found.radius2, expected.radius2) < TOLERANCE;
        assert!(same, "slot {slot}: {found:?} instead of {expected:?}");
    }
}

#[test]
fn updates_clear_the_gathered_sums() {
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
                ..Statistics::of_radius2(10f32.powf(-2.0 - 6.0 * d))
            });
            direct_sums.push(DirectSum {
                high: [d, 1e6 * c, b, if a < 0.7 { 3.0 * b } else { 0.0 }],
                low: [0.0, 1e-2 * a, 0.0, if a < 0.9 { 2.0 } else { 0.0 }],
            });
            // Some have no coverage yet.
            coverage.push(Coverage {
                covered: (16.0 * b) as u32,
                samples: 16,
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
        let slots_per_pixel = bench.settings.slots_per_pixel as usize;
        let [width, _] = resolution.map(|side| side as usize);
        let mut behind = 0;
        for (pixel_slot, first) in (0..).zip((0..slots as usize).step_by(slots_per_pixel)) {
            let Some([x, y]) = pixel_of(resolution, pixel_slot) else {
                continue;
            };
            let pixel = y as usize * width + x as usize;
            let of_pixel = first..first + slots_per_pixel;
            let what = format!("{estimator:?}, pixel {x}, {y}");
            let assert_within = |tolerance: f64, found: f64, expected: f64, what: String| {
                let difference = relative_difference(found, expected);
                assert!(
                    difference < tolerance,
                    "{what}: {found} on the device, {expected} expected"
                );
            };
            let assert_near = |found, expected, what| assert_within(TOLERANCE, found, expected, what);
            let assert_glass = |found, expected, what| assert_within(4.0 * TOLERANCE, found, expected, what);
            let mut radiance = DVec3::ZERO;
            let (mut met, mut unbent, mut arrived) = (0, 0.0, 0.0);
            for slot in of_pixel.clone() {
                let (direct, known) = (&direct_sums[slot], &coverage[slot]);
                let share = if known.covered > 0 {
                    f64::from(known.covered) / f64::from(known.samples)
                } else {
                    1.0
                };
                let by_photons = cpu::Statistics::from(&statistics[slot]).radiance(share, totals.emitted);
                radiance += (xyz(direct.high) + xyz(direct.low)) / f64::from(iterations) + by_photons;
                met = met.max(known.met);
                arrived += by_photons.element_sum() / 3.0;
                if direct.low[3] > 0.0 {
                    unbent += f64::from(direct.high[3]) / f64::from(direct.low[3]);
                }
            }
            for (found, expected) in resolved.image.pixels()[pixel].iter().zip(radiance.to_array()) {
                assert_near((*found).into(), expected, what.clone());
            }
            let alpha = f64::from(met) / f64::from(totals.camera_paths);
            assert_near(resolved.alpha[pixel].into(), alpha, format!("{what}, alpha"));
            let has_photons = of_pixel.clone().any(|slot| statistics[slot].accepted() > 0);
            let surrounded = of_pixel.clone().any(|slot| coverage[slot].surrounded > 0);
            assert_eq!(
                resolved.waits[pixel],
                surrounded && !has_photons && alpha > 0.0,
                "{what}: waits"
            );
            let glass = &resolved.behind_glass[pixel];
            assert_glass(glass.unbent.into(), unbent, format!("{what}, unbent"));
            assert_glass(glass.arrived.into(), arrived, format!("{what}, arrived"));
            let shows = |slot: &usize| direct_sums[*slot].high[3] > 0.0 && direct_sums[*slot].low[3] > 0.0;
            let shows: Vec<usize> = of_pixel
                .filter(shows)
                .filter(|&slot| object(points[slot].object).is_some())
                .collect();
            let most = |value: &dyn Fn(usize) -> f64| shows.iter().map(|&slot| value(slot)).fold(0.0, f64::max);
            let width = |slot: usize| {
                let distance = xyz(points[slot].position).distance(xyz(bench.settings.camera_position));
                f64::from(bench.settings.pixel_spread) * distance
            };
            assert_glass(
                glass.radius2.into(),
                most(&|slot| radius2(&statistics[slot])),
                format!("{what}, R²"),
            );
            let radius = most(&|slot| radius2(&statistics[slot]).sqrt() / width(slot));
            assert_glass(glass.radius.into(), radius, format!("{what}, R"));
            let photons = most(&|slot| statistics[slot].accepted() as f64);
            assert_glass(glass.photons.into(), photons, format!("{what}, photons"));
            behind += usize::from(!shows.is_empty());
        }
        assert!(behind > 20, "{behind} pixels with light behind glass");
        let sums = SEQUENCE_SUMS.map(|sums| bench.download::<[f32; 4]>(sums));
        for (sequence, sums) in (0..).zip(&sums) {
            let iterations = f64::from(iterations_of(sequence, iterations).max(1));
            for (pixel_slot, slots) in (0..).zip(sums.chunks(slots_per_pixel)) {
                let Some([x, y]) = pixel_of(resolution, pixel_slot) else {
                    continue;
                };
                let pixel = (sequence * resolution[1] + y) as usize * width + x as usize;
                for channel in 0..4 {
                    let sum: f64 = slots.iter().map(|sum| f64::from(sum[channel])).sum();
                    let (found, expected) = (resolved.sequences[pixel][channel].into(), sum / iterations);
                    let difference = relative_difference(found, expected);
                    assert!(
                        difference < TOLERANCE,
                        "{estimator:?}, sequence {sequence}, pixel {x}, {y}: {found} on the device, {expected} expected"
                    );
                }
            }
        }
    }
}

/// The radiance of each iteration is in the picture of its sequence, whatever R is later. Coverage, by which only the whole
/// picture is divided anew, changes: for that estimator the whole picture is unchanged.
#[test]
fn the_pictures_of_the_sequences_are_together_the_picture() {
    const ITERATIONS: u32 = 6;
    for (name, estimator) in [
        ("cornell-spheres", Estimator::Sppm),
        ("glossy", Estimator::Sppm),
        ("cornell-spheres", Estimator::Ppm),
    ] {
        let config = RenderConfig { estimator, ..small() };
        let mut bench = Bench::new(name, config);
        let mut on_cpu = bench.plain();
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
