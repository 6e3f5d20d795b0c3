//! Nodes at a time of the file's animations.

use glam::{Quat, Vec3};
use ppm_vk::internals::scene::Scene;
use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close, assert_error, world_soup};

/// The lamp's first corner, which is (0, 1, 0) at rest.
fn lamp_corner(scene: &Scene) -> Vec3 {
    world_soup(scene)[2][0]
}

/// The room with the lamp's node at (x, 0, 0).
#[track_caller]
fn assert_lamp_at(room: &Fixture, time: f64, x: f32) {
    assert_close(lamp_corner(&room.scene_at(time)), [x, 1.0, 0.0]);
}

/// A value along x for each number.
fn along_x(values: &[f32]) -> Vec<[f32; 3]> {
    values.iter().map(|&x| [x, 0.0, 0.0]).collect()
}

#[test]
fn without_a_time_everything_is_at_rest_with_a_warning() {
    let mut room = Fixture::room();
    let output = room.add_vectors(&along_x(&[0.5, 0.75]));
    room.animate(1, "translation", "LINEAR", &[0.0, 1.0], output);
    let scene = room.assert_warns(&["animations", "need a time"]);
    assert_close(lamp_corner(&scene), [0.0, 1.0, 0.0]);
}

#[test]
fn linear_values_are_interpolated_and_held_at_the_ends() {
    let mut room = Fixture::room();
    let output = room.add_vectors(&along_x(&[-0.5, 0.5, 0.0]));
    room.animate(1, "translation", "LINEAR", &[1.0, 2.0, 4.0], output);
    for (time, x) in [
        (-3.0, -0.5),
        (1.0, -0.5),
        (1.25, -0.25),
        (2.0, 0.5),
        (3.0, 0.25),
        (4.0, 0.0),
        (1e9, 0.0),
    ] {
        assert_lamp_at(&room, time, x);
    }
}

#[test]
fn steps_hold_a_value_until_the_next_keyframe() {
    let mut room = Fixture::room();
    let output = room.add_vectors(&along_x(&[-0.5, 0.5]));
    room.animate(1, "translation", "STEP", &[1.0, 2.0], output);
    for (time, x) in [(0.0, -0.5), (1.999, -0.5), (2.0, 0.5), (3.0, 0.5)] {
        assert_lamp_at(&room, time, x);
    }
}

#[test]
fn cubic_splines_follow_their_tangents() {
    // p(t) = (2t³ − 3t² + 1) v₀ + Δ (t³ − 2t² + t) b₀ + (3t² − 2t³) v₁ + Δ (t³ − t²) a₁, by glTF 2.0, appendix C.
    let mut room = Fixture::room();
    let output = room.add_vectors(&along_x(&[9.0, -0.5, 0.8, 0.4, 0.5, 9.0]));
    room.animate(1, "translation", "CUBICSPLINE", &[1.0, 3.0], output);
    let middle = 0.5 * -0.5 + 2.0 * 0.125 * 0.8 + 0.5 * 0.5 + 2.0 * -0.125 * 0.4;
    for (time, x) in [(0.0, -0.5), (1.0, -0.5), (2.0, middle), (3.0, 0.5), (9.0, 0.5)] {
        assert_lamp_at(&room, time, x);
    }
}

#[test]
fn rotations_take_the_shorter_way_and_scales_follow() {
    let mut room = Fixture::room();
    // A quarter turn about y; the negated quaternion is the same rotation.
    let turned = -Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    let rotations = [Quat::IDENTITY.to_array(), turned.to_array()].concat();
    let rotations = room.add_floats("VEC4", 4, &rotations);
    room.animate(1, "rotation", "LINEAR", &[0.0, 1.0], rotations);
    let scales = room.add_vectors(&[[1.0; 3], [0.5; 3]]);
    room.animate(1, "scale", "LINEAR", &[0.0, 1.0], scales);
    let corner = world_soup(&room.scene_at(0.5))[2][1];
    let root = 0.75 * 0.5f32.sqrt();
    assert_close(corner, [root, 0.75, -root]);
}

#[test]
fn normalised_integers_serve_as_rotations() {
    let mut room = Fixture::room();
    let bytes: Vec<u8> = [0i16, 23170, 0, 23170]
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    let rotation = room.add_accessor(&bytes, 1, 5122, "VEC4");
    room.set(&format!("/accessors/{rotation}/normalized"), json!(true));
    room.animate(1, "rotation", "LINEAR", &[0.0], rotation);
    assert_close(world_soup(&room.scene_at(0.0))[2][1], [0.0, 1.0, -1.0]);
}

#[test]
fn children_and_cameras_move_with_their_parents() {
    let mut room = Fixture::room();
    room.set("/scenes/0/nodes", json!([0, 1]));
    room.set("/nodes/1/children", json!([2]));
    let output = room.add_vectors(&along_x(&[0.5]));
    room.animate(1, "translation", "LINEAR", &[0.0], output);
    let scene = room.scene_at(0.0);
    let position = scene.cameras[0].position.as_dvec3() / scene.normalisation.scale + scene.normalisation.centre;
    assert_close(position.as_vec3(), [0.5, 0.5, 4.0]);
}

#[test]
fn two_animations_of_one_property_are_named() {
    let mut room = Fixture::room();
    let first = room.add_vectors(&along_x(&[0.25]));
    room.animate(1, "translation", "LINEAR", &[0.0], first);
    let second = room.add_vectors(&along_x(&[0.5]));
    room.animate(1, "translation", "LINEAR", &[0.0], second);
    let scene = room.load_at(0.0).expect("it loads");
    assert_eq!(scene.warnings.len(), 1);
    assert!(
        scene.warnings[0].contains("the translation of node 1 \"lamp\""),
        "{}",
        scene.warnings[0]
    );
    assert_close(lamp_corner(&scene), [0.5, 1.0, 0.0]);
}

#[test]
fn a_node_with_a_matrix_stays_where_it_is() {
    let mut room = Fixture::room();
    let output = room.add_vectors(&along_x(&[0.5]));
    room.animate(1, "translation", "LINEAR", &[0.0], output);
    room.set(
        "/nodes/1/matrix",
        json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
    );
    let scene = room.load_at(0.0).expect("it loads");
    assert!(scene.warnings[0].contains("matrix"), "{:?}", scene.warnings);
    assert_close(lamp_corner(&scene), [0.0, 1.0, 0.0]);
}

#[test]
fn damaged_animations_are_named() {
    let index_of = |room: &Fixture, end: &str| {
        let index = room.json["animations"][0]["samplers"][0][end].as_u64();
        index.expect("an index") as usize
    };
    let fails = |change: &dyn Fn(&mut Fixture), parts: &[&str]| {
        let mut room = Fixture::room();
        let output = room.add_vectors(&along_x(&[0.0, 0.5]));
        room.animate(1, "translation", "LINEAR", &[0.0, 1.0], output);
        change(&mut room);
        assert_error(room.load_at(0.5), parts);
    };
    let set_fails = |pointer: &str, value: Value, parts: &[&str]| {
        fails(
            &|room| _ = room.set(&format!("/animations/0/{pointer}"), value.clone()),
            parts,
        );
    };
    set_fails(
        "channels/0/sampler",
        json!(7),
        &["animation 0, channel 0", "no sampler 7"],
    );
    set_fails("channels/0/target/node", json!(70), &["no node 70"]);
    set_fails("channels/0/target/path", json!("colour"), &["path"]);
    set_fails("samplers/0/interpolation", json!("ROUND"), &["interpolation"]);
    set_fails("samplers/0/output", json!(3), &["output", "3 elements", "need 2"]);
    set_fails("samplers/0/input", json!(99), &["input", "no accessor 99"]);
    fails(&|room| _ = room.poke(index_of(room, "input"), 1, 0.0), &["keyframe 1"]);
    fails(
        &|room| _ = room.poke(index_of(room, "output"), 0, f32::NAN),
        &["keyframe 0", "finite"],
    );
}
