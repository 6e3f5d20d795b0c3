//! Tangents that the file does not have.

use glam::{Vec3, Vec4};
use ppm_vk::Remark;
use serde_json::json;

use crate::fixture::{Fixture, assert_close};

/// The room with texture coordinates on the floor, the texture's left along −x and its top along −z, and a material that
/// has a normal texture.
fn textured() -> Fixture {
    let mut room = Fixture::room();
    let texcoords = room.add_floats("VEC2", 2, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    room.set("/materials/0/normalTexture", json!({"index": 0}));
    room.set("/textures", json!([{}]));
    room
}

#[test]
fn a_normal_texture_gets_tangents_along_u_and_up() {
    let scene = textured().scene();
    assert_eq!(scene.tangents.len(), scene.positions.len());
    for (&tangent, &normal) in scene.tangents.iter().zip(&scene.normals).take(4) {
        assert_close(tangent.truncate(), [1.0, 0.0, 0.0]);
        // glTF's bitangent points up the texture, against v.
        let bitangent = tangent.w * normal.cross(tangent.truncate());
        assert_close(bitangent, [0.0, 0.0, -1.0]);
    }
    assert!(scene.tangents[4..].iter().all(|&tangent| tangent == Vec4::ZERO));
}

#[test]
fn a_mirrored_texture_turns_the_bitangent_round_and_splits_the_seam() {
    let mut room = textured();
    // The two triangles of the floor share an edge; u is reversed on the second.
    let texcoords = room.add_floats("VEC2", 2, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, -1.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    let scene = room.scene();
    let signs: Vec<f32> = scene.triangles[..2]
        .iter()
        .map(|triangle| scene.tangents[triangle.vertices[0] as usize].w)
        .collect();
    assert_eq!(signs[0], -signs[1]);
    assert_eq!(scene.positions.len(), 6 + 3, "two vertices lie on the seam");
}

#[test]
fn without_a_normal_texture_none_are_made() {
    let mut room = textured();
    room.remove("/materials/0/normalTexture");
    assert!(room.scene().tangents.is_empty());
}

#[test]
fn triangles_beyond_number_around_a_point_are_named() {
    let mut room = textured();
    let rim = (0..5000).map(|at| {
        let angle = at as f32 * 1e-3;
        [angle.cos(), 0.0, -angle.sin()]
    });
    let positions: Vec<[f32; 3]> = std::iter::once([0.0; 3]).chain(rim).collect();
    let texcoords = room.add_floats("VEC2", 2, &vec![0.5; 2 * positions.len()]);
    let positions = room.add_vectors(&positions);
    room.set(
        "/meshes/0/primitives/0",
        json!({"attributes": {"POSITION": positions, "TEXCOORD_0": texcoords}, "material": 0, "mode": 6}),
    );
    let scene = room.scene();
    assert!(scene.tangents.is_empty());
    let warnings = scene.warnings[0].text();
    assert!(
        warnings.contains("mesh 0 \"floor\", primitive 0: its material needs tangents")
            && warnings.contains("triangles meet in a point"),
        "{warnings}"
    );
}

#[test]
fn tangents_that_lack_texture_coordinates_are_named() {
    let mut room = textured();
    room.remove("/meshes/0/primitives/0/attributes/TEXCOORD_0");
    let warnings = room.scene().warnings;
    let parts = [
        "primitive 0: its material needs tangents",
        "it has no texture coordinates",
    ];
    let named = |warning: &Remark| parts.iter().all(|part| warning.contains(part));
    assert!(warnings.iter().any(named), "{warnings:#?}");
}

#[test]
fn the_second_set_serves_where_the_texture_asks_for_it() {
    let mut room = textured();
    let turned = room.add_floats("VEC2", 2, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_1", json!(turned));
    room.set("/materials/0/normalTexture/texCoord", json!(1));
    assert_close(room.scene().tangents[0].truncate(), Vec3::Z.to_array());
}

#[test]
fn anisotropy_gets_tangents_by_its_texture_or_else_by_the_first_set() {
    let mut room = textured();
    room.remove("/materials/0/normalTexture");
    let turned = room.add_floats("VEC2", 2, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_1", json!(turned));
    let mut tangent = |extension| {
        room.set("/materials/0/extensions/KHR_materials_anisotropy", extension);
        room.scene().tangents.first().map(|tangent| tangent.truncate())
    };
    let texture = json!({"index": 0, "texCoord": 1});
    let by_texture = tangent(json!({"anisotropyStrength": 1, "anisotropyTexture": texture}));
    assert_close(by_texture.expect("tangents"), Vec3::Z.to_array());
    let by_first = tangent(json!({"anisotropyStrength": 1}));
    assert_close(by_first.expect("tangents"), Vec3::X.to_array());
    assert_eq!(tangent(json!({"anisotropyTexture": texture})), None);
}
