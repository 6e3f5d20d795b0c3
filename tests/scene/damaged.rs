//! Accessors, indices and vertices with invalid values.

use serde_json::{Value, json};

use crate::fixture::Fixture;

/// Checks the message after changing one value of the room.
#[track_caller]
fn assert_change_fails(pointer: &str, value: Value, parts: &[&str]) {
    let mut room = Fixture::room();
    room.set(pointer, value);
    room.assert_fails(parts);
}

#[test]
fn accessors_out_of_bounds_are_named() {
    let position = ["mesh 0 \"floor\", primitive 0", "POSITION", "accessor 0"];
    let with = |part| [position.as_slice(), &[part]].concat();
    assert_change_fails("/accessors/0/count", json!(5), &with("5 elements"));
    assert_change_fails("/accessors/0/byteOffset", json!(4), &with("4 elements from byte 4"));
    assert_change_fails(
        "/bufferViews/0/byteLength",
        json!(47),
        &with("bufferView 0, which has 47"),
    );
    assert_change_fails("/bufferViews/0/byteLength", json!(1_000_000), &with("which has 144"));
    assert_change_fails(
        "/bufferViews/0/byteOffset",
        json!(143),
        &with("from byte 143 of buffer 0"),
    );
    assert_change_fails("/bufferViews/0/byteStride", json!(20), &with("4 elements"));
    assert_change_fails(
        "/bufferViews/0/byteStride",
        json!(8),
        &with("stride of 8 bytes for elements of 12"),
    );
    assert_change_fails("/accessors/2/count", json!(7), &["indices", "accessor 2", "7 elements"]);
    assert_change_fails("/accessors/1/byteOffset", json!(1), &["NORMAL", "accessor 1"]);
}

#[test]
fn counts_and_offsets_that_overflow_are_refused_without_allocating() {
    for huge in [json!(4_000_000_000u64), json!(u64::MAX), json!(u64::MAX / 12 + 1)] {
        assert_change_fails("/accessors/0/count", huge.clone(), &["accessor 0", "elements"]);
        assert_change_fails("/accessors/2/count", huge.clone(), &["accessor 2", "elements"]);
        assert_change_fails("/accessors/0/byteOffset", huge.clone(), &["accessor 0"]);
        assert_change_fails("/bufferViews/0/byteOffset", huge.clone(), &["accessor 0"]);
        assert_change_fails("/bufferViews/0/byteLength", huge.clone(), &["accessor 0"]);
        assert_change_fails("/bufferViews/0/byteStride", huge, &["accessor 0"]);
    }
    assert_change_fails(
        "/accessors/0/count",
        json!(-1),
        &["isn't glTF 2.0", "accessors[0].count"],
    );
    assert_change_fails(
        "/accessors/0/count",
        json!(1.5),
        &["isn't glTF 2.0", "accessors[0].count"],
    );
}

#[test]
fn indices_of_accessors_views_buffers_and_materials_out_of_range_are_named() {
    let mesh = "mesh 0 \"floor\", primitive 0";
    assert_change_fails(
        "/meshes/0/primitives/0/attributes/POSITION",
        json!(99),
        &[mesh, "POSITION", "no accessor 99", "has 4"],
    );
    assert_change_fails(
        "/meshes/0/primitives/0/attributes/NORMAL",
        json!(99),
        &[mesh, "NORMAL", "no accessor 99"],
    );
    assert_change_fails(
        "/meshes/0/primitives/0/indices",
        json!(99),
        &[mesh, "indices", "no accessor 99"],
    );
    assert_change_fails(
        "/accessors/0/bufferView",
        json!(99),
        &[mesh, "no bufferView 99", "has 4"],
    );
    assert_change_fails("/bufferViews/0/buffer", json!(99), &[mesh, "no buffer 99", "has 1"]);
    assert_change_fails(
        "/meshes/0/primitives/0/material",
        json!(99),
        &[mesh, "no material 99", "has 2"],
    );
    assert_change_fails("/meshes/0/primitives/0/mode", json!(99), &[mesh, "mode"]);
}

#[test]
fn accessors_of_the_wrong_type_are_named() {
    assert_change_fails(
        "/accessors/0/type",
        json!("VEC2"),
        &["POSITION, accessor 0", "Vec2", "Vec3"],
    );
    assert_change_fails("/accessors/0/type", json!("VEC9"), &["POSITION, accessor 0", "Vec3"]);
    assert_change_fails(
        "/accessors/0/componentType",
        json!(5123),
        &["POSITION, accessor 0", "U16", "F32"],
    );
    assert_change_fails("/accessors/0/componentType", json!(1), &["POSITION, accessor 0", "F32"]);
    assert_change_fails(
        "/accessors/1/componentType",
        json!(5120),
        &["NORMAL, accessor 1", "I8", "F32"],
    );
    assert_change_fails("/accessors/1/type", json!("SCALAR"), &["NORMAL, accessor 1", "Scalar"]);
    assert_change_fails(
        "/accessors/2/componentType",
        json!(5126),
        &["indices, accessor 2", "F32", "U16"],
    );
    assert_change_fails(
        "/accessors/2/componentType",
        json!(5122),
        &["indices, accessor 2", "I16"],
    );
    assert_change_fails(
        "/accessors/2/type",
        json!("VEC2"),
        &["indices, accessor 2", "Vec2", "Scalar"],
    );
}

#[test]
fn a_damaged_sparse_part_is_named() {
    // The six indices 0 1 2 0 2 3 begin with three that increase.
    let sparse = |count: u64| {
        json!({
            "count": count,
            "indices": {"bufferView": 2, "componentType": 5123},
            "values": {"bufferView": 0}
        })
    };
    let assert_sparse_fails = |change: fn(&mut Value), parts: &[&str]| {
        let mut value = sparse(3);
        change(&mut value);
        assert_change_fails(
            "/accessors/0/sparse",
            value,
            &[&["accessor 0", "sparse"], parts].concat(),
        );
    };
    assert_sparse_fails(|sparse| sparse["count"] = json!(4), &["index 3 is 0", "increase"]);
    assert_sparse_fails(
        |sparse| sparse["count"] = json!(u64::MAX),
        &["don't fit into bufferView 2"],
    );
    assert_sparse_fails(
        |sparse| sparse["indices"]["bufferView"] = json!(9),
        &["no bufferView 9"],
    );
    assert_sparse_fails(
        |sparse| sparse["values"]["bufferView"] = json!(2),
        &["3 elements", "bufferView 2"],
    );
    assert_sparse_fails(
        |sparse| sparse["indices"]["componentType"] = json!(5126),
        &["indices", "doesn't have"],
    );
    let mut room = Fixture::room();
    let indices = room.add_indices(&[4]);
    room.set("/accessors/0/sparse", sparse(1));
    room.set(
        "/accessors/0/sparse/indices/bufferView",
        room.json["accessors"][indices]["bufferView"].clone(),
    );
    room.assert_fails(&["index 0 is 4", "less than 4"]);
}

#[test]
fn elements_that_no_byte_stands_behind_are_few() {
    let mut room = Fixture::room();
    room.remove("/accessors/0/bufferView");
    room.assert_warns(&["dropped 2 triangles", "\"floor\""]);
    room.set("/accessors/0/count", json!(1u64 << 40));
    room.assert_fails(&["accessor 0", "without a bufferView"]);
}

#[test]
fn normals_and_positions_of_different_number_are_refused() {
    let mut room = Fixture::room();
    let normals = room.add_vectors(&[[0.0, 1.0, 0.0]; 5]);
    room.set("/meshes/0/primitives/0/attributes/NORMAL", json!(normals));
    room.assert_fails(&["mesh 0 \"floor\", primitive 0", "5 normals for 4 positions"]);
}

#[test]
fn an_index_past_the_vertices_is_named() {
    let mut room = Fixture::room();
    let indices = room.add_indices(&[0, 1, 2, 0, 2, 4]);
    room.set("/meshes/0/primitives/0/indices", json!(indices));
    room.assert_fails(&["mesh 0 \"floor\", primitive 0", "index 5 is vertex 4", "4 vertices"]);
    let indices = room.add_accessor(&[0xff; 12], 3, 5125, "SCALAR");
    room.set("/meshes/0/primitives/0/indices", json!(indices));
    room.assert_fails(&["index 0 is vertex 4294967295"]);
}

#[test]
fn vertices_that_are_not_finite_are_named() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut room = Fixture::room();
        room.poke(0, 7, value);
        room.assert_fails(&["mesh 0 \"floor\", primitive 0", "position of vertex 2 isn't finite"]);
        let mut room = Fixture::room();
        room.poke(1, 5, value);
        room.assert_fails(&["mesh 0 \"floor\", primitive 0", "normal of vertex 1 isn't finite"]);
    }
}

#[test]
fn primitives_without_vertices_are_skipped() {
    let mut room = Fixture::room();
    for accessor in 0..3 {
        room.set(&format!("/accessors/{accessor}/count"), json!(0));
    }
    assert_eq!(room.scene().objects.len(), 1, "the lamp");
}

#[test]
fn json_of_another_structure_is_refused() {
    let values = [
        json!(null),
        json!(7),
        json!("text"),
        json!([]),
        json!([null]),
        json!({"a": 1}),
    ];
    for key in [
        "accessors",
        "buffers",
        "cameras",
        "materials",
        "meshes",
        "nodes",
        "scenes",
    ] {
        for value in &values {
            let mut room = Fixture::room();
            room.set(&format!("/{key}"), value.clone());
            room.assert_fails(&[]);
        }
    }
}

#[test]
fn buffers_and_triangles_take_no_more_memory_than_the_scene_may() {
    let mut room = Fixture::room();
    let triangles: Vec<u16> = [0, 1, 2].repeat(100_000);
    let indices = room.add_indices(&triangles);
    room.set("/meshes/0/primitives/0/indices", json!(indices));
    room.load_within(16 << 20)
        .expect("600 kB of indices, 2 MB of triangles");
    for (limit, what) in [(100_000, "what its buffers hold"), (1_500_000, "mesh 0")] {
        let error = room.load_within(limit).expect_err("too large").to_string();
        assert!(error.contains(what) && error.contains("allow more"), "{error}");
    }
}
