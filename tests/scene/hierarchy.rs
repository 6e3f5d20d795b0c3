//! Nodes, scenes and transforms.

use std::f32::consts::FRAC_1_SQRT_2;

use ppm_vk::internals::scene::Scene;
use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close};

/// World positions of the first triangle of an object.
fn world_corners(scene: &Scene, object: usize) -> [[f32; 3]; 3] {
    let triangle = scene.triangles[scene.objects[object].triangles.start as usize];
    triangle.vertices.map(|vertex| {
        let render = scene.positions[vertex as usize].as_dvec3();
        (render / scene.normalisation.scale + scene.normalisation.centre)
            .as_vec3()
            .to_array()
    })
}

#[test]
fn translation_rotation_and_scale_apply_in_the_order_of_gltf() {
    let mut lamp = Fixture::lamp();
    // Scaled to (2x, 3y, 4z), turned by 90° about z (x to y, y to −x), moved.
    lamp.set("/nodes/0/scale", json!([2, 3, 4]));
    lamp.set("/nodes/0/rotation", json!([0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]));
    lamp.set("/nodes/0/translation", json!([10, 20, 30]));
    let corners = world_corners(&lamp.scene(), 0);
    assert_close(corners[0].into(), [7.0, 20.0, 30.0]);
    assert_close(corners[1].into(), [7.0, 22.0, 30.0]);
    assert_close(corners[2].into(), [7.0, 20.0, 34.0]);
}

#[test]
fn a_matrix_is_read_by_columns() {
    let mut lamp = Fixture::lamp();
    lamp.set(
        "/nodes/0/matrix",
        json!([0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 10, 20, 30, 1]),
    );
    let corners = world_corners(&lamp.scene(), 0);
    assert_close(corners[0].into(), [7.0, 20.0, 30.0]);
    assert_close(corners[1].into(), [7.0, 22.0, 30.0]);
    assert_close(corners[2].into(), [7.0, 20.0, 34.0]);
}

#[test]
fn a_rotation_that_is_not_quite_a_unit_does_not_scale() {
    let mut lamp = Fixture::lamp();
    lamp.set("/nodes/0/rotation", json!([0, 0, 0.9, 0.9]));
    assert_close(world_corners(&lamp.scene(), 0)[1].into(), [-1.0, 1.0, 0.0]);
}

#[test]
fn children_stand_in_their_parents_space() {
    let mut lamp = Fixture::lamp();
    lamp.set("/nodes/0/translation", json!([1, 0, 0]));
    lamp.add_parent(json!({"scale": [2, 2, 2]}));
    lamp.add_parent(json!({"translation": [0, 5, 0]}));
    assert_close(world_corners(&lamp.scene(), 0)[0].into(), [2.0, 7.0, 0.0]);
}

#[test]
fn a_mesh_of_several_nodes_gives_an_object_for_each() {
    let mut lamp = Fixture::lamp();
    lamp.add_root(json!({"name": "second", "mesh": 1, "translation": [5, 0, 0]}));
    lamp.add_root(json!({"mesh": 1, "translation": [9, 0, 0]}));
    let scene = lamp.scene();
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(
        names,
        ["lamp", "second", "lamp"],
        "named after the node, or else the mesh"
    );
    assert_close(world_corners(&scene, 1)[0].into(), [5.0, 1.0, 0.0]);
    assert_close(world_corners(&scene, 2)[0].into(), [9.0, 1.0, 0.0]);
    for (index, object) in scene.objects.iter().enumerate() {
        let triangles = object.triangles.start as usize..object.triangles.end as usize;
        assert_eq!(triangles.len(), 1);
        assert!(
            scene.triangles[triangles]
                .iter()
                .all(|triangle| triangle.object as usize == index)
        );
    }
}

#[test]
fn instances_of_a_mesh_with_shared_vertices_stand_apart() {
    let mut room = Fixture::room();
    room.add_root(json!({"mesh": 0, "translation": [0, 0.5, 0]}));
    room.add_root(json!({"mesh": 0, "translation": [0, 0.75, 0]}));
    let scene = room.scene();
    assert_eq!(scene.positions.len(), 3 * 4 + 3);
    assert_close(world_corners(&scene, 0)[1].into(), [-1.0, 0.0, 1.0]);
    assert_close(world_corners(&scene, 2)[1].into(), [-1.0, 0.5, 1.0]);
    assert_close(world_corners(&scene, 3)[1].into(), [-1.0, 0.75, 1.0]);
}

#[test]
fn nodes_outside_the_default_scene_are_not_shown() {
    let mut room = Fixture::room();
    room.set("/scenes", json!([{"nodes": [0, 1, 2]}, {"nodes": [1, 2]}]));
    assert_eq!(room.scene().objects.len(), 2, "scene 0 is the default");
    room.set("/scene", json!(1));
    assert_eq!(room.scene().objects.len(), 1, "scene 1 is the default");
    room.remove("/scene");
    assert_eq!(room.scene().objects.len(), 2, "without a default the first is shown");
    room.remove("/scenes");
    room.set("/nodes/0/children", json!([1]));
    assert_eq!(
        room.scene().objects.len(),
        2,
        "without a scene all nodes are shown once"
    );
}

#[test]
fn a_hundred_thousand_nested_nodes_load() {
    let mut lamp = Fixture::lamp();
    let depth = 100_000;
    let mut nodes: Vec<Value> = (1..depth)
        .map(|child| json!({"children": [child], "translation": [1, 0, 0]}))
        .collect();
    nodes.push(json!({"mesh": 1, "translation": [1, 0, 0]}));
    lamp.set("/nodes", Value::Array(nodes));
    let scene = lamp.scene();
    assert_close(
        (world_corners(&scene, 0)[0][0] - depth as f32) * glam::Vec3::X,
        [0.0; 3],
    );
}

#[test]
fn cycles_and_second_parents_are_refused() {
    let mut room = Fixture::room();
    room.set("/nodes/0/children", json!([0]));
    room.assert_fails(&["node 0 \"floor\"", "cycle"]);

    let mut room = Fixture::room();
    room.set("/nodes/0/children", json!([1]));
    room.set("/nodes/1/children", json!([0]));
    room.assert_fails(&["node 0 \"floor\"", "cycle"]);

    let mut room = Fixture::room();
    room.set("/scenes/0/nodes", json!([0, 2]));
    room.set("/nodes/0/children", json!([1]));
    room.set("/nodes/2/children", json!([1]));
    room.assert_fails(&["node 1 \"lamp\"", "both node 0 and node 2"]);

    let mut room = Fixture::room();
    room.set("/nodes/0/children", json!([1]));
    room.assert_fails(&["scene 0", "node 1", "child of another"]);

    let mut room = Fixture::room();
    room.set("/scenes/0/nodes", json!([0, 1, 1]));
    room.assert_fails(&["scene 0", "node 1", "twice"]);
}

#[test]
fn indices_of_nodes_meshes_and_scenes_out_of_range_are_named() {
    let mut room = Fixture::room();
    room.set("/nodes/0/children", json!([77]));
    room.assert_fails(&["node 0 \"floor\"", "77", "3 nodes"]);

    let mut room = Fixture::room();
    room.set("/scenes/0", json!({"name": "main", "nodes": [0, 77]}));
    room.assert_fails(&["scene 0 \"main\"", "77", "3 nodes"]);

    let mut room = Fixture::room();
    room.set("/scene", json!(77));
    room.assert_fails(&["scene is 77", "1 scenes"]);

    let mut room = Fixture::room();
    room.set("/nodes/0/mesh", json!(77));
    room.assert_fails(&["node 0 \"floor\"", "no mesh 77", "has 2"]);
}

#[test]
fn transforms_that_are_not_finite_or_affine_are_named() {
    let cases = [
        ("translation", json!([0, 1e39, 0]), "translation isn't finite"),
        ("scale", json!([1e39, 1, 1]), "scale isn't finite"),
        ("rotation", json!([1e39, 0, 0, 0]), "rotation isn't finite"),
        ("rotation", json!([0, 0, 0, 0]), "quaternion 0 0 0 0"),
        (
            "matrix",
            json!([1e39, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "matrix isn't finite",
        ),
        (
            "matrix",
            json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "isn't affine",
        ),
    ];
    for (key, value, part) in cases {
        let mut room = Fixture::room();
        room.set(&format!("/nodes/1/{key}"), value);
        room.assert_fails(&["node 1 \"lamp\"", part]);
    }
    let mut lamp = Fixture::lamp();
    for _ in 0..10 {
        lamp.add_parent(json!({"scale": [1e38, 1e38, 1e38]}));
    }
    lamp.assert_fails(&["out of floating-point range"]);
}
