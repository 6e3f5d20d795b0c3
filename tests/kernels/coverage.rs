//! The stage `coverage`.

use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::cpu;
use ppm_vk::internals::layout::{COVERAGE_WHOLE, Coverage, Statistics, VisiblePoint};
use ppm_vk::internals::random::Random;
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, StageDesc};

use super::agreement::Agreement;
use super::bench::{Bench, object, reach_of, small, visible_point, xyz};

/// Results of the stage's first iteration for visible points with these radii.
fn on_device(bench: &mut Bench, points: &[VisiblePoint], radii2: &[f32], statistics: &[Statistics]) -> Vec<Coverage> {
    bench.upload(BufferId::VisiblePoints, points);
    bench.upload(BufferId::Radii2, radii2);
    bench.upload(BufferId::StatisticsOf, statistics);
    let mut recording = Recording::new();
    recording.fill(BufferId::Status, 0);
    recording.fill(BufferId::CoverageOf, 0);
    let features = bench.scene.features.constants();
    let features = features.map(|(name, present)| (name, u32::from(present)));
    let constants: Vec<_> = [("SAMPLER", bench.config.sampler as u32)]
        .into_iter()
        .chain(features)
        .collect();
    let push = shaders::CoveragePush {
        iteration: 0,
        points: bench.config.coverage_points(0),
    };
    recording.dispatch(
        StageDesc::new(&shaders::COVERAGE, radii2.len() as u32)
            .constants(constants)
            .push(push),
    );
    bench.renderer.run(&recording).expect("coverage");
    bench.download(BufferId::CoverageOf)
}

#[test]
fn coverage_of_the_device_is_that_of_the_cpu() {
    for name in ["cornell", "cornell-spheres", "pool", "instances"] {
        let config = RenderConfig {
            radius: Some(0.1),
            ..small()
        };
        let mut bench = Bench::new(name, config);
        let points: Vec<VisiblePoint> = bench.download(BufferId::VisiblePoints);
        let mut statistics: Vec<Statistics> = bench.download(BufferId::StatisticsOf);
        let radii2: Vec<f32> = bench.download(BufferId::Radii2);
        // Points without photons look around.
        for statistics in statistics.iter_mut().step_by(2) {
            (statistics.accepted_low, statistics.accepted_high) = (0, 0);
        }
        let found = on_device(&mut bench, &points, &radii2, &statistics);
        let inputs = bench.inputs();
        let mut agreement = Agreement::default();
        let (mut surrounded, mut partly) = (0, 0);
        for (receiver, found) in found.iter().enumerate() {
            let slot = receiver % points.len();
            let Some(object) = object(points[slot].object) else {
                continue;
            };
            let normal = cpu::decode_direction(points[slot].geometric_normal);
            let reach = reach_of(&bench.scene, object);
            let place = cpu::Place {
                origin: cpu::offset_origin(xyz(points[slot].position), normal, reach),
                normal,
                object,
            };
            let random = Random::of_disc(&bench.config, slot as u32, 0, COVERAGE_WHOLE);
            let has_photons = statistics[receiver].accepted() > 0;
            assert_eq!(
                found.samples,
                if has_photons { COVERAGE_WHOLE } else { 0 },
                "{name}, {receiver}"
            );
            let covered = (0..found.samples).filter(|&number| {
                let [u, v, ..] = random.sample_of(number, COVERAGE_WHOLE).next4();
                cpu::can_have_photons(&inputs, place, f64::from(radii2[receiver]).sqrt(), [u, v])
            });
            let covered = covered.count() as u32;
            agreement.note(found.covered == covered, || {
                format!("receiver {receiver}: {found:?} on the device, {covered} covered on the CPU")
            });
            if found.surrounded > 0 || (receiver < points.len() && !has_photons) {
                let mut behind = random;
                behind.skip_to(COVERAGE_WHOLE);
                let [u, v, ..] = behind.next4();
                let is_surrounded = cpu::is_surrounded(&inputs, place, [u, v]);
                // A caustic photon shows that the point is surrounded.
                let samples_surroundings =
                    receiver + points.len() >= statistics.len() || statistics[receiver + points.len()].accepted() == 0;
                agreement.note(!samples_surroundings || (found.surrounded > 0) == is_surrounded, || {
                    format!("receiver {receiver}: {found:?} on the device, surrounded on the CPU: {is_surrounded}")
                });
            }
            surrounded += u32::from(found.surrounded > 0);
            partly += u32::from(found.covered < found.samples);
        }
        // For a point next to an edge, rounding decides on which side it lies.
        agreement.assert(&format!("coverage in {name}"), 0.99, 2000);
        assert!(surrounded > 500, "{name}: only {surrounded} points are surrounded");
        assert!(partly > 20, "{name}: only {partly} discs reach past an edge");
    }
}

/// Each of 1,024 discs takes 16 samples. The mean of the covered fractions differs by six standard deviations of independent
/// samples with a probability of 2·10⁻⁹.
#[test]
fn discs_that_reach_past_a_wall_are_covered_by_their_part_before_it() {
    let config = RenderConfig {
        resolution: [32, 32],
        ..small()
    };
    let mut bench = Bench::new("furnace-closed", config);
    // The floor of the room: its lowest triangles, seen from above.
    let (scene, radius) = (&bench.scene, 0.2);
    let corners = |t: &ppm_vk::internals::layout::ShadingTriangle| [t.p0, t.p1, t.p2];
    let low = scene
        .shading_triangles
        .iter()
        .flat_map(corners)
        .fold([f32::MAX; 3], |low, corner| {
            [0, 1, 2].map(|axis: usize| low[axis].min(corner[axis]))
        });
    let floor = scene
        .shading_triangles
        .iter()
        .find(|t| corners(t).iter().all(|corner| corner[2] == low[2]))
        .expect("a wall at the lowest z");
    let object = floor.object;
    for distance in [0.0, 0.3, 0.8, 1.2] {
        let point = visible_point([low[0] + distance * radius, 0.0, low[2]], object);
        let count = bench.renderer.sizes().slots() as usize;
        // As many discs as can have had photons.
        let lit = Statistics {
            accepted_low: 1,
            ..Statistics::of_radius2(radius * radius)
        };
        let (points, radii2) = (vec![point; count], vec![radius * radius; count]);
        let found = on_device(&mut bench, &points, &radii2, &vec![lit; count]);
        let covered: u32 = found.iter().map(|coverage| coverage.covered).sum();
        let share = f64::from(covered) / (16 * count) as f64;
        // A segment of the disc lies beyond the wall.
        let x = f64::from(distance).min(1.0);
        let expected = 1.0 - (x.acos() - x * (1.0 - x * x).sqrt()) / std::f64::consts::PI;
        let deviation = (expected * (1.0 - expected) / (16 * count) as f64).sqrt();
        assert!(
            (share - expected).abs() <= 6.0 * deviation + 1e-9,
            "{distance} R from the wall: {share} of the disc is covered, {expected} expected"
        );
    }
}
