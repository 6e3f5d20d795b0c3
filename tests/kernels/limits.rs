//! Limits of a driver must not change a picture. For years Mesa's llvmpipe has silently ended all loops of an invocation together
//! after 65,535 iterations; the gathers have a test of it too.

use glam::DVec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Accel, Direct, EmissionChoice, RenderConfig};
use ppm_vk::internals::cpu;
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::layout::{DirectSum, Statistics, VisiblePoint};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::random::CameraTurn;
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::shaders;
use ppm_vk::internals::stage::{BufferId, StageDesc};

use super::agreement::relative_difference;
use super::bench::{Bench, small, xyz};

#[test]
fn no_photon_is_lost_where_a_lane_follows_many_paths() {
    let config = RenderConfig {
        resolution: [8, 8],
        photons: 400_000,
        radius: Some(0.01),
        drop_unwanted: false,
        emission: EmissionChoice::Power,
        ..small()
    };
    let bench = Bench::new("pool", config);
    let counters = bench.renderer.counters();
    assert_eq!(counters.cut_paths, 0, "paths that were cut short");
    let expected = bench.plain().trace_photon_paths(0, 0..bench.config.photons).0.len();
    println!("{expected} photons on the CPU, on the device {counters:?}");
    // The number of photons per path has a standard deviation below twice its mean: 0.45 % of a difference of two such means. Six
    // standard deviations: a correct program fails once in 10⁸ runs.
    let difference = relative_difference(counters.photons_stored as f64, expected as f64);
    assert!(
        difference < 0.027,
        "{expected} photons on the CPU, on the device {counters:?}"
    );
}

#[test]
fn an_iteration_that_is_done_again_counts_once() {
    // Rays that test 4,000 triangles take more loop iterations than some drivers allow for two paths of a lane. Then the
    // iteration is repeated with one path per lane. The sum of direct light does not depend on the photons.
    let config = RenderConfig {
        // Eight camera paths per pixel.
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
        recording.dispatch(camera.constants(constants).push(shaders::CameraTurnPush::from(turn)));
        bench.renderer.run(&recording).expect("a camera stage");
        for (sum, point) in expected
            .iter_mut()
            .zip(bench.download::<VisiblePoint>(BufferId::VisiblePoints))
        {
            *sum += xyz(point.emitted) / f64::from(turn.paths);
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
fn an_iteration_in_batches_gathers_the_same_as_one_batch() {
    let config = RenderConfig {
        resolution: [32, 32],
        photons: 60_000,
        radius: Some(0.1),
        // The learned tables depend on the batches.
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

#[test]
fn an_iteration_that_is_cut_short_counts_with_its_photons_if_it_is_the_first_and_else_not_at_all() {
    let config = |photons| RenderConfig {
        resolution: [16, 16],
        photons,
        radius: Some(0.1),
        emission: EmissionChoice::Power,
        ..small()
    };
    let loaded = super::bench::scene("cornell-spheres");
    let scene = super::bench::packed(&loaded);
    let camera = &loaded.cameras[0];
    let on_device = |photons, buffer_bytes| {
        let device = Device::open(None).expect("a device");
        Renderer::within(buffer_bytes, device, &scene, camera, config(photons)).expect("a renderer")
    };
    let on_cpu = |photons| cpu::Renderer::new(&scene, camera, config(photons)).expect("a renderer");

    let mut device = on_device(4_000_000_000, 1 << 20);
    let mut processor = on_cpu(4_000_000_000);
    let cut: [&mut dyn Backend; 2] = [&mut device, &mut processor];
    for (name, cut) in ["device", "CPU"].into_iter().zip(cut) {
        cut.iterate_unless(&|| true)
            .expect("an iteration")
            .expect("the first one counts");
        let emitted = cut.emitted();
        assert_eq!(cut.iterations(), 1, "{name}");
        assert!((1..4_000_000).contains(&emitted), "{name}: {emitted} paths");
        let first = cut.resolve().expect("a picture");

        let paths = u32::try_from(emitted).expect("few paths");
        let mut whole: Box<dyn Backend> = match name {
            "device" => Box::new(on_device(paths, 64 << 20)),
            _ => Box::new(on_cpu(paths)),
        };
        whole.iterate().expect("an iteration");
        let whole_counters = whole.counters();
        whole.resolve().expect("a picture");
        let stored = cut.counters().photons_stored;
        assert!(stored > 1000, "{name}: {stored} photons");
        assert_eq!(
            stored, whole_counters.photons_stored,
            "{name}: of {paths} paths, in a whole iteration"
        );

        assert!(cut.iterate_unless(&|| true).expect("no error").is_none(), "{name}");
        assert_eq!((cut.iterations(), cut.emitted()), (1, emitted), "{name}");
        assert!(
            cut.resolve().expect("a picture") == first,
            "{name}: the second photon is in the picture"
        );
        assert_eq!(cut.counters().photons_stored, stored, "{name}");
    }
}
