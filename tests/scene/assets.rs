//! Files made by others. Nothing is checked if their folder is missing.

use std::fs;
use std::path::Path;

use glam::Vec3;
use serde_json::{Value, json};

use crate::fixture::{Fixture, assert_close, winding_normal, world_soup};

/// An asset with one buffer as a fixture, with its first material emissive; `None` if it is missing.
fn asset(path: &str) -> Option<Fixture> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/assets")
        .join(path);
    let bytes = fs::read(&path).ok()?;
    let mut fixture = Fixture::room();
    if let Some(rest) = bytes.strip_prefix(b"glTF") {
        let length = u32::from_le_bytes(rest[8..12].try_into().expect("four bytes")) as usize;
        fixture.json = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
        fixture.binary = bytes[28 + length..].to_vec();
        fixture.set("/buffers/0/uri", json!("room.bin"));
    } else {
        fixture.json = serde_json::from_slice(&bytes).expect("JSON");
        let uri = fixture.json["buffers"][0]["uri"].as_str().expect("a URI").to_owned();
        if !uri.starts_with("data:") {
            fixture.binary = fs::read(path.with_file_name(uri)).expect("the buffer beside the file");
            fixture.set("/buffers/0/uri", json!("room.bin"));
        }
    }
    if fixture.json["materials"].is_null() {
        fixture.set("/materials", json!([{}]));
        fixture.set("/meshes/0/primitives/0/material", json!(0));
    }
    fixture.set("/materials/0/emissiveFactor", json!([1, 1, 1]));
    Some(fixture)
}

#[test]
fn the_simple_sparse_accessor_lifts_three_vertices() {
    let Some(fixture) = asset("khr/SimpleSparseAccessor/SimpleSparseAccessor.gltf") else {
        return;
    };
    let soup = world_soup(&fixture.scene());
    assert_eq!(soup.len(), 12);
    // The upper row of vertices 7 to 13 stands at y = 1; the sparse part lifts 8, 10 and 12 to (1, 2), (3, 3), (5, 4).
    for lifted in [[1.0, 2.0], [3.0, 3.0], [5.0, 4.0]] {
        let lifted = Vec3::new(lifted[0], lifted[1], 0.0);
        let corners = soup.as_flattened().iter();
        assert!(
            corners.clone().any(|corner| corner.abs_diff_eq(lifted, 2e-6)),
            "{lifted}"
        );
        let original = lifted.with_y(1.0);
        assert!(
            !corners.clone().any(|corner| corner.abs_diff_eq(original, 2e-6)),
            "{original}"
        );
    }
}

#[test]
fn triangles_of_the_negative_scale_test_face_the_way_of_their_normals() {
    let Some(fixture) = asset("khr/NegativeScaleTest/NegativeScaleTest.glb") else {
        return;
    };
    let scene = fixture.scene();
    let mirrored = |node: &Value| {
        let scale = node["scale"].as_array();
        scale.is_some_and(|scale| scale.iter().filter_map(Value::as_f64).product::<f64>() < 0.0)
    };
    assert!(fixture.json["nodes"].as_array().expect("nodes").iter().any(mirrored));
    for triangle in &scene.triangles {
        let [a, b, c] = triangle.vertices.map(|vertex| scene.positions[vertex as usize]);
        let winding = (b - a).cross(c - a);
        let shading: Vec3 = triangle
            .vertices
            .iter()
            .map(|&vertex| scene.normals[vertex as usize])
            .sum();
        assert!(winding.dot(shading) > 0.0, "triangle {triangle:?}");
    }
}

#[test]
fn a_box_that_meshopt_compressed_is_a_cube() {
    let Some(fixture) = asset("compressed/BoxMeshopt/BoxMeshopt.glb") else {
        return;
    };
    let soup = world_soup(&fixture.scene());
    assert_eq!(soup.len(), 12);
    for corner in soup.as_flattened() {
        assert!((corner.abs() - 0.5).abs().max_element() < 1e-4, "{corner}");
    }
}

#[test]
fn boxes_that_draco_compressed_are_cubes() {
    for path in ["compressed/BoxDraco/BoxDraco.gltf", "compressed/KhrBoxDraco/Box.gltf"] {
        let Some(fixture) = asset(path) else {
            continue;
        };
        let scene = fixture.scene();
        let soup = world_soup(&scene);
        assert_eq!(soup.len(), 12, "{path}");
        for corner in soup.as_flattened() {
            assert!((corner.abs() - 0.5).abs().max_element() < 1e-3, "{path}: {corner}");
        }
        for (triangle, normal) in scene
            .triangles
            .iter()
            .zip(0..)
            .map(|(t, i)| (t, winding_normal(&scene, i)))
        {
            let shading = scene.normals[triangle.vertices[0] as usize];
            assert!(shading.dot(normal) > 0.99, "{path}: {shading} for {normal}");
        }
    }
}

#[test]
fn assets_that_are_there_are_read() {
    // So that a missing folder is noticed where it should exist.
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets");
    if assets.is_dir() {
        let fixture = asset("khr/SimpleSparseAccessor/SimpleSparseAccessor.gltf").expect("the asset");
        assert_close(fixture.scene().positions[0], [-1.0, -2.0 / 3.0, 0.0]);
    }
}
