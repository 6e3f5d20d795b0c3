//! Cameras, and scenes without a camera.

use std::f32::consts::FRAC_1_SQRT_2;

use glam::Vec3;
use ppm_vk::internals::scene::{Camera, Projection};
use serde_json::json;

use crate::fixture::{Fixture, assert_close};

#[track_caller]
fn assert_frame(camera: &Camera, right: [f32; 3], up: [f32; 3], forward: [f32; 3]) {
    assert_close(camera.right, right);
    assert_close(camera.up, up);
    assert_close(camera.forward, forward);
}

#[track_caller]
fn tan_half_fov(camera: &Camera) -> f32 {
    match camera.projection {
        Projection::Perspective { tan_half_fov } => tan_half_fov,
        projection => panic!("{projection:?}"),
    }
}

#[test]
fn a_camera_looks_along_minus_z_with_y_up() {
    let scene = Fixture::room().scene();
    let camera = &scene.cameras[0];
    assert_frame(camera, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]);
    assert_close(camera.position, [0.0, 0.0, 4.0]);
    let tan_half_fov = tan_half_fov(camera);
    assert!((tan_half_fov - 0.5f32.tan()).abs() < 1e-6, "{tan_half_fov}");
    assert_eq!(camera.aspect, Some(2.0));
    assert_eq!(
        camera.name, "eye",
        "named after its node where it has no name of its own"
    );
}

#[test]
fn a_camera_turns_with_its_node_and_parents() {
    let mut room = Fixture::room();
    // A quarter turn about x turns its view from −z to +y.
    room.set("/nodes/2/rotation", json!([FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]));
    assert_frame(
        &room.scene().cameras[0],
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
    );
    // A quarter turn of the whole about z takes +y to −x.
    room.add_parent(json!({"rotation": [0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]}));
    assert_frame(
        &room.scene().cameras[0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [-1.0, 0.0, 0.0],
    );
}

#[test]
fn a_cameras_own_scale_is_ignored() {
    let original = Fixture::room().scene().cameras.remove(0);
    for scale in [
        [5.0, 0.1, 3.0],
        [-1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [-2.0, -2.0, -2.0],
        [0.0, 0.0, 0.0],
    ] {
        let mut room = Fixture::room();
        room.set("/nodes/2/scale", json!(scale));
        assert_eq!(room.scene().cameras[0], original, "{scale:?}");
    }
}

#[test]
fn a_scaled_root_moves_a_camera_and_leaves_its_frame_orthonormal() {
    let mut room = Fixture::room();
    room.set("/nodes/2/rotation", json!([0.1, 0.2, 0.3, 0.9]));
    room.add_parent(json!({"scale": [2, 3, 0.5]}));
    let scene = room.scene();
    let camera = &scene.cameras[0];
    assert_close(camera.right.cross(camera.up), (-camera.forward).to_array());
    for axis in [camera.right, camera.up, camera.forward] {
        assert!((axis.length() - 1.0).abs() < 1e-6, "{axis}");
    }
    // The longest half axis is 2 now, along x; the camera stood 4 away along z, which is halved.
    assert_close(camera.position, [0.0, 0.0, 1.0]);
}

#[test]
fn a_mirrored_root_turns_the_gaze_with_the_scene_and_keeps_the_picture_right_handed() {
    let mut room = Fixture::room();
    room.add_parent(json!({"scale": [-1, 1, 1]}));
    assert_frame(
        &room.scene().cameras[0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, -1.0],
    );

    let mut room = Fixture::room();
    room.add_parent(json!({"scale": [-1, -1, -1]}));
    let scene = room.scene();
    assert_frame(&scene.cameras[0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]);
    assert_close(scene.cameras[0].position, [0.0, 0.0, -4.0]);
}

#[test]
fn a_camera_without_a_direction_is_skipped_with_a_warning() {
    let mut room = Fixture::room();
    room.set("/cameras/-", room.json["cameras"][0].clone());
    room.set("/cameras/1/name", json!("flat"));
    let child = room.add_root(json!({"camera": 1}));
    room.set("/scenes/0/nodes", json!([0, 1, 2, child + 1]));
    room.set("/nodes/-", json!({"scale": [1, 1, 0], "children": [child]}));
    let scene = room.assert_warns(&["camera 1 \"flat\"", "no direction", "skipped"]);
    assert_eq!(scene.cameras.len(), 1);
}

#[test]
fn an_orthographic_camera_shows_twice_its_magnifications() {
    let mut room = Fixture::room();
    room.set(
        "/cameras/-",
        json!({"name": "plan", "type": "orthographic",
               "orthographic": {"xmag": 3, "ymag": -2, "zfar": 10, "znear": 0.1}}),
    );
    room.add_root(json!({"camera": 1}));
    let scene = room.scene();
    let camera = &scene.cameras[1];
    let half_height = 2.0 * scene.normalisation.scale as f32;
    assert_eq!(camera.projection, Projection::Orthographic { half_height });
    assert_eq!((camera.name.as_str(), camera.aspect), ("plan", Some(1.5)));
    for (projection, part) in [
        (json!({"xmag": 0, "ymag": 1, "zfar": 10, "znear": 0.1}), "xmag is 0"),
        (json!({"xmag": 1, "ymag": 1e-40, "zfar": 10, "znear": 0.1}), "ymag"),
    ] {
        room.set("/cameras/1/orthographic", projection);
        room.assert_fails(&["camera 1 \"plan\"", part]);
    }
    room.remove("/cameras/1/orthographic");
    room.assert_fails(&["camera 1 \"plan\"", "no such projection"]);
}

#[test]
fn a_lens_is_focused_on_the_centre_of_the_scene_or_at_the_given_distance() {
    let scene = Fixture::room().scene();
    let camera = &scene.cameras[0];
    let scale = scene.normalisation.scale as f32;
    let close = |found: f32, expected: f32| (found / expected - 1.0).abs() < 1e-5;
    let told = scene.lens(camera, 0.1, Some(3.0)).expect("a lens");
    assert!(
        close(told.radius, 0.1 * scale) && close(told.focus, 3.0 * scale),
        "{told:?}"
    );
    let (lower, upper) = scene.bounds();
    let by_itself = scene.lens(camera, 0.1, None).expect("a lens");
    let depth = (0.5 * (lower + upper) - camera.position).dot(camera.forward);
    assert!(close(by_itself.focus, depth), "{by_itself:?}");
    let turned = Camera {
        forward: -camera.forward,
        ..camera.clone()
    };
    let error = scene.lens(&turned, 0.1, None).expect_err("an error").to_string();
    assert!(error.contains("focus distance"), "{error}");
}

#[test]
fn without_a_camera_the_bounds_are_framed_with_a_warning() {
    for scale in [[1.0, 1.0, 1.0], [0.01, 1.0, 1.0], [1.0, 20.0, 1.0], [1.0, 1.0, 50.0]] {
        let mut room = Fixture::room();
        room.set("/scenes/0/nodes", json!([0, 1]));
        room.add_parent(json!({"scale": scale}));
        let scene = room.assert_warns(&["no camera", "framed"]);
        let camera = &scene.cameras[0];
        assert!(
            camera.forward.z < -0.9 && camera.forward.y < 0.0,
            "from slightly above: {}",
            camera.forward
        );
        let mut fullest: f32 = 0.0;
        let (lower, upper) = scene.bounds();
        for corner in 0..8 {
            let pick = |axis: usize| {
                if corner >> axis & 1 == 0 {
                    lower[axis]
                } else {
                    upper[axis]
                }
            };
            let offset = Vec3::new(pick(0), pick(1), pick(2)) - camera.position;
            let depth = offset.dot(camera.forward) * tan_half_fov(camera);
            assert!(depth > 0.0, "{scale:?}: a corner lies behind the camera");
            fullest = fullest.max(offset.dot(camera.up).abs() / depth);
            fullest = fullest.max(offset.dot(camera.right).abs() / depth);
        }
        assert!(
            (0.8..=1.0).contains(&fullest),
            "{scale:?}: the bounds fill {fullest} of the picture"
        );
    }
}

#[test]
fn cameras_are_found_by_name_or_number() {
    let mut room = Fixture::room();
    room.set("/cameras/-", room.json["cameras"][0].clone());
    room.set("/cameras/1/name", json!("top view"));
    room.add_root(json!({"camera": 1}));
    room.set("/cameras/-", room.json["cameras"][0].clone());
    room.add_root(json!({"camera": 2}));
    let scene = room.scene();
    let names: Vec<_> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["eye", "top view", "camera 2"]);
    let index = |wanted| scene.camera_index(wanted).expect("a camera");
    assert_eq!(index(None), 0);
    assert_eq!(index(Some("eye")), 0);
    assert_eq!(index(Some("top view")), 1);
    assert_eq!(index(Some("2")), 2);
    for wanted in ["side", "3", "-1", ""] {
        let message = scene
            .camera_index(Some(wanted))
            .expect_err("no such camera")
            .to_string();
        assert!(message.contains(&format!("no camera \"{wanted}\"")), "{message}");
        assert!(
            message.contains("0 \"eye\", 1 \"top view\" and 2 \"camera 2\""),
            "{message}"
        );
    }
}

#[test]
fn bad_cameras_are_named() {
    let cases = [
        ("/cameras/0/perspective/yfov", json!(0), "yfov is 0"),
        ("/cameras/0/perspective/yfov", json!(-1), "yfov is -1"),
        ("/cameras/0/perspective/yfov", json!(3.2), "yfov is 3.2"),
        ("/cameras/0/perspective/yfov", json!(1e-45), "yfov is 0.0000"),
        ("/cameras/0/perspective/yfov", json!(1e39), "yfov is inf"),
        ("/cameras/0/perspective/aspectRatio", json!(0), "aspectRatio is 0"),
        ("/cameras/0/perspective/aspectRatio", json!(1e39), "aspectRatio is inf"),
        (
            "/cameras/0/type",
            json!("fisheye"),
            "neither perspective nor orthographic",
        ),
    ];
    for (pointer, value, part) in cases {
        let mut room = Fixture::room();
        room.set("/cameras/0/name", json!("main"));
        room.set(pointer, value);
        room.assert_fails(&["camera 0 \"main\"", part]);
    }
    let mut room = Fixture::room();
    room.remove("/cameras/0/perspective");
    room.assert_fails(&["camera 0", "no such projection"]);

    let mut room = Fixture::room();
    room.set("/nodes/2/camera", json!(7));
    room.assert_fails(&["node 2 \"eye\"", "no camera 7", "has 1"]);

    let mut room = Fixture::room();
    room.set("/nodes/2/translation", json!([0, 0, 3e38]));
    room.set("/nodes/0/scale", json!([1e-9, 1e-9, 1e-9]));
    room.set("/nodes/1/scale", json!([1e-9, 1e-9, 1e-9]));
    room.assert_fails(&["camera 0", "too far"]);
}
