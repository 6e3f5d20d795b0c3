//! `EXT_mesh_gpu_instancing`: nodes that show their mesh many times.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close, world_soup};

const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Instances of the lamp by these attributes.
fn instanced(room: &mut Fixture, attributes: Value) {
    room.set("/nodes/1/extensions", json!({INSTANCING: {"attributes": attributes}}));
    room.set("/extensionsUsed", json!([INSTANCING]));
    room.set("/extensionsRequired", json!([INSTANCING]));
}

/// The lamp's triangles: the floor has the first two.
fn lamps(room: &Fixture) -> Vec<[glam::Vec3; 3]> {
    let scene = room.scene();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    world_soup(&scene)[2..].to_vec()
}

#[test]
fn instances_are_scaled_turned_and_moved_within_their_node() {
    let mut room = Fixture::room();
    // The lamp's corners: (0, 1, 0), (1, 1, 0), (0, 1, 1).
    let translations = room.add_vectors(&[[0.0; 3], [0.0, 0.0, -0.5], [0.25, 0.0, 0.0]]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let rotations = [[0.0, 0.0, 0.0, 1.0], [0.0, half, 0.0, half], [0.0, 0.0, 0.0, 1.0]].concat();
    let rotations = room.add_floats("VEC4", 4, &rotations);
    let scales = room.add_vectors(&[[1.0; 3], [0.5, 1.0, 0.5], [0.5, 0.5, 0.5]]);
    instanced(
        &mut room,
        json!({"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales, "_ID": 0}),
    );
    room.set("/nodes/1/translation", json!([0, 0.5, 0]));
    let found = lamps(&room);
    assert_eq!(found.len(), 3);
    // A quarter turn about y takes x to −z and z to x.
    let wanted = [
        [[0.0, 1.5, 0.0], [1.0, 1.5, 0.0], [0.0, 1.5, 1.0]],
        [[0.0, 1.5, -0.5], [0.0, 1.5, -1.0], [0.5, 1.5, -0.5]],
        [[0.25, 1.0, 0.0], [0.75, 1.0, 0.0], [0.25, 1.0, 0.5]],
    ];
    for (corner, wanted) in found.as_flattened().iter().zip(wanted.as_flattened()) {
        assert_close(*corner, *wanted);
    }
}

#[test]
fn rotations_may_be_small_integers_and_attributes_may_be_absent() {
    for (component, bytes) in [
        (5120, vec![0u8, 0, 0, 127, 0, 90, 0, 90]),
        (
            5122,
            [0i16, 0, 0, 32767, 0, 23170, 0, 23170]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
    ] {
        let mut room = Fixture::room();
        let rotations = room.add_accessor(&bytes, 2, component, "VEC4");
        room.set(&format!("/accessors/{rotations}/normalized"), json!(true));
        instanced(&mut room, json!({"ROTATION": rotations}));
        let found = lamps(&room);
        assert_eq!(found.len(), 2);
        assert!(found[1][1].abs_diff_eq([0.0, 1.0, -1.0].into(), 1e-5), "{:?}", found[1]);
    }
    let mut room = Fixture::room();
    instanced(&mut room, json!({"_ID": 0}));
    assert_eq!(lamps(&room).len(), 1, "nothing places an instance: the node's own mesh");
}

#[test]
fn lights_and_cameras_and_children_of_such_nodes_are_there_once() {
    let mut room = Fixture::room();
    let translations = room.add_vectors(&[[0.0; 3], [0.0, 0.5, 0.0]]);
    instanced(&mut room, json!({"TRANSLATION": translations}));
    room.set("/nodes/1/camera", json!(0));
    room.set("/nodes/1/extensions/KHR_lights_punctual", json!({"light": 0}));
    room.set("/nodes/1/children", json!([3]));
    room.set("/nodes/-", json!({"mesh": 1, "translation": [0, -0.5, 0]}));
    room.set(
        "/extensions",
        json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}}),
    );
    room.set("/extensionsUsed/-", json!("KHR_lights_punctual"));
    let scene = room.scene();
    assert_eq!((scene.cameras.len(), scene.lights.len()), (2, 1));
    assert_eq!(scene.triangles.len(), 2 + 2 + 1);
}

#[test]
fn damaged_instances_are_named() {
    let fails = |attributes: fn(&mut Fixture) -> Value, parts: &[&str]| {
        let mut room = Fixture::room();
        let attributes = attributes(&mut room);
        instanced(&mut room, attributes);
        room.assert_fails(&[&["node 1 \"lamp\"", INSTANCING], parts].concat());
    };
    fails(|_| json!({"TRANSLATION": 99}), &["TRANSLATION", "no accessor 99"]);
    fails(|_| json!({"TRANSLATION": 2}), &["TRANSLATION", "Scalar"]);
    fails(|_| json!([]), &["export it again"]);
    fails(
        |room| json!({"TRANSLATION": 0, "SCALE": room.add_vectors(&[[1.0; 3]; 3])}),
        &["4 of one attribute and 3 of another"],
    );
    fails(
        |room| json!({"TRANSLATION": room.add_vectors(&[[f32::NAN, 0.0, 0.0]])}),
        &["translation of instance 0"],
    );
    fails(
        |room| json!({"ROTATION": room.add_floats("VEC4", 4, &[0.0; 4])}),
        &["rotation of instance 0"],
    );
    // Next to the limits of f32: the message names the position, not the transform.
    let mut room = Fixture::room();
    let scales = room.add_vectors(&[[3e38; 3]]);
    instanced(&mut room, json!({"SCALE": scales}));
    room.set("/nodes/1/scale", json!([3e38, 3e38, 3e38]));
    room.load().expect("within f64");
}

#[test]
fn a_skin_puts_its_mesh_in_one_place_with_a_warning() {
    let mut room = Fixture::room();
    let translations = room.add_vectors(&[[0.0; 3], [0.0, 0.5, 0.0]]);
    instanced(&mut room, json!({"TRANSLATION": translations}));
    let joints = room.add_accessor(&[0; 12], 3, 5121, "VEC4");
    let weights = room.add_floats("VEC4", 4, &[1.0, 0.0, 0.0, 0.0].repeat(3));
    room.set("/meshes/1/primitives/0/attributes/JOINTS_0", json!(joints));
    room.set("/meshes/1/primitives/0/attributes/WEIGHTS_0", json!(weights));
    let joint = room.add_root(json!({}));
    room.set("/skins", json!([{"joints": [joint]}]));
    room.set("/nodes/1/skin", json!(0));
    let scene = room.assert_warns(&["node 1 \"lamp\"", INSTANCING, "skin"]);
    assert_eq!(scene.triangles.len(), 3);
}

#[test]
fn triangles_that_vanish_in_all_instances_are_reported_once() {
    let mut room = Fixture::room();
    let translations = room.add_vectors(&[[0.0; 3], [0.0, 0.5, 0.0], [0.0, 0.25, 0.0]]);
    instanced(&mut room, json!({"TRANSLATION": translations}));
    room.set_lamp(&[
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 1.0],
        [0.0; 3],
        [0.0; 3],
        [0.0; 3],
    ]);
    room.assert_warns(&["dropped 3 triangles", "in \"lamp\" (3)"]);
}

#[test]
fn ten_thousand_instances_share_their_mesh_and_load_at_once() {
    let mut room = Fixture::room();
    // A strip of 100 triangles.
    let strip: Vec<[f32; 3]> = (0..102).map(|i| [i as f32 * 0.01, (i % 2) as f32, 0.0]).collect();
    let strip = room.add_vectors(&strip);
    room.set(
        "/meshes/1/primitives/0",
        json!({"attributes": {"POSITION": strip}, "mode": 5, "material": 0}),
    );
    let translations: Vec<[f32; 3]> = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
    let translations = room.add_vectors(&translations);
    instanced(&mut room, json!({"TRANSLATION": translations}));
    let start = Instant::now();
    let scene = room.scene();
    let time = start.elapsed();
    assert_eq!(scene.objects.len(), 10_001);
    assert!(
        scene.triangles.len() < 200,
        "{} triangles are stored",
        scene.triangles.len()
    );
    assert!(
        time < Duration::from_secs(10),
        "{time:?}: what is done for each instance that could be done for all?"
    );
}
