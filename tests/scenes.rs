//! The scenes in `scenes/` and the generator that writes them.

#[path = "../examples/make_scenes/scenes/mod.rs"]
mod scenes;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

#[test]
fn the_committed_scenes_are_those_of_the_generator() {
    let files = scenes::all();
    for file in &files {
        let committed = fs::read(folder().join(&file.name)).unwrap_or_default();
        assert!(
            committed == file.bytes,
            "scenes/{} is missing or out of date: cargo run --example make_scenes -- scenes",
            file.name
        );
    }
    let written: BTreeSet<&str> = files.iter().map(|file| file.name.as_str()).collect();
    for entry in fs::read_dir(folder()).expect("the folder scenes") {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        assert!(
            name == "README.md" || written.contains(name.as_str()),
            "scenes/{name} is not written by the generator"
        );
    }
}

#[test]
fn the_scenes_are_valid_gltf_with_indices_inside_their_vertices() {
    for pair in scenes::all().chunks(2) {
        let [document, buffer] = pair else {
            panic!("a scene is a document and a buffer");
        };
        let name = &document.name;
        let gltf::Gltf { document, .. } =
            gltf::Gltf::from_slice(&document.bytes).unwrap_or_else(|error| panic!("{name} is no valid glTF: {error}"));
        assert_eq!(document.cameras().len(), 1, "{name}");
        for primitive in document.meshes().flat_map(|mesh| mesh.primitives()) {
            let reader = primitive.reader(|_| Some(&buffer.bytes));
            let vertices = reader.read_positions().expect("positions").count();
            let indices = reader.read_indices().expect("indices").into_u32();
            assert!(
                indices.into_iter().all(|index| (index as usize) < vertices),
                "{name}: an index lies past the {vertices} vertices"
            );
        }
    }
}

#[test]
fn the_readme_describes_every_scene() {
    let readme = fs::read_to_string(folder().join("README.md")).expect("scenes/README.md");
    for file in scenes::all() {
        let scene = file.name.trim_end_matches(".bin").trim_end_matches(".gltf");
        assert!(
            readme.contains(&format!("`{scene}`")),
            "scenes/README.md lacks a line for {scene}"
        );
    }
}
