//! Texture coordinates, colours and tangents of vertices.

use glam::{Vec2, Vec3, Vec4};
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use crate::fixture::{Fixture, assert_close};

/// Attributes of the vertices of the floor (four) and of the lamp (three).
fn assert_lengths(scene: &Scene, texcoords: usize, colors: usize, tangents: usize) {
    assert_eq!(scene.positions.len(), 7);
    assert_eq!(
        [scene.texcoords.len(), scene.colors.len(), scene.tangents.len()],
        [texcoords, colors, tangents]
    );
}

#[test]
fn attributes_that_no_primitive_has_take_no_room() {
    assert_lengths(&Fixture::room().scene(), 0, 0, 0);
}

#[test]
fn texture_coordinates_of_both_sets_are_read() {
    let mut room = Fixture::room();
    let first = room.add_floats("VEC2", 2, &[0.0, 0.0, 0.0, 1.0, 2.5, 1.0, 1.0, -3.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(first));
    let scene = room.scene();
    assert_lengths(&scene, 7, 0, 0);
    assert_eq!(scene.texcoords[2], [Vec2::new(2.5, 1.0), Vec2::ZERO]);
    assert_eq!(scene.texcoords[3], [Vec2::new(1.0, -3.0), Vec2::ZERO]);
    assert_eq!(scene.texcoords[4], [Vec2::ZERO; 2], "the lamp has none");

    let bytes = room.add_accessor(&[0, 255, 51, 102, 0, 0], 3, 5121, "VEC2");
    room.set(&format!("/accessors/{bytes}/normalized"), json!(true));
    room.set("/meshes/1/primitives/0/attributes/TEXCOORD_1", json!(bytes));
    let scene = room.scene();
    assert_eq!(scene.texcoords[2][0], Vec2::new(2.5, 1.0));
    assert_eq!(scene.texcoords[4], [Vec2::ZERO, Vec2::new(0.0, 1.0)]);
    assert_eq!(scene.texcoords[5], [Vec2::ZERO, Vec2::new(0.2, 0.4)]);
}

#[test]
fn colours_are_read_and_white_elsewhere() {
    for lamp_only in [false, true] {
        let mut room = Fixture::room();
        let (mesh, count, first) = if lamp_only { (1, 3, 4) } else { (0, 4, 0) };
        let colors = room.add_vectors(&vec![[0.25, 0.5, 0.75]; count]);
        room.set(
            &format!("/meshes/{mesh}/primitives/0/attributes/COLOR_0"),
            json!(colors),
        );
        let scene = room.scene();
        assert_lengths(&scene, 0, 7, 0);
        for (vertex, &color) in scene.colors.iter().enumerate() {
            let is_coloured = (first..first + count).contains(&vertex);
            let wanted = if is_coloured {
                Vec4::new(0.25, 0.5, 0.75, 1.0)
            } else {
                Vec4::ONE
            };
            assert_eq!(color, wanted, "vertex {vertex}");
        }
    }
    let mut room = Fixture::room();
    let colors = room.add_accessor(&[0, 51, 102, 153].repeat(4), 4, 5121, "VEC4");
    room.set(&format!("/accessors/{colors}/normalized"), json!(true));
    room.set("/meshes/0/primitives/0/attributes/COLOR_0", json!(colors));
    let color = Vec4::new(0.0, 0.2, 0.4, 0.6);
    assert!(room.scene().colors[0].abs_diff_eq(color, 1e-7));
    room.remove(&format!("/accessors/{colors}/normalized"));
    let scene = room.assert_warns(&["accessor", "colours", "aren't normalized"]);
    assert!(scene.colors[0].abs_diff_eq(color, 1e-7));
}

#[test]
fn tangents_follow_the_surface_and_keep_their_bitangents() {
    // The bitangent of the floor is normal × tangent = y × (1, 0, 1) = (1, 0, −1), up to its length.
    let mut room = Fixture::room();
    let tangents = room.add_floats("VEC4", 4, &[3.0, 0.0, 3.0, 1.0].repeat(4));
    room.set("/meshes/0/primitives/0/attributes/TANGENT", json!(tangents));
    for scale in [
        [1.0, 1.0, 1.0],
        [2.0, 1.0, 4.0],
        [-1.0, 1.0, 1.0],
        [1.0, -1.0, 1.0],
        [-2.0, 3.0, -4.0],
    ] {
        room.set("/nodes/0/scale", json!(scale));
        let scene = room.scene();
        assert_lengths(&scene, 0, 0, 7);
        let scale = Vec3::from(scale.map(|factor| factor as f32));
        let tangent = scene.tangents[0];
        assert_close(
            tangent.truncate(),
            (scale * Vec3::new(1.0, 0.0, 1.0)).normalize().to_array(),
        );
        // Not at right angles after scaling, but on the same side of the tangent.
        let bitangent = tangent.w * scene.normals[0].cross(tangent.truncate());
        assert!(bitangent.dot(scale * Vec3::new(1.0, 0.0, -1.0)) > 0.0, "{scale}");
        assert_eq!(tangent.w.abs(), 1.0);
        assert_eq!(scene.tangents[5], Vec4::ZERO, "the lamp has none");
    }
    room.set("/nodes/0/scale", json!([1, 1, 1]));
    room.remove("/meshes/0/primitives/0/attributes/NORMAL");
    assert_eq!(room.scene().tangents, [], "without normals they mean nothing");
}

#[test]
fn flat_shaded_vertices_have_their_attributes_too() {
    let mut room = Fixture::room();
    room.remove("/meshes/0/primitives/0/attributes/NORMAL");
    let first = room.add_floats("VEC2", 2, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(first));
    let scene = room.scene();
    assert_eq!(scene.positions.len(), 6 + 3);
    for (position, [texcoord, _]) in scene.positions.iter().zip(&scene.texcoords).take(6) {
        assert_eq!(0.5 * (Vec2::new(position.x, position.z) + 1.0), *texcoord);
    }
}

#[test]
fn attributes_that_are_not_finite_are_left_out_with_a_warning() {
    let mut room = Fixture::room();
    let first = room.add_floats("VEC2", 2, &[f32::NAN, 0.0, 0.0, f32::INFINITY, 1.0, 1.0, 1.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(first));
    let scene = room.assert_warns(&["2 texture coordinates", "finite"]);
    assert_eq!(scene.texcoords[0], [Vec2::ZERO; 2]);
    assert_eq!(scene.texcoords[1], [Vec2::ZERO; 2]);
    assert_eq!(scene.texcoords[2], [Vec2::ONE, Vec2::ZERO]);
}

#[test]
fn attributes_of_another_number_or_type_are_refused() {
    for (attribute, parts) in [
        ("TEXCOORD_0", ["TEXCOORD_0, accessor 1", "Vec2"]),
        ("TEXCOORD_1", ["TEXCOORD_1, accessor 1", "Vec2"]),
        ("TANGENT", ["TANGENT, accessor 1", "Vec4"]),
    ] {
        let mut room = Fixture::room();
        room.set(&format!("/meshes/0/primitives/0/attributes/{attribute}"), json!(1));
        room.assert_fails(&parts);
    }
    let mut room = Fixture::room();
    room.set("/meshes/0/primitives/0/attributes/COLOR_0", json!(3));
    room.assert_fails(&["3 colours for 4 positions"]);
    room.set("/meshes/0/primitives/0/attributes/COLOR_0", json!(2));
    room.assert_fails(&["COLOR_0, accessor 2", "Vec3 or Vec4"]);
}
