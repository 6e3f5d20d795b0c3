//! Meshes compressed by `EXT_meshopt_compression`.

use ppm_vk::internals::scene::Scene;
use serde_json::{Value, json};

use crate::encoded::{MESHOPT, compress, meshopt_room};
use crate::fixture::{Fixture, assert_close, assert_error};

#[track_caller]
fn assert_same(scene: &Scene, other: &Scene) {
    assert_eq!(scene.positions, other.positions);
    assert_eq!(scene.normals, other.normals);
    assert_eq!(scene.triangles, other.triangles);
}

#[test]
fn compressed_views_are_restored() {
    let mut room = meshopt_room();
    let plain = Fixture::room().scene();
    let scene = room.scene();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_same(&scene, &plain);
    let encoded = meshopt::encode_index_sequence(&[0, 1, 2, 0, 2, 3], 4).expect("encoded");
    compress(&mut room, 2, &encoded, 4, 6, "INDICES");
    room.set("/accessors/2/componentType", json!(5125));
    assert_same(&room.scene(), &plain);
}

#[test]
fn filters_are_undone() {
    let mut room = meshopt_room();
    let view = |accessor: usize| format!("/bufferViews/{accessor}/extensions/{MESHOPT}/filter");
    let plain = Fixture::room().scene();
    let positions: Vec<[f32; 3]> = room.binary[..48]
        .as_chunks::<12>()
        .0
        .iter()
        .map(|bytes| bytemuck::pod_read_unaligned(bytes))
        .collect();
    let exponential = meshopt::encode_filter_exp(&positions, 15, meshopt::EncodeExpMode::SharedVector);
    let encoded = meshopt::encode_vertex_buffer(&exponential).expect("encoded");
    compress(&mut room, 0, &encoded, 12, 4, "ATTRIBUTES");
    room.set(&view(0), json!("EXPONENTIAL"));
    assert_same(&room.scene(), &plain);

    let normals: Vec<[i8; 4]> = meshopt::encode_filter_oct(&[[0.0, 1.0, 0.0, 0.0]; 4], 8);
    let encoded = meshopt::encode_vertex_buffer(&normals).expect("encoded");
    compress(&mut room, 1, &encoded, 4, 4, "ATTRIBUTES");
    room.set("/bufferViews/1/byteStride", json!(4));
    room.set(&view(1), json!("OCTAHEDRAL"));
    room.set("/accessors/1/componentType", json!(5120));
    room.set("/accessors/1/normalized", json!(true));
    room.set("/extensionsRequired/-", json!("KHR_mesh_quantization"));
    for normal in &room.scene().normals[..4] {
        assert_close(*normal, [0.0, 1.0, 0.0]);
    }
}

#[test]
fn damaged_compression_is_named() {
    let fails = |key: &str, value: Value, parts: &[&str]| {
        let mut room = meshopt_room();
        room.set(&format!("/bufferViews/0/extensions/{MESHOPT}/{key}"), value);
        assert_error(room.load(), &[&["bufferView 0", MESHOPT], parts].concat());
    };
    fails("mode", json!("TEXTURES"), &["TEXTURES"]);
    fails("filter", json!("OCTAHEDRAL"), &["a stride of 12"]);
    fails("byteStride", json!(6), &["a stride of 6"]);
    fails("byteStride", json!(0), &["a stride of 0"]);
    fails("count", json!(5), &["5 elements"]);
    fails("count", json!(u64::MAX), &["elements"]);
    fails("buffer", json!(9), &["buffer 9"]);
    fails("byteLength", json!(1 << 20), &["buffer 0"]);
    fails("byteLength", json!(20), &["20 bytes", "Attributes"]);
    let mut room = meshopt_room();
    room.set("/bufferViews/0/byteLength", json!(12u64 << 40));
    room.set(&format!("/bufferViews/0/extensions/{MESHOPT}/count"), json!(1u64 << 40));
    room.assert_fails(&["can't expand to"]);
}

#[test]
fn required_extensions_that_are_unknown_are_named() {
    for extension in ["KHR_gaussian_splatting", "EXT_not_yet_invented"] {
        let mut room = Fixture::room();
        room.set("/extensionsRequired", json!([extension]));
        room.assert_fails(&["requires", extension]);
    }
}
