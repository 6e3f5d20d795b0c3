//! Regression tests for faults in inputs and files.

#[path = "program/mod.rs"]
mod program;

use std::path::{Path, PathBuf};

use ppm_vk::internals::film::read_exr;
use ppm_vk::internals::metrics::{Defects, defects};
use program::{ppm_vk, stderr};
use serde_json::{Value, json};
use tempfile::TempDir;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// The box with one change, in a folder.
fn changed_box(folder: &Path, change: impl FnOnce(&mut Value)) -> PathBuf {
    let text = std::fs::read_to_string(scenes().join("cornell.gltf")).expect("the scene");
    let mut scene: Value = serde_json::from_str(&text).expect("JSON");
    change(&mut scene);
    let path = folder.join("changed.gltf");
    std::fs::write(&path, scene.to_string()).expect("a scene");
    std::fs::copy(scenes().join("cornell.bin"), folder.join("cornell.bin")).expect("its buffer");
    path
}

/// Renders a scene to `o.exr`; returns the messages.
fn render(folder: &Path, scene: &Path, more: &[&str]) -> Vec<String> {
    let scene = scene.to_str().expect("UTF-8");
    let arguments = ["--scene", scene, "-o", "o.exr", "--quiet", "--resolution", "16x16"];
    let output = ppm_vk(folder, &[&arguments, more].concat());
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{more:?}: {said}");
    said.lines().map(str::to_owned).collect()
}

fn warnings(said: &[String]) -> Vec<&String> {
    said.iter().filter(|line| line.starts_with("warning: ")).collect()
}

/// Also if one or two paths are so long that they are shortened.
#[test]
fn scenes_that_are_fine_give_no_warning() {
    let folder = TempDir::new().expect("folder");
    for name in [
        "cornell",
        "cornell-spheres",
        "pool",
        "glasses",
        "glossy",
        "instances",
        "lights",
    ] {
        let scene = scenes().join(name).with_extension("gltf");
        let settings = ["--iterations", "8", "--photons", "20000", "--backend", "cpu"];
        let said = render(folder.path(), &scene, &settings);
        assert!(warnings(&said).is_empty(), "{name}: {said:#?}");
    }
}

#[test]
fn a_warning_of_missing_light_names_the_amount_and_a_remedy() {
    let folder = TempDir::new().expect("folder");
    let settings = [
        "--iterations",
        "2",
        "--photons",
        "2000",
        "--max-depth",
        "3",
        "--backend",
        "cpu",
    ];
    let said = render(folder.path(), &scenes().join("pool.gltf"), &settings);
    let warnings = warnings(&said);
    assert_eq!(warnings.len(), 1, "{said:#?}");
    let words = warnings[0].split(' ').collect::<Vec<_>>();
    let percent = words.iter().position(|word| *word == "%").expect("a share");
    let share: f64 = words[percent - 1].parse().expect("a share");
    // Light enters the water, goes down, up and out again: more than a few percent of it takes more than three bounces.
    assert!((5.0..100.0).contains(&share), "{said:#?}");
    assert!(warnings[0].contains("raise --max-depth"), "{said:#?}");
}

#[test]
fn a_black_picture_is_reported() {
    let folder = TempDir::new().expect("folder");
    let scene = changed_box(folder.path(), |scene| {
        for material in scene["materials"].as_array_mut().expect("materials") {
            let material = material.as_object_mut().expect("a material");
            material.remove("emissiveFactor");
            material.remove("extensions");
        }
        scene["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        scene["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
        // In front of the room, facing away from it.
        let turned_round = json!({
            "translation": [0, 1, 20], "rotation": [0, 1, 0, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}
        });
        let nodes = scene["nodes"].as_array_mut().expect("nodes");
        nodes.push(turned_round);
        let index = nodes.len() - 1;
        scene["scenes"][0]["nodes"]
            .as_array_mut()
            .expect("roots")
            .push(index.into());
    });
    for backend in ["vulkan", "cpu"] {
        let settings = ["--iterations", "1", "--photons", "500", "--backend", backend];
        let said = render(folder.path(), &scene, &settings);
        let warnings = warnings(&said);
        assert!(
            warnings.len() == 1 && warnings[0].contains("the picture is black"),
            "{backend}: {said:#?}"
        );
    }
}

/// A light near the limits of f32.
#[test]
fn no_picture_has_values_that_are_no_numbers() {
    let folder = TempDir::new().expect("folder");
    let scene = changed_box(folder.path(), |scene| {
        for material in scene["materials"].as_array_mut().expect("materials") {
            if material.get("emissiveFactor").is_some() {
                material["extensions"]["KHR_materials_emissive_strength"] = json!({"emissiveStrength": 3e38});
            }
        }
        scene["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
    });
    for backend in ["vulkan", "cpu"] {
        let settings = ["--iterations", "4", "--photons", "4000", "--backend", backend];
        let said = render(folder.path(), &scene, &settings);
        let image = read_exr(&folder.path().join("o.exr")).expect("a picture");
        assert_eq!(defects(&image), Defects::default(), "{backend}: {said:#?}");
        let warnings = warnings(&said);
        // Sums in f64 have a larger range than the picture's numbers, which can represent this one.
        assert!(
            (warnings.is_empty() && backend == "cpu")
                || warnings.len() == 1
                    && warnings[0].contains("count as black")
                    && warnings[0].contains("scale its lights down"),
            "{backend}: {said:#?}"
        );
    }
}

/// Reading from a pipe without a writer would wait for ever.
#[cfg(target_os = "linux")]
#[test]
fn a_pipe_in_the_place_of_a_cache_is_not_waited_for() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let folder = TempDir::new().expect("folder");
    let cache = folder.path().join("cache");
    let scene = scenes().join("cornell.gltf");
    let start = || {
        Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
            .args(["--scene", scene.to_str().expect("UTF-8"), "-o", "o.exr", "--quiet"])
            .args(["--resolution", "16x16", "--iterations", "1", "--photons", "500"])
            .current_dir(folder.path())
            .env("XDG_CACHE_HOME", &cache)
            .stderr(Stdio::null())
            .spawn()
            .expect("ppm-vk starts")
    };
    assert!(start().wait().expect("exit").success());
    let cached: Vec<PathBuf> = std::fs::read_dir(cache.join("ppm-vk"))
        .expect("what is cached")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    assert!(!cached.is_empty(), "nothing is cached");
    for path in cached {
        std::fs::remove_file(&path).expect("removed");
        assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo").success());
    }
    let mut again = start();
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = again.try_wait().expect("a status") {
            break status;
        }
        if begin.elapsed() > Duration::from_secs(60) {
            again.kill().expect("killed");
            panic!("it waits for a writer");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert!(status.success());
}
