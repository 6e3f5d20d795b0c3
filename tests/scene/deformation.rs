//! Morph targets and skins.

use glam::Vec3;
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use crate::fixture::{Fixture, assert_close, assert_error, world_soup};

fn lamp(scene: &Scene) -> [Vec3; 3] {
    world_soup(scene)[2]
}

/// The room with a lamp that has two morph targets: the first raises all its corners by 1, the second moves the second
/// corner along x.
fn morphed() -> Fixture {
    let mut room = Fixture::room();
    let raised = room.add_vectors(&[[0.0, 1.0, 0.0]; 3]);
    let moved = room.add_vectors(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]]);
    room.set(
        "/meshes/1/primitives/0/targets",
        json!([{"POSITION": raised}, {"POSITION": moved}]),
    );
    room
}

#[test]
fn morph_targets_follow_the_weights_of_the_node_or_else_of_the_mesh() {
    let mut room = morphed();
    assert_close(lamp(&room.scene())[1], [1.0, 1.0, 0.0]);
    room.set("/meshes/1/weights", json!([0.5, 0]));
    assert_close(lamp(&room.scene())[1], [1.0, 1.5, 0.0]);
    room.set("/nodes/1/weights", json!([0.25, -0.5]));
    let [first, second, _] = lamp(&room.scene());
    assert_close(first, [0.0, 1.25, 0.0]);
    assert_close(second, [0.5, 1.25, 0.0]);
}

#[test]
fn animated_weights_come_first() {
    for (interpolation, values, wanted) in [
        ("LINEAR", &[0.0, 0.0, 1.0, 0.5][..], [1.25, 1.5]),
        ("STEP", &[0.0, -0.5, 1.0, 0.5][..], [0.5, 1.0]),
        // Tangents of zero: halfway at half time.
        (
            "CUBICSPLINE",
            &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0][..],
            [1.25, 1.5],
        ),
    ] {
        let mut room = morphed();
        room.set("/nodes/1/weights", json!([7, 7]));
        let output = room.add_floats("SCALAR", 1, values);
        room.animate(1, "weights", interpolation, &[0.0, 1.0], output);
        let corner = lamp(&room.scene_at(0.5))[1];
        assert_close(corner, [wanted[0], wanted[1], 0.0]);
    }
}

#[test]
fn morphed_normals_are_sums() {
    let mut room = Fixture::room();
    let shift = room.add_vectors(&[[1.0, 0.0, 0.0]; 4]);
    room.set("/meshes/0/primitives/0/targets", json!([{"NORMAL": shift}]));
    room.set("/meshes/0/weights", json!([1]));
    let root = 0.5f32.sqrt();
    assert_close(room.scene().normals[0], [root, root, 0.0]);
}

#[test]
fn damaged_morph_targets_are_named() {
    let mut room = morphed();
    room.set("/meshes/1/primitives/0/targets/1/POSITION", json!(0));
    room.assert_fails(&["morph target 1", "4 shifts for 3 positions"]);
    let mut room = morphed();
    room.set("/nodes/1/weights", json!([1e39, 0]));
    room.assert_fails(&["node 1 \"lamp\"", "morph target 0", "finite"]);
}

/// The room with a lamp whose corners follow the joints 0, 1, and both by half; the second joint is one up and turned.
fn skinned() -> Fixture {
    let mut room = Fixture::room();
    let joints = room.add_accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 3, 5121, "VEC4");
    let weights = [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat();
    let weights = room.add_floats("VEC4", 4, &weights);
    room.set("/meshes/1/primitives/0/attributes/JOINTS_0", json!(joints));
    room.set("/meshes/1/primitives/0/attributes/WEIGHTS_0", json!(weights));
    let first = room.add_root(json!({"name": "hip"}));
    let second = room.add_root(json!({"name": "knee", "translation": [0, 1, 0]}));
    room.set("/skins", json!([{"joints": [first, second]}]));
    room.set("/nodes/1/skin", json!(0));
    room
}

#[test]
fn skinned_vertices_follow_their_joints_and_not_their_node() {
    let mut room = skinned();
    room.set("/nodes/1/translation", json!([50, 0, 0]));
    let [first, second, third] = lamp(&room.scene());
    assert_close(first, [0.0, 1.0, 0.0]);
    assert_close(second, [1.0, 2.0, 0.0]);
    assert_close(third, [0.0, 1.5, 1.0]);
}

#[test]
fn inverse_bind_matrices_undo_the_place_of_a_joint_at_rest() {
    let mut room = skinned();
    let mut matrices = [glam::Mat4::IDENTITY.to_cols_array(); 2];
    matrices[1] = glam::Mat4::from_translation(Vec3::new(0.0, -1.0, 0.0)).to_cols_array();
    let matrices = room.add_floats("MAT4", 16, &matrices.concat());
    room.set("/skins/0/inverseBindMatrices", json!(matrices));
    assert_close(lamp(&room.scene())[1], [1.0, 1.0, 0.0]);
    let output = room.add_vectors(&[[0.0, 1.5, 0.0]]);
    room.animate(4, "translation", "LINEAR", &[0.0], output);
    let [first, second, third] = lamp(&room.scene_at(0.0));
    assert_close(first, [0.0, 1.0, 0.0]);
    assert_close(second, [1.0, 1.5, 0.0]);
    assert_close(third, [0.0, 1.25, 1.0]);
}

#[test]
fn a_mesh_that_cannot_follow_its_skin_follows_its_node_with_a_warning() {
    let mut room = skinned();
    room.remove("/meshes/1/primitives/0/attributes/WEIGHTS_0");
    let scene = room.assert_warns(&["mesh 1 \"lamp\", primitive 0", "skin"]);
    assert_close(lamp(&scene)[1], [1.0, 1.0, 0.0]);
}

#[test]
fn damaged_skins_are_named() {
    let fails = |pointer: &str, value, parts: &[&str]| {
        let mut room = skinned();
        room.set(pointer, value);
        assert_error(room.load(), parts);
    };
    fails("/nodes/1/skin", json!(3), &["node 1 \"lamp\"", "no skin 3"]);
    fails("/skins/0/joints", json!([3]), &["follows joint 1", "the skin has 1"]);
    fails(
        "/skins/0/joints",
        json!([3, 77]),
        &["skin 0", "joint 1", "isn't in the scene"],
    );
    fails(
        "/skins/0/inverseBindMatrices",
        json!(0),
        &["skin 0", "inverseBindMatrices"],
    );
    fails("/meshes/1/primitives/0/attributes/WEIGHTS_0", json!(0), &["WEIGHTS_0"]);
}
