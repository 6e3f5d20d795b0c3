//! What a driver's limits must not do to a picture. Mesa's llvmpipe, for years, has ended all loops of an invocation
//! together after 65,535 iterations, without a word; the gathers have a test of that too.

use glam::DVec3;
use ppm_vk::backend::Backend;
use ppm_vk::config::{Accel, Direct, EmissionChoice, RenderConfig};
use ppm_vk::cpu::{self, Batch, CameraTurn, Counts};
use ppm_vk::gpu::Device;
use ppm_vk::layout::{DirectSum, Statistics, VisiblePoint};
use ppm_vk::pipeline::Renderer;
use ppm_vk::record::Recording;
use ppm_vk::shaders;
use ppm_vk::stage::{BufferId, StageDesc};

use super::agreement::relative_difference;
use super::bench::{Bench, small, xyz};

#[test]
fn no_photon_is_lost_where_a_lane_follows_many_paths() {
    let config = RenderConfig {
        resolution: [8, 8],
        photons: 400_000,
        radius: Some(0.01),
        ..small()
    };
    let bench = Bench::new("pool", config);
    let batch = Batch {
        iteration: 0,
        first_path: 0,
        paths: bench.config.photons,
    };
    let expected = cpu::photons(&bench.inputs(), batch, &Counts::default())
        .lanes
        .iter()
        .map(Vec::len)
        .sum::<usize>();
    let counters = bench.renderer.counters();
    println!("{expected} photons on the CPU, on the device {counters:?}");
    assert_eq!(counters.cut_paths, 0, "paths that were cut short");
    let difference = relative_difference(counters.photons_stored as f64, expected as f64);
    assert!(
        difference < 1e-3,
        "{expected} photons on the CPU, on the device {counters:?}"
    );
}

#[test]
fn an_iteration_that_is_done_again_counts_once() {
    // Rays that test 4,000 triangles take more iterations of loops than some drivers give to two paths of a lane: there
    // the iteration is done again, one path a lane. What is seen directly is summed up whatever the photons do.
    let config = RenderConfig {
        // Eight camera paths a pixel.
        resolution: [16, 16],
        photons: 4200,
        accel: Accel::Brute,
        direct: Direct::Photons,
        radius: Some(0.01),
        ..small()
    };
    let mut bench = Bench::new("cornell-spheres", config);
    let sums: Vec<DirectSum> = bench.download(BufferId::DirectSums);
    let repeated = bench.renderer.counters().repeated_iterations;
    let mut expected = vec![DVec3::ZERO; sums.len()];
    let first = CameraTurn::that_gathers(&bench.config, 0);
    for turn in std::iter::once(first).chain(first.others()) {
        let mut recording = Recording::new();
        let constants = vec![("BRUTE_FORCE", 1), ("MIRRORS", 1), ("DIELECTRICS", 1)];
        let camera = StageDesc::new(&shaders::CAMERA, bench.renderer.sizes().pixel_slots);
        recording.dispatch(camera.constants(constants).push(turn.words()));
        bench.renderer.run(&recording).expect("a camera stage");
        for (sum, point) in expected
            .iter_mut()
            .zip(bench.download::<VisiblePoint>(BufferId::VisiblePoints))
        {
            *sum += xyz(point.emitted_normal) / f64::from(turn.paths);
        }
    }
    for (slot, (sum, seen)) in sums.iter().zip(expected).enumerate() {
        let summed = xyz(sum.high) + xyz(sum.low);
        assert!(
            summed.distance(seen) <= 1e-6 * seen.length(),
            "slot {slot} after one iteration, done again {repeated} times: sum {summed}, radiance seen {seen}"
        );
    }
}

#[test]
fn an_iteration_in_batches_gathers_what_one_batch_gathers() {
    let config = RenderConfig {
        resolution: [32, 32],
        photons: 60_000,
        radius: Some(0.1),
        // What is learned depends on the batches.
        emission: EmissionChoice::Power,
        ..small()
    };
    let loaded = super::bench::scene("cornell-spheres");
    let scene = super::bench::packed(&loaded);
    let render = |buffer_bytes: u64| {
        let device = Device::open(None).expect("a device");
        let camera = &loaded.cameras[0];
        let mut renderer = Renderer::within(buffer_bytes, device, &scene, camera, config.clone()).expect("a renderer");
        for _ in 0..2 {
            renderer.iterate().expect("an iteration");
        }
        let statistics: Vec<Statistics> = renderer
            .gpu()
            .download(BufferId::StatisticsOf, None)
            .expect("statistics");
        (renderer.sizes().batches(60_000), statistics)
    };
    let (one, expected) = render(64 << 20);
    let (several, found) = render(2 << 20);
    assert!(one == 1 && several > 4, "{one} and {several} batches");
    let accepted: u64 = expected.iter().map(|s| u64::from(s.accepted_low)).sum();
    assert!(accepted > 100_000, "{accepted} photons accepted");
    for (slot, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!(
            found.accepted_low, expected.accepted_low,
            "slot {slot}: photons accepted in {several} batches, in one"
        );
        for channel in 0..3 {
            let (found, expected) = (found.flux_high[channel], expected.flux_high[channel]);
            let difference = relative_difference(found.into(), expected.into());
            assert!(
                difference < 1e-5,
                "slot {slot}: τ {found} in {several} batches, {expected} in one"
            );
        }
    }
}
