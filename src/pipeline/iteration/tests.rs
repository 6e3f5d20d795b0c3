//! Iterations that are begun ahead are the ones that would have been done without it.

use std::path::Path;

use super::*;
use crate::backend::Backend as _;
use crate::config::{EmissionChoice, RenderConfig};
use crate::gpu::Device;
use crate::packing::PackedScene;
use crate::scene::Scene;

fn renderer(name: &str, emission: EmissionChoice) -> Renderer {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name)
        .with_extension("gltf");
    let loaded = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
    let scene = PackedScene::new(&loaded).unwrap_or_else(|error| panic!("{name}: {error}"));
    let config = RenderConfig {
        resolution: [16, 16],
        photons: 500,
        emission,
        aims_anyway: true,
        ..RenderConfig::default()
    };
    let device = Device::open(None).expect("a Vulkan device");
    Renderer::new(device, &scene, &loaded.cameras[0], config).expect("a renderer")
}

fn updates(run: &Run) -> usize {
    run.launches.iter().filter(|launch| launch.stage == "update").count()
}

/// Does an iteration, with the next one ahead, whatever the machine was busy with.
fn iterate_ahead(renderer: &mut Renderer) -> Run {
    renderer.iteration_ns = 0.0;
    let run = renderer.iterate_before_another(&|| false).expect("an iteration");
    run.expect("nothing cuts it short")
}

fn assert_same(name: &str, found: &mut Renderer, expected: &mut Renderer) {
    assert_eq!(
        (found.iterations(), found.emitted()),
        (expected.iterations(), expected.emitted()),
        "{name}"
    );
    let same = found.resolve().expect("a picture") == expected.resolve().expect("a picture");
    assert!(same, "{name}: iterations begun ahead make another picture");
    assert_eq!(found.counters(), expected.counters(), "{name}");
}

#[test]
fn iterations_begun_ahead_make_the_same_picture_bit_for_bit() {
    for (name, emission) in [
        ("cornell", EmissionChoice::Power),
        ("cornell-spheres", EmissionChoice::Aimed),
    ] {
        let (mut ahead, mut one_by_one) = (renderer(name, emission), renderer(name, emission));
        assert_eq!(ahead.aim.is_some(), emission == EmissionChoice::Aimed, "{name}");
        let mut begun = 0;
        for _ in 0..19 {
            iterate_ahead(&mut ahead);
            begun += u32::from(ahead.ahead.is_some());
            one_by_one.iterate().expect("an iteration");
        }
        // Paths are aimed anew before each of the first nine iterations, and before the seventeenth.
        let expected = if ahead.aim.is_some() { 10 } else { 19 };
        assert_eq!(begun, expected, "{name}: iterations of 19 that were begun ahead");
        ahead.iterate().expect("an iteration");
        one_by_one.iterate().expect("an iteration");
        assert_same(name, &mut ahead, &mut one_by_one);
    }
}

#[test]
fn an_iteration_that_is_done_again_stops_the_one_begun_after_it() {
    let mut pair = [(); 2].map(|()| renderer("cornell-spheres", EmissionChoice::Power));
    for renderer in &mut pair {
        for _ in 0..3 {
            renderer.iterate().expect("an iteration");
        }
        renderer.sizes.photon_capacity = 64;
        renderer.upload_settings().expect("settings");
    }
    let [ahead, one_by_one] = &mut pair;
    let run = one_by_one.iterate().expect("an iteration");
    assert_eq!(updates(&run), 2, "64 photons are too few for an iteration");
    let run = iterate_ahead(ahead);
    assert_eq!(
        updates(&run),
        3,
        "the failed one, the one begun after it, and the first one again"
    );
    for _ in 0..4 {
        iterate_ahead(ahead);
        one_by_one.iterate().expect("an iteration");
    }
    ahead.iterate().expect("an iteration");
    one_by_one.iterate().expect("an iteration");
    assert_same("cornell-spheres", ahead, one_by_one);
}

#[test]
fn a_picture_has_what_was_begun_ahead() {
    let (mut ahead, mut one_by_one) = (
        renderer("cornell", EmissionChoice::Power),
        renderer("cornell", EmissionChoice::Power),
    );
    ahead.iterate().expect("an iteration");
    iterate_ahead(&mut ahead);
    for _ in 0..3 {
        one_by_one.iterate().expect("an iteration");
    }
    ahead.resolve().expect("a picture");
    assert_eq!(ahead.iterations(), 3, "one was begun ahead, and is in the picture");
    assert_same("cornell", &mut ahead, &mut one_by_one);
}
