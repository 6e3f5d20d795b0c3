//! Meshes compressed by `KHR_draco_mesh_compression`.

use draco_core::{DataType, GeometryAttributeType};
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use crate::encoded::{Attribute, DRACO, EDGEBREAKER, SEQUENTIAL, VALENCE, add_compressed, draco_room, encode};
use crate::fixture::{Fixture, soup};

/// The corners of all triangles, each starting from its least corner, sorted.
fn sorted(scene: &Scene) -> Vec<[[i32; 3]; 3]> {
    let round = |corner: glam::Vec3| (corner * 1000.0).round().as_ivec3().to_array();
    let mut triangles: Vec<_> = soup(scene)
        .into_iter()
        .map(|corners| {
            let mut corners = corners.map(round);
            let least = (0..3).min_by_key(|&corner| corners[corner]).expect("three corners");
            corners.rotate_left(least);
            corners
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

#[test]
fn compressed_primitives_are_restored() {
    let plain = sorted(&Fixture::room().scene());
    for method in [SEQUENTIAL, EDGEBREAKER, VALENCE] {
        for quantized in [false, true] {
            let scene = draco_room(method, quantized).scene();
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            assert_eq!(sorted(&scene), plain, "method {method}, quantized {quantized}");
            let is_up = |normal: &glam::Vec3| normal.y > 0.999;
            assert!(scene.normals[..4].iter().all(is_up), "{:?}", scene.normals);
        }
    }
}

#[test]
fn accessors_are_as_many_as_the_compressed_data_has() {
    let plain = sorted(&Fixture::room().scene());
    let mut room = draco_room(EDGEBREAKER, false);
    room.set("/accessors/0/count", json!(7));
    room.set("/accessors/2/count", json!(900));
    assert_eq!(sorted(&room.scene()), plain);
    // A strip is a list of triangles once it is decompressed.
    room.set("/meshes/0/primitives/0/mode", json!(5));
    assert_eq!(sorted(&room.scene()), plain);
    // Indices need no accessor.
    room.remove("/meshes/0/primitives/0/indices");
    assert_eq!(sorted(&room.scene()), plain);
}

#[test]
fn small_integers_are_decompressed_too() {
    let mut room = Fixture::room();
    let positions = room.binary[..48].to_vec();
    let colors = [255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 51, 51, 51, 255];
    let attributes = [
        Attribute {
            kind: GeometryAttributeType::Position,
            component: DataType::Float32,
            width: 3,
            bytes: &positions,
        },
        Attribute {
            kind: GeometryAttributeType::Color,
            component: DataType::Uint8,
            width: 4,
            bytes: &colors,
        },
    ];
    let encoded = encode(&attributes, &[[0, 1, 2], [0, 2, 3]], SEQUENTIAL, false);
    add_compressed(&mut room, &encoded);
    let accessor = room.add_accessor(&[], 4, 5121, "VEC4");
    room.remove(&format!("/accessors/{accessor}/bufferView"));
    room.set(&format!("/accessors/{accessor}/normalized"), json!(true));
    room.set(
        "/meshes/0/primitives/0/attributes",
        json!({"POSITION": 0, "COLOR_0": accessor}),
    );
    room.set(
        &format!("/meshes/0/primitives/0/extensions/{DRACO}/attributes"),
        json!({"POSITION": 0, "COLOR_0": 1}),
    );
    let scene = room.scene();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let has = |wanted: [f32; 3]| {
        scene
            .colors
            .iter()
            .any(|color| color.truncate().abs_diff_eq(wanted.into(), 1e-6))
    };
    for color in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2; 3]] {
        assert!(has(color), "no {color:?} in {:?}", scene.colors);
    }
}

#[test]
fn plain_data_replaces_data_that_cannot_be_decompressed_with_a_warning() {
    let plain = sorted(&Fixture::room().scene());
    let mut room = Fixture::room();
    add_compressed(&mut room, b"DRACO, but no more than that");
    let scene = room.assert_warns(&["mesh 0 \"floor\", primitive 0", DRACO, "uncompressed data"]);
    assert_eq!(sorted(&scene), plain);
    for accessor in 0..3 {
        room.remove(&format!("/accessors/{accessor}/bufferView"));
    }
    room.assert_fails(&["mesh 0 \"floor\", primitive 0", DRACO, "can't be decompressed"]);
}

#[test]
fn damaged_compression_is_named() {
    let fails = |pointer: &str, value, parts: &[&str]| {
        let mut room = draco_room(EDGEBREAKER, false);
        room.set(&format!("/meshes/0/primitives/0/extensions/{DRACO}{pointer}"), value);
        room.assert_fails(&[&["mesh 0 \"floor\", primitive 0", DRACO], parts].concat());
    };
    fails("", json!({}), &["bufferView"]);
    fails("/bufferView", json!(99), &["no bufferView 99"]);
    fails("/attributes/POSITION", json!(7), &["POSITION", "no attribute 7"]);
    fails("/bufferView", json!(3), &["bufferView 3", "can't be decompressed"]);
    let mut room = draco_room(EDGEBREAKER, false);
    room.set("/meshes/0/primitives/0/attributes/POSITION", json!(99));
    room.assert_fails(&["POSITION", "no accessor 99"]);
}

#[test]
fn a_few_bytes_that_stand_for_many_vertices_take_no_more_memory_than_they_may() {
    // Equal vertices are compressed to almost nothing, whatever their number: here 4 MiB per primitive.
    let positions = vec![0; 12 << 20];
    let attribute = Attribute {
        kind: GeometryAttributeType::Position,
        component: DataType::Float32,
        width: 3,
        bytes: &positions,
    };
    let encoded = encode(&[attribute], &[[0, 1, 2]], SEQUENTIAL, true);
    assert!(encoded.len() < 4096, "{} bytes", encoded.len());
    let mut room = Fixture::room();
    add_compressed(&mut room, &encoded);
    room.set(
        &format!("/meshes/0/primitives/0/extensions/{DRACO}/attributes"),
        json!({"POSITION": 0}),
    );
    room.remove("/accessors/0/bufferView");
    let primitive = room.json["meshes"][0]["primitives"][0].clone();
    for _ in 0..99 {
        room.set("/meshes/0/primitives/-", primitive.clone());
    }
    room.assert_fails(&[DRACO, "split the scene"]);
}
