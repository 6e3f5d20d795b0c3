//! An animated scene.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

/// Writes `scene.gltf` into a folder: the Cornell box, whose short block moves for a second.
pub fn cornell(folder: &Path) {
    moving(folder, "cornell", "short", [[0.33, 0.0005, 0.35], [-0.2, 0.5, 0.35]]);
}

/// Writes `scene.gltf` into a folder: a scene of `scenes/` in which a node moves from one place to another for a second.
pub fn moving(folder: &Path, name: &str, node: &str, [from, to]: [[f32; 3]; 2]) {
    let shipped = |ending| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(format!("{name}.{ending}"))
    };
    let mut scene: Value = serde_json::from_slice(&fs::read(shipped("gltf")).expect("scene")).expect("JSON");
    fs::copy(shipped("bin"), folder.join(format!("{name}.bin"))).expect("buffer");
    let nodes = scene["nodes"].as_array().expect("nodes");
    let node = nodes.iter().position(|other| other["name"] == node);
    let node = node.expect("the node");
    // Two times; two translations.
    let values = [&[0.0f32, 1.0], &from[..], &to[..]].concat();
    fs::write(folder.join("move.bin"), bytemuck::cast_slice::<_, u8>(&values)).expect("buffer");
    let mut add = |list: &str, entry: Value| {
        let list = scene[list].as_array_mut().expect("a list");
        list.push(entry);
        list.len() - 1
    };
    let buffer = add("buffers", json!({"uri": "move.bin", "byteLength": 32}));
    let times = add("bufferViews", json!({"buffer": buffer, "byteLength": 8}));
    let places = add(
        "bufferViews",
        json!({"buffer": buffer, "byteOffset": 8, "byteLength": 24}),
    );
    let times = add(
        "accessors",
        json!({"bufferView": times, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0.0], "max": [1.0]}),
    );
    let places = add(
        "accessors",
        json!({"bufferView": places, "componentType": 5126, "count": 2, "type": "VEC3"}),
    );
    scene["animations"] = json!([{
        "samplers": [{"input": times, "output": places}],
        "channels": [{"sampler": 0, "target": {"node": node, "path": "translation"}}],
    }]);
    fs::write(folder.join("scene.gltf"), scene.to_string()).expect("scene");
}
