//! Files damaged at random load or give an error, but nothing worse.

use std::time::{Duration, Instant};

use ppm_vk::error::Result;
use ppm_vk::scene::{PackedScene, Projection, Scene};
use serde_json::{Value, json};

use crate::allocations::peak_of;
use crate::compressed::compressed;
use crate::fixture::Fixture;

/// The longest that a small file may take to load, whatever is wrong with it, and the most bytes.
const MOST_TIME: Duration = Duration::from_secs(2);
const MOST_BYTES: usize = 256 << 20;

/// Knuth's linear congruential generator; the same numbers in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % bound as u64) as usize
    }
}

/// Changes up to four bytes or bits, and sometimes cuts, repeats or moves a part.
fn damage(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut damaged = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(damaged.len());
        match random.below(4) {
            0 => damaged[at] = random.below(256) as u8,
            1 => damaged[at] ^= 1 << random.below(8),
            // JSON is digits and punctuation above all: these changes often leave it JSON.
            2 => damaged[at] = b"0123456789-.eE,:[]{}\""[random.below(21)],
            _ => damaged[at] = bytes[random.below(bytes.len())],
        }
    }
    match random.below(16) {
        0 => damaged.truncate(1 + random.below(bytes.len())),
        1 => {
            let from = random.below(damaged.len());
            let length = random.below(damaged.len() - from).min(64);
            let part = damaged[from..from + length].to_vec();
            let to = random.below(damaged.len());
            damaged.splice(to..to, part);
        }
        _ => {}
    }
    damaged
}

/// What a scene promises, however damaged the file that it came from.
fn assert_sound(scene: &Scene) {
    assert!(!scene.triangles.is_empty() && !scene.cameras.is_empty());
    assert_eq!(scene.positions.len(), scene.normals.len());
    assert!(scene.positions.iter().all(|position| position.is_finite()));
    assert!(scene.normals.iter().all(|normal| normal.is_normalized()));
    for triangle in &scene.triangles {
        assert!(
            triangle
                .vertices
                .iter()
                .all(|&vertex| (vertex as usize) < scene.positions.len())
        );
    }
    for object in &scene.objects {
        assert!(!object.triangles.is_empty() && (object.material as usize) < scene.materials.len());
    }
    for camera in &scene.cameras {
        let size = match camera.projection {
            Projection::Perspective { tan_half_fov } => tan_half_fov,
            Projection::Orthographic { half_height } => half_height,
        };
        assert!(camera.position.is_finite() && size > 0.0 && size.is_finite());
    }
    for light in scene.emissive_triangles() {
        assert!(light.power > 0.0 && light.power.is_finite());
    }
}

/// Checks what loading gives and takes, and returns whether it is a scene.
#[track_caller]
fn assert_survives(load: impl FnOnce() -> Result<Scene>) -> bool {
    let start = Instant::now();
    let (result, bytes) = peak_of(load);
    let time = start.elapsed();
    assert!(time < MOST_TIME, "it took {time:?}");
    assert!(bytes < MOST_BYTES, "it took {bytes} bytes");
    match result {
        Ok(scene) => {
            assert_sound(&scene);
            PackedScene::new(&scene).expect("a hierarchy");
            true
        }
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains('\n') && message.len() < 1000, "{message:?}");
            false
        }
    }
}

fn assert_survives_damage(original: &[u8], rounds: u64, load: impl Fn(&[u8]) -> Result<Scene>) {
    let loaded = (0..rounds).filter(|&round| assert_survives(|| load(&damage(original, &mut Random(round)))));
    let loaded = loaded.count() as u64;
    assert!(
        loaded > 0 && loaded < rounds,
        "{loaded} of {rounds} load: the test damages too much or too little"
    );
}

/// JSON pointers to all values within `value`.
fn pointers(value: &Value) -> Vec<String> {
    let children: Vec<(String, &Value)> = match value {
        Value::Object(object) => object.iter().map(|(key, child)| (key.clone(), child)).collect(),
        Value::Array(array) => array
            .iter()
            .enumerate()
            .map(|(index, child)| (index.to_string(), child))
            .collect(),
        _ => Vec::new(),
    };
    let mut all = Vec::new();
    for (key, child) in children {
        all.extend(pointers(child).into_iter().map(|rest| format!("/{key}{rest}")));
        all.push(format!("/{key}"));
    }
    all
}

/// Every kind of data that the loader reads: compressed and sparse and of small integers, strips, texture coordinates,
/// colours, tangents to be made, morph targets, skins and animations.
fn rich() -> Fixture {
    let mut room = compressed();
    room.set("/extensionsUsed/-", json!("KHR_mesh_quantization"));
    let texcoords = room.add_accessor(&[0, 0, 0, 255, 255, 255, 255, 0], 4, 5121, "VEC2");
    room.set(&format!("/accessors/{texcoords}/normalized"), json!(true));
    room.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(texcoords));
    room.set("/materials/0/normalTexture", json!({"index": 0}));
    room.set(
        "/materials/0/extensions/KHR_materials_clearcoat",
        json!({"clearcoatFactor": 0.5, "clearcoatNormalTexture": {"index": 0, "scale": 0.5}}),
    );
    room.set("/textures", json!([{}]));
    let colors = room.add_floats("VEC4", 4, &[0.5; 12]);
    room.set("/meshes/1/primitives/0/attributes/COLOR_0", json!(colors));
    let joints = room.add_accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 3, 5121, "VEC4");
    let weights = [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat();
    let weights = room.add_floats("VEC4", 4, &weights);
    room.set("/meshes/1/primitives/0/attributes/JOINTS_0", json!(joints));
    room.set("/meshes/1/primitives/0/attributes/WEIGHTS_0", json!(weights));
    room.set("/meshes/1/primitives/0/mode", json!(5));
    let matrices = [glam::Mat4::IDENTITY.to_cols_array(); 2].concat();
    let matrices = room.add_floats("MAT4", 16, &matrices);
    room.set("/skins", json!([{"joints": [3, 4], "inverseBindMatrices": matrices}]));
    room.set("/nodes/1/skin", json!(0));
    room.add_root(json!({"name": "hip"}));
    room.add_root(json!({"name": "knee", "rotation": [0, 0, 0, 1], "scale": [1, 1, -1]}));
    let shifts = room.add_vectors(&[[0.0, 0.5, 0.0]; 3]);
    room.add_sparse(shifts, &[1], &[[0.25, 0.0, 0.0]]);
    room.set("/meshes/1/primitives/0/targets", json!([{"POSITION": shifts}]));
    room.set("/nodes/1/weights", json!([0.5]));
    let weights = room.add_floats("SCALAR", 1, &[0.0, 1.0]);
    room.animate(1, "weights", "LINEAR", &[0.0, 1.0], weights);
    let moves = room.add_vectors(&[[0.0, 0.5, 0.0]; 6]);
    room.animate(4, "translation", "CUBICSPLINE", &[0.0, 1.0], moves);
    let turns = room.add_floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
    room.animate(0, "rotation", "LINEAR", &[0.25, 2.0], turns);
    room
}

/// One mutation of the rich file: of its JSON's bytes, of values in it, of its buffer's bytes, or of a `.glb`.
fn assert_survives_mutation(original: &Fixture, pointers: &[String], values: &[Value], seed: u64) -> bool {
    let mut random = Random(seed);
    let mut json = original.json.clone();
    let mut binary = original.binary.clone();
    match random.below(4) {
        0 => {
            let bytes = damage(original.json.to_string().as_bytes(), &mut random);
            original.write("room.bin", &binary);
            return assert_survives(|| original.load_bytes_at("damaged.gltf", &bytes, 0.5));
        }
        1 => {
            let bytes = damage(&original.glb(), &mut random);
            return assert_survives(|| original.load_bytes_at("damaged.glb", &bytes, 0.5));
        }
        2 => binary = damage(&binary, &mut random),
        _ => {
            for _ in 0..=random.below(3) {
                // An earlier one may have replaced what it lies in.
                if let Some(value) = json.pointer_mut(&pointers[random.below(pointers.len())]) {
                    *value = values[random.below(values.len())].clone();
                }
            }
        }
    }
    original.write("room.bin", &binary);
    assert_survives(|| original.load_bytes_at("damaged.gltf", json.to_string().as_bytes(), 0.5))
}

#[test]
fn a_file_of_every_kind_of_data_mutated_neither_panics_nor_hangs_nor_takes_all_memory() {
    let original = rich();
    original.load_at(0.5).expect("it loads unharmed");
    let pointers = pointers(&original.json);
    // What one place holds is what another takes for its own, and numbers at the bounds of types.
    let mut values: Vec<Value> = pointers
        .iter()
        .filter_map(|at| original.json.pointer(at))
        .cloned()
        .collect();
    let numbers = [
        0u64,
        1,
        2,
        3,
        4,
        255,
        65_535,
        1 << 20,
        1 << 31,
        u64::from(u32::MAX),
        1 << 40,
        u64::MAX,
    ];
    values.extend(
        numbers
            .map(|number| json!(number))
            .iter()
            .cycle()
            .take(pointers.len())
            .cloned(),
    );
    values.extend([json!(-1), json!(null), json!(1e39), json!(-1e-45), json!([]), json!("")]);
    let is_long = std::env::var_os("PPM_VK_LONG").is_some();
    let start = Instant::now();
    let (mut loaded, mut done) = (0, 0);
    while done < 2500 || is_long && start.elapsed() < Duration::from_secs(60) {
        loaded += u64::from(assert_survives_mutation(&original, &pointers, &values, done));
        done += 1;
    }
    assert!(
        loaded > done / 20 && loaded < done / 2,
        "{loaded} of {done} load: it mutates too much or too little"
    );
}

#[test]
fn a_damaged_glb_never_panics() {
    let room = Fixture::room();
    assert_survives_damage(&room.glb(), 3000, |bytes| room.load_bytes("damaged.glb", bytes));
}

#[test]
fn a_damaged_gltf_never_panics() {
    let mut room = Fixture::room();
    room.scene();
    let external = room.json.to_string();
    assert_survives_damage(external.as_bytes(), 3000, |bytes| {
        room.load_bytes("damaged.gltf", bytes)
    });
    room.load_embedded().expect("it loads");
    let embedded = room.json.to_string();
    assert_survives_damage(embedded.as_bytes(), 1000, |bytes| {
        room.load_bytes("damaged.gltf", bytes)
    });
}

#[test]
fn a_gltf_with_any_value_replaced_never_panics() {
    let original = Fixture::room();
    let values = [
        json!(null),
        json!(true),
        json!(0),
        json!(1),
        json!(3),
        json!(-1),
        json!(0.5),
        json!(1e39),
        json!(1e-45),
        json!(u32::MAX),
        json!(u64::MAX),
        json!("text"),
        json!([]),
        json!([0, 1, 2]),
        json!([1e39, 0, -1]),
        json!({}),
    ];
    let mut room = Fixture::room();
    let mut loaded = 0;
    for pointer in pointers(&original.json) {
        for value in &values {
            room.json = original.json.clone();
            room.set(&pointer, value.clone());
            loaded += usize::from(assert_survives(|| room.load()));
        }
    }
    assert!(loaded > 0, "none loads");
}
