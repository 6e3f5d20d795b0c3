//! Files damaged at random load or give an error, but nothing worse.

use ppm_vk::error::Result;
use ppm_vk::scene::Scene;
use serde_json::{Value, json};

use crate::fixture::Fixture;

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
        assert!(camera.position.is_finite() && camera.tan_half_fov > 0.0 && camera.tan_half_fov.is_finite());
    }
    for light in scene.emissive_triangles() {
        assert!(light.power > 0.0 && light.power.is_finite());
    }
}

/// Checks what loading gives, and returns whether it is a scene.
#[track_caller]
fn assert_survives(result: Result<Scene>) -> bool {
    match result {
        Ok(scene) => {
            assert_sound(&scene);
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
    let loaded = (0..rounds).filter(|&round| assert_survives(load(&damage(original, &mut Random(round)))));
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
            loaded += usize::from(assert_survives(room.load()));
        }
    }
    assert!(loaded > 0, "none loads");
}
