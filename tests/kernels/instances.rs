//! Instances with shared triangles, compared with the same scene where every node has its own mesh.

use std::path::{Path, PathBuf};

use glam::Vec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Accel, EmissionChoice, RenderConfig, TriangleTest};
use ppm_vk::internals::cpu;
use ppm_vk::internals::film::Image;
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::layout::{DIELECTRIC, MIRRORED, Settings, ShadingTriangle, TOUCHED};
use ppm_vk::internals::metrics::compare;
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::scene::{Placement, Scene};
use serde_json::{Value, json};

use super::agreement::Agreement;
use super::bench::{packed, random_numbers, scene, small, xyz};
use super::rays::{Probe, Ray, accels, ray};

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// The scene `instances`.
fn document() -> Value {
    let text = std::fs::read_to_string(scenes().join("instances.gltf")).expect("a scene");
    serde_json::from_str(&text).expect("JSON")
}

/// Gives each node its own mesh: nothing is shared.
fn take_apart(document: &mut Value) {
    for node in 0..document["nodes"].as_array().expect("nodes").len() {
        let Some(mesh) = document["nodes"][node]["mesh"].as_u64() else {
            continue;
        };
        let copy = document["meshes"][mesh as usize].clone();
        let meshes = document["meshes"].as_array_mut().expect("meshes");
        meshes.push(copy);
        let last = meshes.len() - 1;
        document["nodes"][node]["mesh"] = json!(last);
    }
}

fn load(document: &Value) -> Scene {
    let folder = tempfile::TempDir::new().expect("a folder");
    std::fs::copy(scenes().join("instances.bin"), folder.path().join("instances.bin")).expect("a buffer");
    let path = folder.path().join("changed.gltf");
    std::fs::write(&path, document.to_string()).expect("a file");
    Scene::load(&path).unwrap_or_else(|error| panic!("{error}"))
}

/// The scene with a mesh for each node.
fn apart() -> Scene {
    let mut document = document();
    take_apart(&mut document);
    load(&document)
}

/// Rays between points in the room.
fn rays(count: u32) -> Vec<Ray> {
    let numbers: Vec<[f32; 4]> = random_numbers(2 * count).collect();
    let place = |[x, y, z, _]: [f32; 4]| 1.8 * Vec3::new(x, y, z) - 0.9;
    let pairs = numbers.chunks_exact(2);
    pairs
        .map(|pair| {
            let from = place(pair[0]);
            ray(from, (place(pair[1]) - from).normalize())
        })
        .collect()
}

/// t, and the object.
fn hit_of(hit: [f32; 4]) -> Option<(f64, u32)> {
    let object = hit[3].to_bits();
    (object != u32::MAX).then(|| (hit[0].into(), object))
}

fn assert_same(what: &str, found: &[Option<(f64, u32)>], expected: &[Option<(f64, u32)>]) {
    let mut agreement = Agreement::default();
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        let same = match (found, expected) {
            (Some((t, object)), Some((expected_t, expected_object))) => {
                (t - expected_t).abs() < 2e-6 + 2e-5 * expected_t && object == expected_object
            }
            (None, None) => true,
            _ => false,
        };
        agreement.note(same, || format!("ray {index}: {found:?} instead of {expected:?}"));
    }
    agreement.assert(what, 0.9995, 2000);
}

#[test]
fn rays_meet_instances_as_they_meet_meshes_of_their_own() {
    let (shared, apart) = (scene("instances"), apart());
    let rays = rays(if cfg!(debug_assertions) { 4000 } else { 20_000 });
    let hits = |scene: &Scene, test, accel| -> Vec<_> {
        let hits = Probe::with(scene, test, accel).hits(&rays);
        hits.into_iter().map(hit_of).collect()
    };
    let expected = hits(&apart, TriangleTest::Watertight, Accel::Bvh);
    let on_instances = expected
        .iter()
        .flatten()
        .filter(|(_, object)| shared.objects[*object as usize].placement.is_some());
    let on_instances = on_instances.count();
    assert!(4 * on_instances > rays.len(), "only {on_instances} rays meet instances");
    for test in [TriangleTest::Watertight, TriangleTest::Havel] {
        for accel in accels() {
            let found = hits(&shared, test, accel);
            assert_same(&format!("hits by {test:?}, {accel:?}"), &found, &expected);
        }
    }
    let scene = packed(&shared);
    for accel in [Accel::Bvh, Accel::Brute] {
        let config = RenderConfig { accel, ..small() };
        let settings: Settings = bytemuck::Zeroable::zeroed();
        let inputs = cpu::Inputs {
            scene: &scene,
            settings: &settings,
            config: &config,
        };
        let found = rays.iter().map(|[origin, direction]| {
            let ray = cpu::Ray {
                origin: xyz(*origin),
                direction: xyz(*direction),
            };
            let hit = cpu::nearest_hit(&inputs, ray, 1e30, None)?;
            let object = match hit.at.instance {
                Some(instance) => scene.instances[instance as usize].object,
                None => scene.shading_triangles[hit.at.triangle as usize].object,
            };
            Some((hit.t, object))
        });
        let found: Vec<_> = found.collect();
        assert_same(&format!("the CPU's hits, {accel:?}"), &found, &expected);
    }
}

#[test]
fn the_same_meshes_are_shared_whatever_their_nodes_transforms() {
    let (shared, apart) = (packed(&scene("instances")), packed(&apart()));
    assert_eq!((shared.instances.len(), shared.shared_primitives()), (9, 3));
    assert_eq!((apart.instances.len(), apart.shared_primitives()), (0, 0));
    assert_eq!(shared.seen_triangles(), apart.seen_triangles());
    assert!(shared.features.instanced && !apart.features.instanced);
    let mirrored = shared
        .instances
        .iter()
        .filter(|instance| instance.flags & MIRRORED != 0);
    assert_eq!(mirrored.count(), 2);
    // Objects on the floor touch it, whether they are shared or not.
    let touched = |scene: &PackedScene| {
        scene
            .shading_triangles
            .iter()
            .filter(|t| t.flags & TOUCHED != 0)
            .count()
    };
    assert!(touched(&shared) > 0 && touched(&apart) >= touched(&shared));
    // The other glass of the pair, and the room, are unchanged.
    assert_eq!(shared.object_grids.len(), apart.object_grids.len());
    for (grid, expected) in shared.object_grids.iter().zip(&apart.object_grids) {
        let apart = Vec3::from(grid.low).distance(Vec3::from(expected.low));
        assert!(apart < 1e-6, "{grid:?} instead of {expected:?}");
    }
}

/// Swaps both triangles of the lamp, which are in the order of the hierarchy, if their order is not the wanted one: then the same
/// random numbers choose the same triangle.
fn order_lamp(scene: &mut PackedScene, wanted: &PackedScene) {
    assert_eq!(scene.lights.len(), 2);
    let first = |scene: &PackedScene| {
        let triangle = &scene.shading_triangles[scene.lights[0].triangle as usize];
        [triangle.p0, triangle.p1, triangle.p2].map(xyz)
    };
    if first(scene) != first(wanted) {
        scene.lights.swap(0, 1);
        for (index, light) in (0..).zip(&mut scene.lights) {
            light.alias = 1 - light.alias;
            scene.shading_triangles[light.triangle as usize].light = index;
        }
    }
}

fn picture(scene: &Scene, packed: &PackedScene, iterations: u32, seed: u32) -> Image {
    let config = RenderConfig {
        resolution: [64, 63],
        photons: 20_000,
        radius: Some(0.03),
        emission: EmissionChoice::Power,
        seed,
        ..RenderConfig::default()
    };
    let device = Device::open(None).expect("a Vulkan device");
    let mut renderer = Renderer::new(device, packed, &scene.cameras[0], config).expect("a renderer");
    for _ in 0..iterations {
        renderer.iterate().expect("an iteration");
    }
    renderer.resolve().expect("a picture")
}

/// The same paths: only the few that rounding deflects differ. `most`: mean absolute error, as a share of that
/// of a picture with another seed. relMSE would be that of the one brightest photon that is deflected.
fn assert_same_picture(shared: &Scene, apart: &Scene, iterations: u32, most: f64) {
    let (packed_shared, mut packed_apart) = (packed(shared), packed(apart));
    assert!(packed_shared.features.instanced && !packed_apart.features.instanced);
    order_lamp(&mut packed_apart, &packed_shared);
    let expected = picture(apart, &packed_apart, iterations, 0);
    let error = |seed: u32| {
        let found = picture(shared, &packed_shared, iterations, seed);
        compare(&found, &expected).expect("pictures of one size").mae
    };
    let (rounding, noise) = (error(0), error(1));
    println!(
        "mean absolute error {rounding:e}, of another seed {noise:e}: {}",
        rounding / noise
    );
    assert!(
        rounding < most * noise,
        "mean absolute error {rounding:e}, of another seed {noise:e}"
    );
}

#[test]
fn the_picture_of_instances_is_that_of_meshes_of_their_own() {
    assert_same_picture(&scene("instances"), &apart(), 8, 0.02);
}

/// f32 is precise near the floor: the instance's own coordinates do not show how far rounding can move its bottom.
#[test]
fn glass_instances_stand_on_a_floor_through_the_middle_of_the_scene() {
    let mut document = document();
    let nodes = document["nodes"].as_array_mut().expect("nodes");
    let floor = nodes.iter().find(|node| node["name"] == "floor").expect("a floor");
    let below = json!({"name": "below", "mesh": floor["mesh"], "translation": [0, -2, 0]});
    let glass = nodes.iter().find(|node| node["name"] == "glass").expect("glass")["mesh"].clone();
    nodes.push(below);
    let first = nodes.len();
    for i in 0..10 {
        let (turn, height) = (0.3 * f64::from(i), 0.3 + 0.13 * f64::from(i));
        nodes.push(json!({
            "mesh": glass, "translation": [0.33 * f64::from(i % 5) - 0.7, 0, 0.72 + 0.3 * f64::from(i / 5)],
            "rotation": [0, turn.sin(), 0, turn.cos()], "scale": [0.6, height, 0.5]
        }));
    }
    // Products of two scales need more than 24 bits.
    let all = nodes.len();
    let glasses: Vec<usize> = (first..all).collect();
    nodes.push(json!({"children": glasses, "scale": [0.9, 1.1, 0.95]}));
    let roots = document["scenes"][0]["nodes"].as_array_mut().expect("roots");
    roots.extend([json!(first - 1), json!(all)]);
    let shared = load(&document);
    take_apart(&mut document);
    let apart = load(&document);
    let floor = apart
        .objects
        .iter()
        .find(|object| object.name == "floor")
        .expect("a floor");
    let corner = apart.triangles[floor.triangles.start as usize].vertices[0] as usize;
    assert_eq!(apart.positions[corner].y, 0.0);
    // Some bottoms now lie above the floor by a rounding error of their height.
    let scene = packed(&shared);
    let bottoms = scene.instances.iter().filter_map(|instance| {
        let triangles =
            &scene.shading_triangles[instance.first_triangle as usize..][..instance.triangle_count as usize];
        let placement = Placement { rows: instance.rows };
        let height = |t: &ShadingTriangle| placement.point(xyz(t.p0).as_vec3()).y;
        let is_glass = scene.materials[triangles[0].material as usize].surface == DIELECTRIC;
        is_glass.then(|| triangles.iter().map(height).fold(f32::INFINITY, f32::min))
    });
    let bottoms: Vec<f32> = bottoms.collect();
    println!("{bottoms:?}");
    assert!(bottoms.iter().any(|&y| y > 0.0 && y < 1e-8));
    // Light takes many paths through this much glass. Where no face is known to touch another it is 0.38.
    assert_same_picture(&shared, &apart, 48, 0.1);
}
