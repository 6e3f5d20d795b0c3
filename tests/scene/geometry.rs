//! Triangles, normals and render space.

use std::f32::consts::FRAC_1_SQRT_2;
use std::path::Path;

use glam::Vec3;
use ppm_vk::internals::scene::Scene;
use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close, soup, winding_normal};

/// Largest difference between the coordinates of the positions, normals and cameras of two scenes.
fn difference(a: &Scene, b: &Scene) -> f32 {
    assert_eq!(a.triangles, b.triangles);
    let vectors = |scene: &Scene| -> Vec<Vec3> {
        let cameras = scene.cameras.iter();
        let cameras = cameras.flat_map(|camera| [camera.position, camera.right, camera.up, camera.forward]);
        [scene.positions.clone(), scene.normals.clone(), cameras.collect()].concat()
    };
    let pairs = vectors(a).into_iter().zip(vectors(b));
    pairs.map(|(a, b)| (a - b).abs().max_element()).fold(0.0, f32::max)
}

#[test]
fn render_space_is_centred_and_its_longest_half_axis_is_1() {
    let scene = Fixture::room().scene();
    let (lower, upper) = scene.bounds();
    assert_eq!(lower, Vec3::new(-1.0, -0.5, -1.0));
    assert_eq!(upper, Vec3::new(1.0, 0.5, 1.0));
    assert_eq!(scene.normalisation.centre.to_array(), [0.0, 0.5, 0.0]);
    assert_eq!(scene.object_area(0), 4.0, "the floor");
    assert_eq!(scene.object_area(1), 0.5, "the lamp");
    assert_close(scene.cameras[0].position, [0.0, 0.0, 4.0]);
}

#[test]
fn moving_or_scaling_the_scene_gives_the_same_numbers() {
    let original = Fixture::room().scene();
    let roots = [
        json!({"translation": [1e5, 1e5, 1e5]}),
        json!({"translation": [-3e4, 1e5, 7e4]}),
        json!({"scale": [1e-3, 1e-3, 1e-3]}),
        json!({"scale": [1e3, 1e3, 1e3]}),
        json!({"scale": [1e-3, 1e-3, 1e-3], "translation": [100, 200, 300]}),
        json!({"scale": [1e-30, 1e-30, 1e-30]}),
        json!({"scale": [1e30, 1e30, 1e30]}),
    ];
    for root in roots {
        let mut room = Fixture::room();
        room.add_parent(root.clone());
        let difference = difference(&room.scene(), &original);
        assert!(difference <= 1.2e-7, "{root}: {difference}");
    }
}

#[test]
fn the_shared_scene_moved_or_scaled_gives_the_same_numbers() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    let Ok(original) = Scene::load(&folder.join("cornell-spheres.gltf")) else {
        return;
    };
    for variant in ["far", "tiny", "huge"] {
        let path = folder.join(format!("cornell-spheres-{variant}.gltf"));
        let scene = Scene::load(&path).expect("a shared scene loads");
        let difference = difference(&scene, &original);
        // At the camera, 3.9, a step of f32 is 2.4e-7.
        assert!(difference <= 2.4e-7, "{variant}: {difference}");
    }
}

#[test]
fn indices_of_8_16_and_32_bits_and_none_give_the_same_triangles() {
    let mut room = Fixture::room();
    let original = soup(&room.scene());
    let indices = [0u32, 1, 2, 0, 2, 3];
    let bytes = indices.map(|index| index as u8);
    let narrow = room.add_accessor(&bytes, 6, 5121, "SCALAR");
    let words: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
    let wide = room.add_accessor(&words, 6, 5125, "SCALAR");
    for accessor in [narrow, wide] {
        room.set("/meshes/0/primitives/0/indices", json!(accessor));
        assert_eq!(soup(&room.scene()), original);
    }
    let corners = [
        [-1.0, 0.0, -1.0],
        [-1.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [-1.0, 0.0, -1.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
    ];
    let positions = room.add_vectors(&corners);
    room.set(
        "/meshes/0/primitives/0",
        json!({"attributes": {"POSITION": positions}, "material": 0}),
    );
    assert_eq!(soup(&room.scene()), original);
}

#[test]
fn strips_and_fans_face_the_way_of_their_first_triangle() {
    // A square; each order gives two triangles that face +y.
    let square = [[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0]];
    for (mode, order) in [(5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])] {
        for is_indexed in [false, true] {
            let mut room = Fixture::room();
            let positions = if is_indexed {
                square
            } else {
                order.map(|index| square[index])
            };
            let accessor = room.add_vectors(&positions);
            let mut primitive = json!({"attributes": {"POSITION": accessor}, "material": 0, "mode": mode});
            if is_indexed {
                primitive["indices"] = json!(room.add_indices(&order.map(|index| index as u16)));
            }
            room.set("/meshes/0/primitives/0", primitive);
            let scene = room.scene();
            assert_eq!(scene.objects[0].triangles, 0..2, "mode {mode}");
            assert_eq!(scene.object_area(0), 4.0, "mode {mode}");
            for triangle in 0..2 {
                assert_close(winding_normal(&scene, triangle), [0.0, 1.0, 0.0]);
            }
        }
    }
}

#[test]
fn strips_and_fans_of_five_vertices_are_three_triangles_each() {
    let pentagon = [
        [0.0, 0.0, 1.0],
        [0.9, 0.1, 0.3],
        [0.6, 0.2, -0.8],
        [-0.6, 0.3, -0.8],
        [-0.9, 0.4, 0.3],
    ];
    // glTF 2.0, section 3.7.2.1: p_i = {v_i, v_(i + 1 + i % 2), v_(i + 2 - i % 2)} and p_i = {v_(i + 1), v_(i + 2), v_0}.
    let lists = [
        (5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
    ];
    for (mode, list) in lists {
        let mut room = Fixture::room();
        let positions = room.add_vectors(&pentagon);
        room.set(
            "/meshes/0/primitives/0",
            json!({"attributes": {"POSITION": positions}, "material": 0, "mode": mode}),
        );
        let triangles = soup(&room.scene());
        let indices = room.add_indices(list.as_flattened());
        room.set("/meshes/0/primitives/0/mode", json!(4));
        room.set("/meshes/0/primitives/0/indices", json!(indices));
        assert_eq!(triangles, soup(&room.scene()), "mode {mode}");
    }
}

#[test]
fn points_and_lines_are_skipped_with_a_warning() {
    for (mode, kind) in [(0, "Points"), (1, "Lines"), (2, "LineLoop"), (3, "LineStrip")] {
        let mut room = Fixture::room();
        room.set("/meshes/0/primitives/0/mode", json!(mode));
        room.add_root(json!({"mesh": 0}));
        let scene = room.assert_warns(&["mesh 0 \"floor\", primitive 0", kind, "skipped"]);
        assert_eq!(scene.triangles.len(), 1, "the lamp is left");
    }
}

#[test]
fn indices_that_fill_no_triangle_are_skipped_with_a_warning() {
    let mut room = Fixture::room();
    let indices = room.add_indices(&[0, 1, 2, 0, 2]);
    room.set("/meshes/0/primitives/0/indices", json!(indices));
    let scene = room.assert_warns(&["mesh 0", "last 2 indices"]);
    assert_eq!(scene.objects[0].triangles.len(), 1);
}

#[test]
fn each_primitive_of_a_mesh_is_an_object() {
    let mut room = Fixture::room();
    room.set(
        "/meshes/0/primitives/-",
        json!({"attributes": {"POSITION": 3}, "material": 1}),
    );
    let scene = room.scene();
    let objects: Vec<_> = scene
        .objects
        .iter()
        .map(|object| (object.name.as_str(), object.material, object.triangles.clone()))
        .collect();
    assert_eq!(objects, [("floor", 0, 0..2), ("floor", 1, 2..3), ("lamp", 1, 3..4)]);
}

#[test]
fn interleaved_attributes_are_read_by_their_stride() {
    let mut room = Fixture::room();
    let original = room.scene();
    let corners = [
        [-1.0f32, 0.0, -1.0],
        [-1.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
    ];
    let mut bytes = vec![0xff; 8];
    for corner in corners {
        for value in [corner, [0.0, 1.0, 0.0]].concat() {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        bytes.extend_from_slice(&[0xff; 4]);
    }
    // The padding after the last element may be missing.
    bytes.truncate(bytes.len() - 4);
    let positions = room.add_accessor(&bytes, 4, 5126, "VEC3");
    let view = room.json["accessors"][positions]["bufferView"].clone();
    room.set(&format!("/bufferViews/{view}/byteStride"), json!(28));
    room.set(&format!("/accessors/{positions}/byteOffset"), json!(8));
    let normals = json!({"bufferView": view, "byteOffset": 20, "componentType": 5126, "count": 4, "type": "VEC3"});
    room.set("/accessors/-", normals);
    room.set(
        "/meshes/0/primitives/0/attributes",
        json!({"POSITION": positions, "NORMAL": positions + 1}),
    );
    let scene = room.scene();
    assert_eq!(scene.positions, original.positions);
    assert_eq!(scene.normals, original.normals);
}

#[test]
fn vertices_are_shared_where_the_file_shares_them_and_left_out_where_unused() {
    let mut room = Fixture::room();
    let scene = room.scene();
    assert_eq!(scene.positions.len(), 4 + 3, "four of the floor, three of the lamp");
    let positions = room.add_vectors(&[
        [-1.0, 0.0, -1.0],
        [-1.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
        [1e9, f32::NAN, 0.0],
    ]);
    let normals = room.add_vectors(&[[0.0, 1.0, 0.0]; 5]);
    room.set(
        "/meshes/0/primitives/0/attributes",
        json!({"POSITION": positions, "NORMAL": normals}),
    );
    let with_stray = room.scene();
    assert_eq!(
        with_stray.positions, scene.positions,
        "no triangle uses the stray vertex"
    );
}

#[test]
fn missing_normals_are_flat() {
    let mut room = Fixture::room();
    // A ridge: two triangles that share an edge and face different directions.
    let positions = room.add_vectors(&[[-1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, -1.0], [1.0, 0.0, 0.0]]);
    let indices = room.add_indices(&[0, 1, 2, 3, 2, 1]);
    room.set(
        "/meshes/0/primitives/0",
        json!({"attributes": {"POSITION": positions}, "indices": indices, "material": 0}),
    );
    let scene = room.scene();
    assert_eq!(scene.positions.len(), 6 + 3, "vertices on the ridge are not shared");
    for triangle in 0..2 {
        for vertex in scene.triangles[triangle].vertices {
            assert_close(
                scene.normals[vertex as usize],
                winding_normal(&scene, triangle).to_array(),
            );
        }
    }
    assert_close(scene.normals[0], [-FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0]);
    assert_close(scene.normals[3], [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0]);
}

#[test]
fn normals_are_made_unit_and_follow_the_inverse_transpose() {
    let mut room = Fixture::room();
    let normals = room.add_vectors(&[[3.0, 3.0, 0.0]; 4]);
    room.set("/meshes/0/primitives/0/attributes/NORMAL", json!(normals));
    assert_close(room.scene().normals[0], [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0]);
    // A normal of slope 1 on a surface stretched fourfold along x: its x shrinks to a quarter.
    room.set("/nodes/0/scale", json!([4, 1, 1]));
    assert_close(
        room.scene().normals[0],
        Vec3::new(0.25, 1.0, 0.0).normalize().to_array(),
    );
    room.add_parent(json!({"scale": [1e-20, 1e-20, 1e-20]}));
    assert_close(
        room.scene().normals[0],
        Vec3::new(0.25, 1.0, 0.0).normalize().to_array(),
    );
}

#[test]
fn a_mirrored_node_keeps_its_front_in_front() {
    let tilted = Vec3::new(0.6, 0.8, 0.0);
    for scale in [[-1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, -1.0], [-2.0, 0.5, 3.0]] {
        let mut room = Fixture::room();
        let normals = room.add_vectors(&[tilted.to_array(); 4]);
        room.set("/meshes/0/primitives/0/attributes/NORMAL", json!(normals));
        room.set("/nodes/0/scale", json!(scale));
        let scene = room.scene();
        assert_close(winding_normal(&scene, 0), [0.0, 1.0, 0.0]);
        let wanted = (tilted / Vec3::from(scale.map(|factor| factor as f32))).normalize();
        assert_close(scene.normals[0], wanted.to_array());
    }
    // Mirrored along y, the front of the floor faces down.
    let mut room = Fixture::room();
    room.set("/nodes/0/scale", json!([1, -1, 1]));
    let scene = room.scene();
    assert_close(winding_normal(&scene, 0), [0.0, -1.0, 0.0]);
    assert_close(scene.normals[0], [0.0, -1.0, 0.0]);
}

#[test]
fn normals_of_zero_length_are_replaced_with_a_warning() {
    let mut room = Fixture::room();
    let normals = room.add_vectors(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    room.set("/meshes/0/primitives/0/attributes/NORMAL", json!(normals));
    let scene = room.assert_warns(&["2 vertices", "zero length"]);
    assert!(
        scene.normals[..4].iter().all(|&normal| normal == Vec3::Y),
        "{:?}",
        scene.normals
    );
}

/// A rotation that leaves no coordinate round.
fn odd_rotation() -> Value {
    json!([0.18257419, 0.36514837, 0.54772256, 0.73029674])
}

#[test]
fn triangles_without_area_are_dropped_and_counted() {
    let degenerate = [
        ("a point", [[0.3, 0.4, 0.5]; 3]),
        ("two corners alike", [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]),
        ("in a line", [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [3.0, 6.0, 9.0]]),
    ];
    for (name, corners) in degenerate {
        for (rotation, translation) in [(json!([0, 0, 0, 1]), [0, 0, 0]), (odd_rotation(), [1000, 3, 7])] {
            let mut room = Fixture::room();
            let triangle = [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]];
            room.set_lamp(&[corners, triangle, corners].concat());
            room.set("/nodes/1/rotation", rotation);
            room.set("/nodes/1/translation", json!(translation));
            let scene = room.assert_warns(&["dropped 2 triangles", "\"lamp\" (2)"]);
            assert_eq!(scene.dropped_triangles, 2, "{name}");
            assert_eq!(scene.triangles.len(), 3, "{name}");
        }
    }
}

#[test]
fn triangles_that_rounding_to_f32_flattens_are_dropped() {
    let mut room = Fixture::room();
    // 1e-12 of the scene's size, far from its centre: an area in f64 and none in f32.
    room.add_root(json!({"name": "speck", "mesh": 1, "scale": [1e-12, 1e-12, 1e-12], "translation": [0.9, 0.9, 0.9]}));
    let scene = room.assert_warns(&["dropped 1 triangles", "\"speck\" (1)"]);
    assert_eq!(scene.objects.len(), 2, "an object of which nothing is left is none");
    // A scene of only such triangles is valid.
    let mut lamp = Fixture::lamp();
    lamp.set("/nodes/0/scale", json!([1e-12, 1e-12, 1e-12]));
    lamp.set("/nodes/0/translation", json!([0, 0.1, 0]));
    assert_eq!(lamp.scene().triangles.len(), 1);
}

#[test]
fn a_stray_degenerate_triangle_leaves_the_bounds_alone() {
    let mut room = Fixture::room();
    let original = room.scene().bounds();
    let lamp = [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]];
    room.set_lamp(&[lamp, [[1e6, 1e6, 1e6]; 3]].concat());
    assert_eq!(room.assert_warns(&["dropped 1"]).bounds(), original);
}

#[test]
fn a_flattened_node_is_a_surface_still() {
    let mut room = Fixture::room();
    room.set("/nodes/0/scale", json!([1, 0, 1]));
    let scene = room.scene();
    assert_eq!(scene.dropped_triangles, 0);
    assert_close(scene.normals[0], [0.0, 1.0, 0.0]);
    room.set("/nodes/0/scale", json!([0, 0, 0]));
    room.assert_warns(&["dropped 2", "\"floor\" (2)"]);
}

#[test]
fn a_scene_without_triangles_is_refused() {
    let mut room = Fixture::room();
    room.set("/scenes/0/nodes", json!([2]));
    room.assert_fails(&["no triangles", "no mesh"]);

    let mut lamp = Fixture::lamp();
    lamp.set("/nodes/0/scale", json!([0, 1, 1]));
    lamp.assert_fails(&["no triangles", "zero area"]);
}

#[test]
fn instances_beyond_all_bounds_are_refused_before_they_are_built() {
    let mut room = Fixture::room();
    let triangles = 20_000;
    let indices = room.add_indices(&[0, 1, 2].repeat(triangles));
    room.set("/meshes/0/primitives/0/indices", json!(indices));
    for _ in 0..2_000 {
        room.add_root(json!({"mesh": 0}));
    }
    room.assert_fails(&["more than 33554432 triangles"]);

    let mut room = Fixture::room();
    let primitive = room.json["meshes"][1]["primitives"][0].clone();
    room.set("/meshes/1/primitives", json!(vec![primitive; 1025]));
    for _ in 0..1024 {
        room.add_root(json!({"mesh": 1}));
    }
    room.assert_fails(&["more than 1048576 mesh primitives"]);
}
