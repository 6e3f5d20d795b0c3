//! Sparse and quantised data.

use glam::Vec3;
use serde_json::json;

use crate::fixture::{Fixture, assert_close, soup, winding_normal, world_soup};

#[test]
fn a_sparse_accessor_replaces_elements_of_its_base() {
    let mut lamp = Fixture::lamp();
    lamp.add_sparse(3, &[0, 2], &[[5.0, 6.0, 7.0], [-1.0, -2.0, -3.0]]);
    let [corners] = world_soup(&lamp.scene())[..] else {
        panic!("not a triangle");
    };
    assert_close(corners[0], [5.0, 6.0, 7.0]);
    assert_close(corners[1], [1.0, 1.0, 0.0]);
    assert_close(corners[2], [-1.0, -2.0, -3.0]);
}

#[test]
fn a_sparse_accessor_without_a_base_is_zero_elsewhere() {
    let mut lamp = Fixture::lamp();
    lamp.remove("/accessors/3/bufferView");
    lamp.add_sparse(3, &[1, 2], &[[1.0, 0.0, 0.0], [0.0, 0.0, 4.0]]);
    let [corners] = world_soup(&lamp.scene())[..] else {
        panic!("not a triangle");
    };
    assert_close(corners[0], [0.0, 0.0, 0.0]);
    assert_close(corners[1], [1.0, 0.0, 0.0]);
    assert_close(corners[2], [0.0, 0.0, 4.0]);
}

#[test]
fn sparse_indices_of_triangles_count() {
    let mut room = Fixture::room();
    let original = soup(&room.scene());
    // The third corner of the first triangle becomes vertex 3.
    let places = room.add_accessor(&[2], 1, 5121, "SCALAR");
    let replaced = room.add_indices(&[3]);
    let view = |accessor: usize| room.json["accessors"][accessor]["bufferView"].clone();
    let sparse = json!({
        "count": 1,
        "indices": {"bufferView": view(places), "componentType": 5121},
        "values": {"bufferView": view(replaced)}
    });
    room.set("/accessors/2/sparse", sparse);
    let changed = soup(&room.scene());
    assert_eq!(changed[0], [original[0][0], original[0][1], original[1][2]]);
    assert_eq!(changed[1], original[1]);
}

/// The corners of a cube from −1 to 1.
fn cube_corners() -> [[i8; 3]; 8] {
    std::array::from_fn(|corner| std::array::from_fn(|axis| if corner >> axis & 1 == 0 { -1 } else { 1 }))
}

/// The faces of that cube, counter-clockwise from outside.
const CUBE: [u16; 36] = [
    0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6,
];

/// A room whose floor is the cube with smooth normals; `add` makes the accessors of positions and normals.
fn cube_room(add: impl FnOnce(&mut Fixture) -> [usize; 2]) -> Fixture {
    let mut room = Fixture::room();
    let [positions, normals] = add(&mut room);
    let indices = room.add_indices(&CUBE);
    room.set(
        "/meshes/0/primitives/0",
        json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices, "material": 0}),
    );
    room
}

fn float_cube() -> Fixture {
    cube_room(|room| {
        let corners = cube_corners().map(|corner| corner.map(f32::from));
        let positions = room.add_vectors(&corners);
        [positions, positions]
    })
}

/// The cube's corners from the bytes of each coordinate; every element is padded to a multiple of four, as vertex attributes
/// must be.
fn encoded(encode: impl Fn(i8) -> Vec<u8>) -> Vec<u8> {
    let element = |corner: [i8; 3]| {
        let mut bytes: Vec<u8> = corner.into_iter().flat_map(&encode).collect();
        bytes.resize(bytes.len().next_multiple_of(4), 0xff);
        bytes
    };
    cube_corners().into_iter().flat_map(element).collect()
}

/// Adds an accessor of eight VEC3 in a stride of `bytes.len() / 8`.
fn add_quantized(room: &mut Fixture, bytes: &[u8], component: u32, is_normalized: bool) -> usize {
    let accessor = room.add_accessor(bytes, 8, component, "VEC3");
    let view = room.json["accessors"][accessor]["bufferView"].clone();
    room.set(&format!("/bufferViews/{view}/byteStride"), json!(bytes.len() / 8));
    room.set(&format!("/accessors/{accessor}/normalized"), json!(is_normalized));
    room.set("/extensionsUsed", json!(["KHR_mesh_quantization"]));
    room.set("/extensionsRequired", json!(["KHR_mesh_quantization"]));
    accessor
}

#[test]
fn a_quantised_cube_is_the_cube_of_floats() {
    let wanted = float_cube().scene();
    assert_close(winding_normal(&wanted, 0), [-1.0, 0.0, 0.0]);
    assert_close(wanted.normals[0], Vec3::splat(-1.0).normalize().to_array());
    // (component type, normalised, from −1 or 1 to bytes, translation and scale that undo the quantisation)
    type Case = (u32, bool, fn(i8) -> Vec<u8>, [f64; 3], f64);
    let cases: [Case; 8] = [
        (5120, true, |at| vec![(127 * at) as u8], [0.0; 3], 1.0),
        // −128 is −1 as well.
        (5120, true, |at| vec![if at < 0 { 0x80 } else { 127 }], [0.0; 3], 1.0),
        (5120, false, |at| vec![(100 * at) as u8], [0.0; 3], 0.01),
        (5121, true, |at| vec![if at < 0 { 0 } else { 255 }], [-1.0; 3], 2.0),
        (5121, false, |at| vec![if at < 0 { 10 } else { 210 }], [-1.1; 3], 0.01),
        (
            5122,
            true,
            |at| (i16::from(at) * 32767).to_le_bytes().into(),
            [0.0; 3],
            1.0,
        ),
        (
            5122,
            false,
            |at| (i16::from(at) * 20000).to_le_bytes().into(),
            [0.0; 3],
            5e-5,
        ),
        (
            5123,
            false,
            |at| if at < 0 { vec![0, 0] } else { vec![0x40, 0x9c] },
            [-1.0; 3],
            5e-5,
        ),
    ];
    for (component, is_normalized, encode, translation, scale) in cases {
        let mut room = cube_room(|room| {
            let positions = add_quantized(room, &encoded(encode), component, is_normalized);
            let normals = encoded(|at| (i16::from(at) * 32767).to_le_bytes().into());
            [positions, add_quantized(room, &normals, 5122, true)]
        });
        room.set("/nodes/0/translation", json!(translation));
        room.set("/nodes/0/scale", json!([scale, scale, scale]));
        let scene = room.scene();
        assert_eq!(scene.warnings, [""; 0]);
        assert_eq!(scene.triangles, wanted.triangles);
        // f32 represents the scale of the node to a relative 6e-8; 40000 of them are 2.
        for (found, wanted) in scene.positions.iter().zip(&wanted.positions) {
            assert!(
                found.abs_diff_eq(*wanted, 4e-7),
                "{component} {is_normalized}: {found}, not {wanted}"
            );
        }
        for (found, wanted) in scene.normals.iter().zip(&wanted.normals) {
            assert_close(*found, wanted.to_array());
        }
    }
}

#[test]
fn quantised_normals_of_a_byte_are_read() {
    let wanted = float_cube().scene();
    let room = cube_room(|room| {
        let positions = room.add_vectors(&cube_corners().map(|corner| corner.map(f32::from)));
        let normals = encoded(|at| vec![(127 * at) as u8]);
        [positions, add_quantized(room, &normals, 5120, true)]
    });
    assert_eq!(room.scene().normals, wanted.normals);
}

#[test]
fn quantised_data_needs_the_extension() {
    let mut room = float_cube();
    let bytes = encoded(|at| vec![at as u8]);
    let positions = add_quantized(&mut room, &bytes, 5120, false);
    room.set("/meshes/0/primitives/0/attributes/POSITION", json!(positions));
    room.scene();
    room.remove("/extensionsUsed");
    room.remove("/extensionsRequired");
    room.assert_fails(&["POSITION", "I8", "F32"]);
    // Directions are fractions, not numbers.
    room.set("/extensionsUsed", json!(["KHR_mesh_quantization"]));
    room.set("/meshes/0/primitives/0/attributes/NORMAL", json!(positions));
    room.assert_fails(&["NORMAL", "I8", "normalized I8"]);
}
