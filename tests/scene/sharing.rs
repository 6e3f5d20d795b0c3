//! Which primitives are shared by nodes.

use glam::Vec3;
use ppm_vk::internals::scene::{SHARED, Scene};
use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close};

/// A fan of this number of triangles: mesh 2 of the room. Returns the accessor of its positions.
fn add_fan(room: &mut Fixture, triangles: u16, material: usize) -> usize {
    let rim = (0..=triangles).map(|i| {
        let angle = f32::from(i) * 0.1;
        [0.1 * angle.cos() + 0.3, 0.1 * angle.sin(), 0.02 * angle]
    });
    let vertices: Vec<[f32; 3]> = std::iter::once([0.3, 0.0, 0.0]).chain(rim).collect();
    let positions = room.add_vectors(&vertices);
    let primitive = json!({"attributes": {"POSITION": positions}, "mode": 6, "material": material});
    room.set("/meshes/-", json!({"primitives": [primitive]}));
    positions
}

/// The room with a fan of 40 triangles that two nodes show.
fn with_two(first: Value, second: Value) -> Fixture {
    let mut room = Fixture::room();
    add_fan(&mut room, 40, 0);
    for mut node in [first, second] {
        node["mesh"] = json!(2);
        room.add_root(node);
    }
    room
}

fn placed(scene: &Scene) -> usize {
    scene.objects.iter().filter(|object| object.placement.is_some()).count()
}

#[test]
fn a_primitive_that_two_nodes_show_is_stored_once() {
    let scene = with_two(json!({}), json!({"translation": [-0.5, 0.5, 0], "scale": [1, 2, -1]})).scene();
    assert_eq!(placed(&scene), 2);
    assert_eq!(scene.triangles.len(), 3 + 40);
    let [first, second] = [&scene.objects[2], &scene.objects[3]];
    assert_eq!(first.triangles, second.triangles);
    for triangle in first.triangles.clone() {
        assert_eq!(scene.triangles[triangle as usize].object, SHARED);
    }
    // The fan's middle.
    let middle = scene.triangles[first.triangles.start as usize].vertices[2];
    let middle = scene.positions[middle as usize];
    let world = |object: &ppm_vk::internals::scene::Object| {
        let render = object.placement.expect("a placement").point(middle).as_dvec3();
        (render / scene.normalisation.scale + scene.normalisation.centre).as_vec3()
    };
    assert_close(world(first), [0.3, 0.0, 0.0]);
    assert_close(world(second), [-0.2, 0.5, 0.0]);
    let mirrored = [first, second].map(|object| object.placement.expect("a placement").is_mirrored());
    assert_eq!(mirrored, [false, true]);
}

#[test]
fn bounds_and_areas_are_those_of_meshes_of_their_own() {
    let nodes = [
        json!({"scale": [3, 1, 1]}),
        json!({"translation": [-2, 0.5, 0], "rotation": [0.6, 0, 0, 0.8]}),
    ];
    let [first, second] = nodes;
    let shared = with_two(first, second);
    let mut apart = Fixture {
        json: shared.json.clone(),
        binary: shared.binary.clone(),
        folder: tempfile::TempDir::new().expect("a folder"),
    };
    let mesh = apart.json["meshes"][2].clone();
    apart.set("/meshes/-", mesh).set("/nodes/4/mesh", json!(3));
    let (shared, apart) = (shared.scene(), apart.scene());
    assert_eq!((placed(&shared), placed(&apart)), (2, 0));
    assert_eq!(shared.normalisation, apart.normalisation);
    let (found, expected) = (shared.bounds(), apart.bounds());
    assert_close(found.0, expected.0.to_array());
    assert_close(found.1, expected.1.to_array());
    for object in 0..4 {
        let (found, expected) = (shared.object_area(object), apart.object_area(object));
        assert!(
            (found / expected - 1.0).abs() < 1e-5,
            "object {object}: {found}, {expected}"
        );
    }
}

#[test]
fn meshes_that_nodes_show_differently_are_not_shared() {
    let two = || with_two(json!({}), json!({"translation": [0.5, 0, 0]}));
    assert_eq!(placed(&two().scene()), 2, "but for what follows");

    let mut shining = two();
    shining.set("/meshes/2/primitives/0/material", json!(1));
    assert_eq!(placed(&shining.scene()), 0, "lights");

    let mut morphed = two();
    let target = morphed.add_vectors(&[[0.0, 0.1, 0.0]; 42]);
    morphed.set("/meshes/2/primitives/0/targets", json!([{"POSITION": target}]));
    assert_eq!(placed(&morphed.scene()), 2, "a target without weight moves nothing");
    morphed.set("/nodes/4/weights", json!([0.5]));
    assert_eq!(
        placed(&morphed.scene()),
        0,
        "a morphed one, and the only one that is left"
    );

    let mut skinned = two();
    let joints = skinned.add_accessor(&[0; 4 * 42], 42, 5121, "VEC4");
    let weights = skinned.add_floats("VEC4", 4, &[1.0, 0.0, 0.0, 0.0].repeat(42));
    skinned.set("/meshes/2/primitives/0/attributes/JOINTS_0", json!(joints));
    skinned.set("/meshes/2/primitives/0/attributes/WEIGHTS_0", json!(weights));
    skinned.set("/skins", json!([{"joints": [0]}]));
    skinned.set("/nodes/3/skin", json!(0)).set("/nodes/4/skin", json!(0));
    assert_eq!(placed(&skinned.scene()), 0, "skinned ones");
}

#[test]
fn meshes_whose_sharing_saves_little_are_not_shared() {
    let mut room = with_two(json!({}), json!({"translation": [0.5, 0, 0]}));
    add_fan(&mut room, 190, 0);
    room.add_root(json!({"mesh": 3}));
    assert_eq!(placed(&room.scene()), 0, "40 triangles of 273");
    room.add_root(json!({"mesh": 2, "translation": [0, 0.5, 0]}));
    assert_eq!(placed(&room.scene()), 3, "80 of 313: a third node makes it worth while");
}

#[test]
fn few_triangles_and_flat_or_tiny_instances_have_triangles_of_their_own() {
    let mut few = Fixture::room();
    add_fan(&mut few, 31, 0);
    few.add_root(json!({"mesh": 2}));
    few.add_root(json!({"mesh": 2}));
    assert_eq!(placed(&few.scene()), 0);

    for scale in [[1.0, 1.0, 0.0], [1.0, 1.0, 1e-6], [1e-7; 3]] {
        let scene = with_two(json!({}), json!({"scale": scale, "translation": [0, 0.5, 0]})).scene();
        assert_eq!((placed(&scene), scene.objects.len()), (1, 4), "{scale:?}");
        let tiny = &scene.objects[3];
        assert_eq!(tiny.triangles.len(), 40 - scene.dropped_triangles, "{scale:?}");
        let corner = scene.triangles[tiny.triangles.start as usize].vertices[0];
        assert!(scene.positions[corner as usize].abs().cmple(Vec3::ONE).all());
    }
}

/// One distant vertex makes the scene so large that the fan vanishes in it, though the fan has triangles in its own space.
#[test]
fn a_scene_whose_shared_triangles_vanish_with_all_others_is_refused() {
    let mut room = Fixture::room();
    let mut vertices = vec![[0.25, 0.0, 0.25]; 42];
    for (i, vertex) in (0u16..).zip(&mut vertices) {
        let angle = f32::from(i) * 0.1;
        *vertex = [0.1 * angle.cos(), 0.1 * angle.sin(), 0.02 * angle];
    }
    vertices[20] = [3.4e10, 0.0, 0.0];
    let positions = room.add_vectors(&vertices);
    let primitive = json!({"attributes": {"POSITION": positions}, "mode": 6, "material": 0});
    room.set("/meshes/-", json!({"primitives": [primitive]}));
    room.set("/scenes/0/nodes", json!([2]));
    room.add_root(json!({"mesh": 2}));
    room.add_root(json!({"mesh": 2, "rotation": [0.1143, 0.2286, 0.2286, 0.9394], "scale": [-1, 1, 1]}));
    room.assert_fails(&["no triangles", "too narrow"]);
}
