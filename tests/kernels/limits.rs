//! What a driver's limits must not do to a picture. Mesa's llvmpipe, for years, has ended all loops of an invocation
//! together after 65,535 iterations, without a word; the gathers have a test of that too.

use ppm_vk::backend::Backend;
use ppm_vk::config::{Accel, Direct, RenderConfig};
use ppm_vk::cpu::{self, Batch, Counts};
use ppm_vk::layout::{DirectSum, Statistics, VisiblePoint};
use ppm_vk::stage::BufferId;

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
        resolution: [16, 16],
        photons: 4200,
        accel: Accel::Brute,
        direct: Direct::Photons,
        radius: Some(0.01),
        ..small()
    };
    let mut bench = Bench::new("cornell-spheres", config);
    let points: Vec<VisiblePoint> = bench.download(BufferId::VisiblePoints);
    let sums: Vec<DirectSum> = bench.download(BufferId::DirectSums);
    let repeated = bench.renderer.counters().repeated_iterations;
    for (slot, (point, sum)) in points.iter().zip(&sums).enumerate() {
        let (seen, summed) = (xyz(point.emitted_normal), xyz(sum.high) + xyz(sum.low));
        assert_eq!(
            summed, seen,
            "slot {slot} after one iteration, done again {repeated} times: sum, radiance seen"
        );
    }
}

#[test]
fn an_iteration_in_batches_gathers_what_one_batch_gathers() {
    // Where a device binds 128 MiB, these paths' photons are two batches; on the CPU they are one.
    let config = RenderConfig {
        resolution: [16, 16],
        photons: 450_000,
        radius: Some(0.05),
        ..small()
    };
    let bench = Bench::new("cornell", config.clone());
    let mut on_device = bench.renderer;
    let scene = super::bench::scene("cornell");
    let mut on_cpu = cpu::Renderer::new(&bench.scene, &scene.cameras[0], config).expect("a renderer");
    on_cpu.iterate().expect("an iteration");
    let found: Vec<Statistics> = on_device
        .gpu()
        .download(BufferId::StatisticsOf, None)
        .expect("statistics");
    let accepted = |statistics: &[Statistics]| statistics.iter().map(|s| u64::from(s.accepted_low)).sum::<u64>();
    let (found, expected) = (accepted(&found), accepted(on_cpu.statistics()));
    let batches = on_device.sizes().batches(450_000);
    println!("{found} photons accepted in {batches} batches on the device, {expected} on the CPU");
    assert!(expected > 10_000, "{expected} photons accepted on the CPU");
    // A few paths in ten thousand part where f32 rounds otherwise than f64.
    let difference = relative_difference(found as f64, expected as f64);
    assert!(
        difference < 1e-3,
        "{found} photons accepted in {batches} batches, {expected} in one"
    );
}
