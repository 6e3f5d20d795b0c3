//! A small valid scene in a temporary folder, for tests to change and load.

use std::fs;
use std::path::PathBuf;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use ppm_vk::internals::error::{Error, Result};
use ppm_vk::internals::loader::LoadOptions;
use ppm_vk::internals::scene::{Environment, Scene};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A glTF file under construction. Its buffer is `binary`; everything else is in `json`.
pub struct Fixture {
    pub json: Value,
    pub binary: Vec<u8>,
    pub folder: TempDir,
}

impl Fixture {
    /// A floor of two triangles (node, mesh and material 0), a lamp of one (1) above it, and a camera (node 2).
    ///
    /// Bounds: −1 to 1 along x and z, 0 to 1 along y. The lamp's area is ½. It loads without warnings.
    pub fn room() -> Self {
        let mut room = Self {
            json: json!({
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": [0, 1, 2]}],
                "nodes": [
                    {"name": "floor", "mesh": 0},
                    {"name": "lamp", "mesh": 1},
                    {"name": "eye", "camera": 0, "translation": [0, 0.5, 4]}
                ],
                "meshes": [
                    {"name": "floor", "primitives": [
                        {"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}
                    ]},
                    {"name": "lamp", "primitives": [{"attributes": {"POSITION": 3}, "material": 1}]}
                ],
                "materials": [
                    {"name": "white", "pbrMetallicRoughness": {"metallicFactor": 0},
                     "extensions": {"KHR_materials_specular": {"specularFactor": 0}}},
                    {"name": "lamp", "pbrMetallicRoughness": {"metallicFactor": 0}, "emissiveFactor": [1, 1, 1],
                     "extensions": {"KHR_materials_specular": {"specularFactor": 0}}}
                ],
                "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "aspectRatio": 2, "znear": 0.1}}],
                "accessors": [],
                "bufferViews": [],
                "buffers": [{"uri": "room.bin"}]
            }),
            binary: Vec::new(),
            folder: TempDir::new().expect("a temporary folder"),
        };
        room.add_vectors(&[[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]]);
        room.add_vectors(&[[0.0, 1.0, 0.0]; 4]);
        room.add_indices(&[0, 1, 2, 0, 2, 3]);
        room.add_vectors(&[[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]]);
        room
    }

    /// The room without floor and camera: only the lamp, node 0, one triangle with an area of ½.
    pub fn lamp() -> Self {
        let mut lamp = Self::room();
        lamp.set("/scenes/0/nodes", json!([0]));
        lamp.set("/nodes", json!([{"name": "lamp", "mesh": 1}]));
        lamp
    }

    /// Sets the value at a JSON pointer. The last part may be a new key, or `-` for a new element.
    pub fn set(&mut self, pointer: &str, value: Value) -> &mut Self {
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer with a slash");
        match self.json.pointer_mut(parent) {
            Some(Value::Object(object)) => {
                object.insert(key.to_owned(), value);
            }
            Some(Value::Array(array)) if key == "-" => array.push(value),
            Some(Value::Array(array)) => array[key.parse::<usize>().expect("an index")] = value,
            other => panic!("{pointer}: its parent is {other:?}"),
        }
        self
    }

    /// Removes an existing key.
    pub fn remove(&mut self, pointer: &str) -> &mut Self {
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer with a slash");
        let parent = self.json.pointer_mut(parent).and_then(Value::as_object_mut);
        let removed = parent.and_then(|parent| parent.remove(key));
        assert!(removed.is_some(), "{pointer} was not there");
        self
    }

    /// Adds an accessor of floats, VEC3, and returns its index.
    pub fn add_vectors(&mut self, vectors: &[[f32; 3]]) -> usize {
        let bytes: Vec<u8> = vectors.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.add_accessor(&bytes, vectors.len(), 5126, "VEC3")
    }

    /// Adds an accessor of 16-bit indices and returns its index.
    pub fn add_indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        self.add_accessor(&bytes, indices.len(), 5123, "SCALAR")
    }

    /// Adds an accessor with its own view, and returns its index.
    pub fn add_accessor(&mut self, bytes: &[u8], count: usize, component: u32, kind: &str) -> usize {
        let view = self.json["bufferViews"].as_array().expect("bufferViews").len();
        let accessor = self.json["accessors"].as_array().expect("accessors").len();
        let offset = self.binary.len();
        self.binary.extend_from_slice(bytes);
        self.set("/buffers/0/byteLength", json!(self.binary.len()));
        self.set(
            "/bufferViews/-",
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        );
        self.set(
            "/accessors/-",
            json!({"bufferView": view, "componentType": component, "count": count, "type": kind}),
        );
        accessor
    }

    /// Adds an accessor of floats of another type than VEC3, and returns its index.
    pub fn add_floats(&mut self, kind: &str, width: usize, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.add_accessor(&bytes, values.len() / width, 5126, kind)
    }

    /// Replaces elements of an accessor by a sparse part.
    pub fn add_sparse(&mut self, accessor: usize, indices: &[u16], values: &[[f32; 3]]) -> &mut Self {
        let view = |fixture: &Self, accessor: usize| fixture.json["accessors"][accessor]["bufferView"].clone();
        let places = self.add_indices(indices);
        let replaced = self.add_vectors(values);
        let sparse = json!({
            "count": indices.len(),
            "indices": {"bufferView": view(self, places), "componentType": 5123},
            "values": {"bufferView": view(self, replaced)}
        });
        self.set(&format!("/accessors/{accessor}/sparse"), sparse)
    }

    /// Overwrites a float of an accessor that `add_vectors` made.
    pub fn poke(&mut self, accessor: usize, float: usize, value: f32) -> &mut Self {
        let view = self.json["accessors"][accessor]["bufferView"].as_u64().expect("a view") as usize;
        let offset = self.json["bufferViews"][view]["byteOffset"]
            .as_u64()
            .expect("an offset") as usize;
        self.binary[offset + 4 * float..][..4].copy_from_slice(&value.to_le_bytes());
        self
    }

    /// Adds a node to the scene's roots, and returns its index.
    pub fn add_root(&mut self, node: Value) -> usize {
        let index = self.json["nodes"].as_array().expect("nodes").len();
        self.set("/nodes/-", node);
        self.set("/scenes/0/nodes/-", json!(index));
        index
    }

    /// Makes one new node the parent of all roots of the scene.
    pub fn add_parent(&mut self, mut node: Value) -> &mut Self {
        let index = self.json["nodes"].as_array().expect("nodes").len();
        node["children"] = self.json["scenes"][0]["nodes"].take();
        self.set("/nodes/-", node);
        self.set("/scenes/0/nodes", json!([index]))
    }

    /// Replaces the lamp by a mesh of these positions, without normals or indices.
    pub fn set_lamp(&mut self, positions: &[[f32; 3]]) -> &mut Self {
        let accessor = self.add_vectors(positions);
        self.set("/meshes/1/primitives/0/attributes", json!({"POSITION": accessor}))
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, bytes: &[u8]) {
        // Some file systems wait for the disk when a file is overwritten, which would be slow for thousands of loads.
        let _ = fs::remove_file(self.path(name));
        fs::write(self.path(name), bytes).expect("a file in the temporary folder");
    }

    /// Writes a file into the folder and loads it as a scene.
    pub fn load_bytes(&self, name: &str, bytes: &[u8]) -> Result<Scene> {
        self.write(name, bytes);
        Scene::load(&self.path(name))
    }

    /// Loads it as a `.gltf` file with `room.bin` beside it.
    pub fn load(&self) -> Result<Scene> {
        self.write("room.bin", &self.binary);
        self.load_bytes("room.gltf", self.json.to_string().as_bytes())
    }

    /// Writes a file into the folder and loads it at a time of its animations.
    pub fn load_bytes_at(&self, name: &str, bytes: &[u8], time: f64) -> Result<Scene> {
        self.write(name, bytes);
        let options = LoadOptions {
            frame_time: Some(time),
            ..LoadOptions::default()
        };
        Scene::load_with(&self.path(name), options)
    }

    /// Loads it at a time of its animations.
    pub fn load_at(&self, time: f64) -> Result<Scene> {
        self.write("room.bin", &self.binary);
        self.load_bytes_at("room.gltf", self.json.to_string().as_bytes(), time)
    }

    /// The same, which must succeed without warnings.
    #[track_caller]
    pub fn scene_at(&self, time: f64) -> Scene {
        match self.load_at(time) {
            Ok(scene) => {
                assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
                scene
            }
            Err(error) => panic!("should load, but: {error}"),
        }
    }

    /// Animates a property of a node: keyframe times, and the accessor of the values.
    pub fn animate(&mut self, node: usize, path: &str, interpolation: &str, times: &[f32], output: usize) -> &mut Self {
        let input = self.add_floats("SCALAR", 1, times);
        if self.json["animations"].is_null() {
            self.set("/animations", json!([{"samplers": [], "channels": []}]));
        }
        let sampler = self.json["animations"][0]["samplers"]
            .as_array()
            .expect("samplers")
            .len();
        self.set(
            "/animations/0/samplers/-",
            json!({"input": input, "output": output, "interpolation": interpolation}),
        );
        self.set(
            "/animations/0/channels/-",
            json!({"sampler": sampler, "target": {"node": node, "path": path}}),
        )
    }

    /// Loads it with a memory limit in bytes.
    pub fn load_within(&self, memory_limit: u64) -> Result<Scene> {
        self.write("room.bin", &self.binary);
        self.write("room.gltf", self.json.to_string().as_bytes());
        let options = LoadOptions {
            memory_limit: Some(memory_limit),
            ..LoadOptions::default()
        };
        Scene::load_with(&self.path("room.gltf"), options)
    }

    /// The same, with an environment.
    pub fn load_under(&self, environment: Environment) -> Result<Scene> {
        self.load_with(LoadOptions {
            environment: Some(environment),
            ..LoadOptions::default()
        })
    }

    /// The same with options.
    pub fn load_with(&self, options: LoadOptions) -> Result<Scene> {
        self.write("room.bin", &self.binary);
        self.write("room.gltf", self.json.to_string().as_bytes());
        Scene::load_with(&self.path("room.gltf"), options)
    }

    /// Loads it as a `.gltf` file with the buffer in a data URI.
    pub fn load_embedded(&mut self) -> Result<Scene> {
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.binary));
        self.set("/buffers/0/uri", json!(uri));
        self.load_bytes("embedded.gltf", self.json.to_string().as_bytes())
    }

    /// The bytes of the `.glb` file.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"][0].as_object_mut().expect("a buffer").remove("uri");
        let mut json = json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut binary = self.binary.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut glb = Vec::new();
        glb.extend_from_slice(b"glTF");
        glb.extend_from_slice(&2u32.to_le_bytes());
        glb.extend_from_slice(&((28 + json.len() + binary.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
            glb.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
            glb.extend_from_slice(kind);
            glb.extend_from_slice(&chunk);
        }
        glb
    }

    /// Loads it, which must succeed.
    #[track_caller]
    pub fn scene(&self) -> Scene {
        match self.load() {
            Ok(scene) => scene,
            Err(error) => panic!("should load, but: {error}"),
        }
    }

    /// Checks that there is exactly one warning, and that it has all these parts.
    #[track_caller]
    pub fn assert_warns(&self, parts: &[&str]) -> Scene {
        let scene = self.scene();
        assert_eq!(scene.warnings.len(), 1, "warnings: {:#?}", scene.warnings);
        let warning = &scene.warnings[0];
        assert!(!warning.contains('\n'), "more than a line: {warning:?}");
        for part in parts {
            assert!(warning.contains(part), "no {part:?} in: {warning}");
        }
        scene
    }

    /// Checks that loading fails with a line that contains all these parts.
    #[track_caller]
    pub fn assert_fails(&self, parts: &[&str]) {
        assert_error(self.load(), parts);
    }
}

/// Checks that a scene failed to load with one line that names the file and contains all these parts.
#[track_caller]
pub fn assert_error(result: Result<Scene>, parts: &[&str]) {
    let error = match result {
        Ok(scene) => panic!("should fail, but loads with the warnings {:?}", scene.warnings),
        Err(error) => error,
    };
    let (Error::Scene { path, what } | Error::Memory { path, what, .. }) = &error else {
        panic!("not an error about a scene: {error:?}");
    };
    assert!(!what.contains('\n') && what.len() < 500, "not a line: {what:?}");
    assert!(
        error.to_string().starts_with(&format!("{}: ", path.display())),
        "doesn't begin with the path: {error}"
    );
    for part in parts {
        assert!(error.to_string().contains(part), "no {part:?} in: {error}");
    }
}

/// Checks that two points or directions are the same to within f32 rounding.
#[track_caller]
pub fn assert_close(found: Vec3, wanted: [f32; 3]) {
    let wanted = Vec3::from(wanted);
    assert!(found.abs_diff_eq(wanted, 2e-6), "{found} instead of {wanted}");
}

/// The corners of all triangles, in order.
pub fn soup(scene: &Scene) -> Vec<[Vec3; 3]> {
    let corners = |vertices: [u32; 3]| vertices.map(|vertex| scene.positions[vertex as usize]);
    scene
        .triangles
        .iter()
        .map(|triangle| corners(triangle.vertices))
        .collect()
}

/// World positions of the corners of all triangles, in order.
pub fn world_soup(scene: &Scene) -> Vec<[Vec3; 3]> {
    let world = |position: Vec3| {
        let render = position.as_dvec3();
        (render / scene.normalisation.scale + scene.normalisation.centre).as_vec3()
    };
    soup(scene).into_iter().map(|corners| corners.map(world)).collect()
}

/// The normal given by the order of a triangle's corners.
pub fn winding_normal(scene: &Scene, triangle: usize) -> Vec3 {
    let [a, b, c] = scene.triangles[triangle]
        .vertices
        .map(|vertex| scene.positions[vertex as usize]);
    (b - a).cross(c - a).normalize()
}
