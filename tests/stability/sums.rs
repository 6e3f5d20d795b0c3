//! Equations 2 and 3 over very many iterations and photons, and at the limits of α.

use bytemuck::Zeroable;
use ppm_vk::internals::config::{RenderConfig, Totals};
use ppm_vk::internals::film::Image;
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::layout::{Coverage, DirectSum, Gathered, Photon, Statistics, VisiblePoint};
use ppm_vk::internals::packing::SceneFeatures;
use ppm_vk::internals::pipeline::Stages;
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, StageDesc};

use super::bench::{Bench, photon, visible_point, xyz};
use super::sound::assert_sound;

const SLOTS: u32 = 64;
const RADIUS2: f32 = 0.01;
/// The weight of a visible point of albedo π: flux is τ.
const FLUX: [f32; 3] = [1.0, 0.1, 1e-6];

fn bench(alpha: f32) -> Bench {
    let config = RenderConfig {
        resolution: [8, 8],
        photons: 64,
        radius: Some(0.1),
        alpha,
        ..RenderConfig::default()
    };
    let mut bench = Bench::new("cornell", config);
    let points: Vec<VisiblePoint> = (0..SLOTS).map(|slot| visible_point([0.0; 3], slot)).collect();
    bench.upload(BufferId::VisiblePoints, &points);
    bench.upload(
        BufferId::StatisticsOf,
        &[Statistics::of_radius2(RADIUS2); SLOTS as usize],
    );
    bench.upload(BufferId::GatheredOf, &[Gathered::zeroed(); SLOTS as usize]);
    bench
}

/// R², τ of the first channel, and N/α by equations 2 and 3 in f64.
#[derive(Debug, Clone, Copy)]
struct Exact {
    radius2: f64,
    tau: f64,
    accepted: f64,
}

impl Exact {
    const START: Self = Self {
        radius2: RADIUS2 as f64,
        tau: 0.0,
        accepted: 0.0,
    };

    fn add(&mut self, photons: f64, alpha: f64) {
        if photons > 0.0 {
            let n = alpha * self.accepted;
            let ratio = (n + alpha * photons) / (n + photons);
            // If R² does not shrink, τ grows as with a constant radius.
            let ratio = if self.radius2 * ratio < 1e-24 { 1.0 } else { ratio };
            self.radius2 *= ratio;
            self.tau = (self.tau + photons) * ratio;
            self.accepted += photons;
        }
    }

    /// Checks R², τ of every channel, and their quotient, which is the radiance of eq. 4.
    fn assert(&self, found: &Statistics, tolerance: f64, what: &str) {
        let radius2 = f64::from(found.radius2_high) + f64::from(found.radius2_low);
        let tau = xyz(found.flux_high) + xyz(found.flux_low);
        let accepted = f64::from(found.accepted_high) * 4_294_967_296.0 + f64::from(found.accepted_low);
        assert_eq!(accepted, self.accepted, "{what}: photons accepted");
        let off = |found: f64, expected: f64| {
            if expected == 0.0 {
                found.abs()
            } else {
                (found / expected - 1.0).abs()
            }
        };
        let channels = [0, 1, 2].map(|i| off(tau.to_array()[i], self.tau * f64::from(FLUX[i])));
        let quotients = [0, 1, 2].map(|i| {
            off(
                tau.to_array()[i] / radius2,
                self.tau * f64::from(FLUX[i]) / self.radius2,
            )
        });
        let worst = channels
            .into_iter()
            .chain(quotients)
            .chain([off(radius2, self.radius2)])
            .fold(0.0, f64::max);
        println!("{what}: R², τ and τ/R² off by {worst:.1e} at the most");
        assert!(
            worst < tolerance,
            "{what}: off by {worst:e}: {found:?} on the device, {self:?} exactly"
        );
    }
}

/// This number of iterations; the photons all lie at the visible points, on the slot's object, so that M is given for each slot.
fn iterate(bench: &mut Bench, iterations: u32, arriving: impl Fn(u32) -> u32) {
    let mut photons: Vec<Photon> = Vec::new();
    for slot in 0..SLOTS {
        photons.extend((0..arriving(slot)).map(|_| photon([0.0; 3], slot, FLUX)));
    }
    bench.upload(BufferId::Photons, &photons);
    bench.upload(BufferId::PhotonCount, &[photons.len() as u32]);
    let (_, naive) = METHODS[0].stages().expect("a method of devices");
    let at_once = iterations.min(1000);
    let mut recording = Recording::new();
    for _ in 0..at_once {
        naive(bench.renderer.sizes(), &mut recording);
        recording.dispatch(StageDesc::new(&shaders::RADII, SLOTS));
        recording.dispatch(
            StageDesc::new(&shaders::UPDATE, SLOTS)
                .push(shaders::UpdatePush { photons: 1.0 })
                .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
        );
    }
    for _ in 0..iterations / at_once {
        bench.renderer.run(&recording).expect("a run");
    }
}

fn assert_iterations_follow_equations_2_and_3(iterations: u32) {
    let mut bench = bench(2.0 / 3.0);
    let arriving = |slot: u32| if slot < 4 { [0, 1, 2, 7][slot as usize] } else { 0 };
    iterate(&mut bench, iterations, arriving);
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    for slot in 0..4 {
        let mut exact = Exact::START;
        for _ in 0..iterations {
            exact.add(arriving(slot).into(), bench.config.alpha.into());
        }
        let what = format!("{} photons in each of {iterations} iterations", arriving(slot));
        exact.assert(&found[slot as usize], 1e-6, &what);
    }
    assert_sound(&mut bench.renderer);
}

#[test]
fn radius_and_flux_follow_equations_2_and_3_over_twenty_thousand_iterations() {
    assert_iterations_follow_equations_2_and_3(20_000);
}

#[test]
#[ignore = "takes minutes: scripts/test --long"]
fn radius_and_flux_follow_equations_2_and_3_over_a_million_iterations() {
    assert_iterations_follow_equations_2_and_3(1_000_000);
}

/// Half a million photons per slot, more than a test can gather, are written directly to the gather's result.
#[test]
fn a_billion_photons_in_one_visible_point_and_one_more_are_all_counted() {
    const ITERATIONS: u32 = 2000;
    const EACH: u32 = 500_000;
    let mut bench = bench(2.0 / 3.0);
    let gathered = Gathered {
        flux: FLUX.map(|flux| flux * EACH as f32),
        count: EACH,
        ..Gathered::zeroed()
    };
    let mut update = Recording::new();
    update.dispatch(StageDesc::new(&shaders::RADII, SLOTS));
    update.dispatch(
        StageDesc::new(&shaders::UPDATE, SLOTS)
            .push(shaders::UpdatePush { photons: 1.0 })
            .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
    );
    let mut exact = Exact::START;
    for _ in 0..ITERATIONS {
        bench.upload(BufferId::GatheredOf, &[gathered]);
        bench.renderer.run(&update).expect("a run");
        exact.add(EACH.into(), bench.config.alpha.into());
    }
    let at_a_billion: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    exact.assert(&at_a_billion[0], 1e-6, "10⁹ photons");
    let before = exact;

    // From here on a photon changes R² by 5e-10 of its value: less than the last bit of an f32. It still counts.
    let slowly = 2000;
    iterate(&mut bench, slowly, |slot| u32::from(slot == 0));
    (0..slowly).for_each(|_| exact.add(1.0, bench.config.alpha.into()));
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    exact.assert(&found[0], 1e-6, "10⁹ photons and two thousand, one per iteration");
    let radius2 = |s: &Statistics| f64::from(s.radius2_high) + f64::from(s.radius2_low);
    let shrunk = 1.0 - radius2(&found[0]) / radius2(&at_a_billion[0]);
    let expected = 1.0 - exact.radius2 / before.radius2;
    assert!(
        (shrunk / expected - 1.0).abs() < 1e-3,
        "the last photons shrink R² by {shrunk:e} of it, {expected:e} expected"
    );
    assert_sound(&mut bench.renderer);
}

/// A render passes 2³² photons after a day. τ is that of such a render for radiance 1.
#[test]
fn pictures_stay_right_when_more_than_two_to_the_32_photons_were_emitted() {
    let mut bench = bench(2.0 / 3.0);
    for emitted in [(1u64 << 32) - 1, 1 << 32, (1 << 32) + 1, 1 << 33, 1 << 45] {
        let iterations = u32::MAX;
        let tau = std::f64::consts::PI * f64::from(RADIUS2) * emitted as f64;
        let mut statistics = Statistics::of_radius2(RADIUS2);
        statistics.flux_high = [tau as f32; 4];
        let sum = DirectSum {
            high: [iterations as f32; 4],
            low: [0.0; 4],
        };
        bench.upload(BufferId::StatisticsOf, &[statistics; SLOTS as usize]);
        bench.upload(BufferId::DirectSums, &[sum; SLOTS as usize]);
        bench.upload(BufferId::CoverageOf, &[Coverage::zeroed(); SLOTS as usize]);
        let stages = Stages {
            config: &bench.config,
            sizes: bench.renderer.sizes(),
            features: SceneFeatures::ALL,
        };
        let recording = stages.picture(Totals {
            iterations,
            emitted,
            camera_paths: iterations,
        });
        bench.renderer.run(&recording).expect("a run");
        let film: Vec<[f32; 4]> = bench.download(BufferId::Film);
        for pixel in Image::from_film([8, 8], &film).pixels() {
            for value in pixel {
                assert!(
                    (value - 2.0).abs() < 1e-6,
                    "{value} instead of 1 + 1 after {emitted} photons"
                );
            }
        }
    }
}

#[test]
fn a_visible_point_that_no_photon_ever_reaches_keeps_its_radius_and_stays_dark() {
    let mut bench = bench(2.0 / 3.0);
    iterate(&mut bench, 1000, |_| 0);
    bench.upload(
        BufferId::DirectSums,
        &[DirectSum {
            high: [0.0; 4],
            low: [0.0; 4],
        }; SLOTS as usize],
    );
    let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
    assert!(
        found.iter().all(|s| *s == Statistics::of_radius2(RADIUS2)),
        "{:?}",
        found[0]
    );
    let image = assert_sound(&mut bench.renderer);
    assert!(image.pixels().iter().all(|pixel| *pixel == [0.0; 3]));
}

#[test]
fn one_photon_for_ever_and_alpha_next_to_0_and_1_leave_a_radius_and_the_right_flux_over_it() {
    for alpha in [1e-6, 0.5, 1.0 - 1e-6] {
        let mut bench = bench(alpha);
        // Slot 0: one photon per iteration; 1: seven; 2: only the first.
        iterate(&mut bench, 1, |slot| [1, 7, 1][slot as usize % 3]);
        let rest = 2000;
        iterate(&mut bench, rest, |slot| [1, 7, 0][slot as usize % 3]);
        let found: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
        for (slot, later) in [1.0, 7.0, 0.0].into_iter().enumerate() {
            let mut exact = Exact::START;
            exact.add(if slot == 1 { 7.0 } else { 1.0 }, alpha.into());
            (0..rest).for_each(|_| exact.add(later, alpha.into()));
            exact.assert(
                &found[slot],
                1e-6,
                &format!("α = {alpha}, then {later} photons per iteration"),
            );
        }
        assert_sound(&mut bench.renderer);
    }
}
