//! The files that are damaged, and how they are read.

use std::fs;
use std::ops::Range;
use std::path::Path;

use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::{Environment, Scene};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::damage::{self, Random};
use crate::encoded::MESHOPT;
use crate::fixture::Fixture;
use crate::inputs;
use crate::survival::{Outcome, assert_shines, assert_sound};

/// A valid file.
pub enum Original {
    Scene(Box<SceneFile>),
    Picture(Picture),
}

impl Original {
    /// Its description.
    pub fn name(&self) -> &str {
        match self {
            Self::Scene(scene) => &scene.name,
            Self::Picture(picture) => &picture.name,
        }
    }

    /// Reads it unchanged.
    pub fn read(&self) -> Outcome {
        match self {
            Self::Scene(scene) => scene.read(&scene.fixture.json, &scene.fixture.binary, None),
            Self::Picture(picture) => picture.read(&picture.bytes),
        }
    }

    /// Reads it with the damage of this number.
    pub fn damaged(&self, number: u64) -> Outcome {
        let mut random = Random::new(number);
        match self {
            Self::Scene(scene) => scene.damaged(&mut random),
            Self::Picture(picture) => picture.read(&damage::bytes(&picture.bytes, &mut random)),
        }
    }
}

/// All of them, including those of `../shared` if it exists.
pub fn all() -> Vec<Original> {
    let scene = |name: &str, fixture| Original::Scene(Box::new(SceneFile::new(name, fixture)));
    let mut all = vec![
        scene("skins, morphs, meshopt", inputs::moving()),
        scene("Draco", inputs::draco()),
        scene("WebP, KTX 2.0, PNG, JPEG", inputs::pictured()),
        scene("instances, variants, lights", inputs::chosen()),
    ];
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets");
    for file in [
        "compressed/BoxMeshopt/BoxMeshopt.glb",
        "blender/diamond-draco.glb",
        "blender/chandelier-gpuinst.glb",
    ] {
        match fs::read(shared.join(file)) {
            Ok(bytes) => all.push(scene(file, inputs::of_glb(&bytes))),
            Err(_) => println!("skipped: missing: ../shared/assets/{file}"),
        }
    }
    all.extend(
        inputs::pictures()
            .into_iter()
            .map(|(name, extension, bytes)| Original::Picture(Picture::new(name, extension, bytes))),
    );
    all
}

/// Reads a simple scene as often as it has values, with several replacements for each.
pub fn with_replaced_values(read: impl Fn(u64, &dyn Fn() -> Outcome) -> Outcome) -> Vec<Outcome> {
    let scene = SceneFile::new("the room", Fixture::room());
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
    let replaced = scene
        .places
        .iter()
        .flat_map(|place| values.iter().map(move |value| (place, value)));
    let outcomes = replaced.zip(0..).map(|((place, value), number)| {
        let mut json = scene.fixture.json.clone();
        *json.pointer_mut(place).expect("a value") = value.clone();
        read(number, &|| scene.read(&json, &scene.fixture.binary, None))
    });
    outcomes.collect()
}

/// A scene, as JSON and a buffer.
pub struct SceneFile {
    name: String,
    fixture: Fixture,
    /// Pointers to all values.
    places: Vec<String>,
    /// The byte ranges of views.
    views: Vec<Range<usize>>,
}

impl SceneFile {
    fn new(name: &str, fixture: Fixture) -> Self {
        let views = fixture.json["bufferViews"].as_array().into_iter().flatten();
        let places = views.flat_map(|view| [view, &view["extensions"][MESHOPT]]);
        let range = |view: &Value| {
            let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
            let end = start + view["byteLength"].as_u64()? as usize;
            (view["buffer"] == 0 && start < end && end <= fixture.binary.len()).then_some(start..end)
        };
        Self {
            name: name.to_owned(),
            places: damage::pointers(&fixture.json),
            views: places.filter_map(range).collect(),
            fixture,
        }
    }

    fn damaged(&self, random: &mut Random) -> Outcome {
        let mut json = self.fixture.json.clone();
        let mut binary = self.fixture.binary.clone();
        let variant = (random.below(4) == 0).then_some("second");
        let kind = random.below(8);
        match kind {
            0 => {
                let text = damage::bytes(json.to_string().as_bytes(), random);
                self.fixture.write("room.bin", &binary);
                return self.read_bytes("damaged.gltf", &text, variant);
            }
            1 => return self.read_bytes("damaged.glb", &damage::bytes(&self.fixture.glb(), random), variant),
            2..=4 => damage::json(&mut json, &self.places, random),
            _ => {}
        }
        if kind >= 4 && !self.views.is_empty() {
            let view = random.of(&self.views).clone();
            let mut damaged = damage::bytes(&binary[view.clone()], random);
            damaged.resize(view.len(), 0);
            binary[view].copy_from_slice(&damaged);
        }
        self.read(&json, &binary, variant)
    }

    fn read(&self, json: &Value, binary: &[u8], variant: Option<&str>) -> Outcome {
        self.fixture.write("room.bin", binary);
        self.read_bytes("damaged.gltf", json.to_string().as_bytes(), variant)
    }

    fn read_bytes(&self, name: &str, bytes: &[u8], variant: Option<&str>) -> Outcome {
        self.fixture.write(name, bytes);
        let options = LoadOptions {
            frame_time: Some(0.5),
            variant: variant.map(str::to_owned),
            ..LoadOptions::default()
        };
        Outcome::of(Scene::load_with(&self.fixture.path(name), options), assert_sound)
    }
}

/// An image that is read as an environment.
pub struct Picture {
    name: String,
    bytes: Vec<u8>,
    extension: &'static str,
    folder: TempDir,
}

impl Picture {
    fn new(name: &str, extension: &'static str, bytes: Vec<u8>) -> Self {
        Self {
            name: name.to_owned(),
            bytes,
            extension,
            folder: TempDir::new().expect("a temporary folder"),
        }
    }

    fn read(&self, bytes: &[u8]) -> Outcome {
        let path = self.folder.path().join(format!("sky.{}", self.extension));
        let _ = fs::remove_file(&path);
        fs::write(&path, bytes).expect("a file in the temporary folder");
        Outcome::of(Environment::read(&path, 2 << 30), assert_shines)
    }
}
