//! Choices that a file leaves: material variants and scenes.

use ppm_vk::LoadChoice;
use ppm_vk::internals::error::Result;
use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use crate::fixture::{Fixture, assert_error};

const VARIANTS: &str = "KHR_materials_variants";

/// A room with a second scene, only the lamp, and variants of the floor.
fn room() -> Fixture {
    let mut room = Fixture::room();
    room.set("/extensionsUsed", json!([VARIANTS]));
    room.set("/extensionsRequired", json!([VARIANTS]));
    room.set(
        "/extensions",
        json!({VARIANTS: {"variants": [{"name": "dull"}, {"name": "bright"}]}}),
    );
    room.set(
        "/meshes/0/primitives/0/extensions",
        json!({VARIANTS: {"mappings": [{"material": 0, "variants": [0]}, {"material": 1, "variants": [1]}]}}),
    );
    room
}

fn load(room: &Fixture, variant: Option<&str>, scene: Option<&str>) -> Result<Scene> {
    room.write("room.bin", &room.binary);
    room.write("room.gltf", room.json.to_string().as_bytes());
    let options = LoadOptions {
        variant: variant.map(str::to_owned),
        scene: scene.map(str::to_owned),
        ..LoadOptions::default()
    };
    Scene::load_with(&room.path("room.gltf"), options)
}

#[test]
fn a_variant_gives_primitives_its_materials() {
    let materials = |variant| {
        let scene = load(&room(), variant, None).expect("a scene");
        assert!(
            scene.warnings.is_empty() && scene.notes.is_empty(),
            "{:?}",
            (scene.warnings, scene.notes)
        );
        assert_eq!(scene.variants, ["dull", "bright"]);
        scene.objects.iter().map(|object| object.material).collect::<Vec<_>>()
    };
    assert_eq!(materials(None), [0, 1], "without a variant, each mesh's own");
    assert_eq!(materials(Some("dull")), [0, 1]);
    assert_eq!(
        materials(Some("bright")),
        [1, 1],
        "the lamp has none of its own and keeps its material"
    );
}

#[test]
fn unknown_variants_are_named_with_those_that_there_are() {
    assert_error(
        load(&room(), Some("rusty"), None),
        &["\"rusty\"", "\"dull\" and \"bright\""],
    );
    assert_error(
        load(&Fixture::room(), Some("rusty"), None),
        &["\"rusty\"", "ask for none"],
    );
    let mut damaged = room();
    damaged.set("/extensions", json!({VARIANTS: {"variants": 7}}));
    damaged.assert_fails(&[VARIANTS, "export it again"]);
    let mut damaged = room();
    damaged.set("/meshes/0/primitives/0/extensions", json!({VARIANTS: []}));
    assert_error(load(&damaged, Some("dull"), None), &["mesh 0", VARIANTS]);
    damaged.set(
        "/meshes/0/primitives/0/extensions",
        json!({VARIANTS: {"mappings": [{"material": 77, "variants": [0]}]}}),
    );
    assert_error(load(&damaged, Some("dull"), None), &["mesh 0", "no material 77"]);
}

/// The room with these scenes; nodes 0 and 1 are floor and lamp, 2 is the camera.
fn with_scenes(scenes: serde_json::Value, default: Option<usize>) -> Fixture {
    let mut room = Fixture::room();
    room.set("/scenes", scenes);
    match default {
        Some(default) => drop(room.set("/scene", json!(default))),
        None => drop(room.remove("/scene")),
    }
    room
}

#[test]
fn the_default_scene_is_rendered_and_said_where_there_are_several() {
    let scenes = json!([{"nodes": [0, 1, 2]}, {"name": "lamp alone", "nodes": [1, 2]}]);
    for (default, wanted, triangles, said) in [
        (Some(0), None, 3, "scene 0 is rendered"),
        (Some(1), None, 1, "scene 1 \"lamp alone\" is rendered"),
        (None, None, 3, "scene 0 is rendered"),
        (None, Some("lamp alone"), 1, ""),
        (Some(0), Some("1"), 1, ""),
    ] {
        let room = with_scenes(scenes.clone(), default);
        let scene = load(&room, None, wanted).expect("a scene");
        assert_eq!(scene.triangles.len(), triangles, "{default:?}, {wanted:?}");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.notes.len(), usize::from(!said.is_empty()), "{:?}", scene.notes);
        if let [note] = &scene.notes[..] {
            assert!(
                note.starts_with(said) && note.choice() == Some(LoadChoice::Scene) && note.contains("1 \"lamp alone\""),
                "{note}"
            );
        }
    }
    let room = with_scenes(json!([{"nodes": [0, 1, 2]}]), Some(0));
    assert!(room.scene().notes.is_empty(), "one scene is no choice");
}

#[test]
fn a_scene_that_shows_no_mesh_gives_way_to_one_that_does() {
    for (default, said) in [
        (Some(0), "since the default one shows no mesh"),
        (None, "the first that shows a mesh"),
    ] {
        let room = with_scenes(json!([{}, {"nodes": [2]}, {"nodes": [3]}]), default);
        let mut room = room;
        room.set("/nodes/-", json!({"children": [0, 1]}));
        let scene = load(&room, None, None).expect("a scene");
        assert_eq!(scene.triangles.len(), 3);
        assert!(
            scene.notes[0].contains("scene 2") && scene.notes[0].contains(said),
            "{:?}",
            scene.notes
        );
        // It is in another scene.
        assert!(
            scene.warnings[0].starts_with("the scene that is rendered has no camera, though the file has"),
            "{:?}",
            scene.warnings
        );
        // Only the requested one is tried.
        assert_error(load(&room, None, Some("0")), &["no triangles"]);
    }
    with_scenes(json!([{}, {"nodes": [2]}]), Some(0)).assert_fails(&["no triangles"]);
}

#[test]
fn unknown_scenes_are_named_with_those_that_there_are() {
    let room = with_scenes(json!([{"name": "hall", "nodes": [0, 1, 2]}, {"nodes": [1]}]), None);
    assert_error(load(&room, None, Some("attic")), &["\"attic\"", "0 \"hall\" and 1"]);
    assert_error(load(&room, None, Some("2")), &["\"2\""]);
    let mut room = Fixture::room();
    room.remove("/scenes").remove("/scene");
    assert_error(load(&room, None, Some("0")), &["ask for none"]);
}
