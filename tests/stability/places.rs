//! Scenes far from the origin, and of any size.

use std::path::Path;

use ppm_vk::internals::film::Image;
use ppm_vk::internals::metrics::compare;
use ppm_vk::internals::scene::Scene;
use serde_json::{Value, json};

use super::sound::{render, square};

/// The picture of `cornell-spheres` under a root node.
fn picture_under(mut root: Value) -> Image {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = std::fs::read_to_string(scenes.join("cornell-spheres.gltf")).expect("scene");
    let mut document: Value = serde_json::from_str(&text).expect("JSON");
    root["children"] = document["scenes"][0]["nodes"].take();
    let nodes = document["nodes"].as_array_mut().expect("nodes");
    nodes.push(root);
    document["scenes"][0]["nodes"] = json!([nodes.len() - 1]);

    let folder = tempfile::TempDir::new().expect("folder");
    let binary = "cornell-spheres.bin";
    std::fs::copy(scenes.join(binary), folder.path().join(binary)).expect("buffer");
    let path = folder.path().join("moved.gltf");
    std::fs::write(&path, document.to_string()).expect("scene");
    let scene = Scene::load(&path).expect("moved scene");
    render(&scene, 0, 4, square(48, 20_000)).image
}

/// The room is 2 wide. Nothing is random: one seed, one device, and render space the same except for rounding.
fn assert_same_picture(turned: Option<[f64; 4]>) {
    let under = |mut root: Value| {
        if let Some(rotation) = turned {
            root["rotation"] = json!(rotation);
        }
        picture_under(root)
    };
    let here = under(json!({}));
    for root in [
        json!({ "translation": [2e5, -2e5, 2e5] }),
        json!({ "translation": [2e7, 2e7, -2e7] }),
        json!({ "scale": [1e-3, 1e-3, 1e-3] }),
        json!({ "scale": [1e3, 1e3, 1e3] }),
        json!({ "scale": [1e-3, 1e-3, 1e-3], "translation": [2e4, 2e4, 2e4] }),
    ] {
        let rel_mse = compare(&under(root.clone()), &here).expect("sizes").rel_mse;
        println!("{root}, turned: {turned:?}: relMSE {rel_mse:e}");
        assert!(rel_mse < 1e-4, "{root}, turned: {turned:?}: relMSE {rel_mse}");
    }
}

#[test]
fn a_scene_ten_million_sizes_away_or_a_thousand_times_as_large_or_small_gives_the_same_picture() {
    assert_same_picture(None);
}

/// A rotated scene has coordinates that use all bits, which are rounded far from the origin: to 3.7e-9 at 2e7, a sixteenth of the
/// resolution of f32 in render space.
#[test]
fn so_does_a_turned_scene_whose_coordinates_are_rounded_there() {
    assert_same_picture(Some([0.1825742, 0.3651484, 0.5477226, 0.7302967]));
}
