//! Frames of animations: their files, their bits, what is told of them, and how they differ.

#[path = "program/animated.rs"]
mod animated;
#[path = "program/frames.rs"]
mod frames;
#[path = "program/mod.rs"]
mod program;

use std::fs;
use std::path::{Path, PathBuf};

use frames::{assert_frames_go_on_and_merge, picture, render};
use ppm_vk::{Flicker, Platform, PreparedScene, RenderConfig, Scene, Session, Until};
use program::{ppm_vk, stderr};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with the animated Cornell box, `scene.gltf`.
fn animated_cornell() -> TempDir {
    let folder = TempDir::new().expect("folder");
    animated::cornell(folder.path());
    folder
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// The events of a kind.
fn events(stdout: &str, kind: &str) -> Vec<Value> {
    let events = stdout
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    events.filter(|event| event["event"] == kind).collect()
}

#[test]
fn each_frame_has_files_of_its_own_and_the_bits_of_a_render_at_its_time() {
    let folder = animated_cornell();
    let all = ["--frames", "1..3", "--fps", "4", "-o", "out.exr", "--png", "view.png"];
    let stdout = render(&folder, "scene.gltf", &[&all[..], &["--progress", "json"]].concat());
    for (frame, time) in [(1, "0.25"), (2, "0.5"), (3, "0.75")] {
        let alone = format!("alone.{frame}.exr");
        render(&folder, "scene.gltf", &["--frame-time", time, "-o", &alone]);
        assert!(
            picture(&folder, &format!("out.{frame:04}.exr")) == picture(&folder, &alone),
            "frame {frame} differs from a render at {time} s"
        );
        assert!(folder.path().join(format!("view.{frame:04}.png")).exists());
    }
    assert!(
        picture(&folder, "out.0001.exr") != picture(&folder, "out.0002.exr"),
        "it moves"
    );
    assert!(!folder.path().join("out.exr").exists());

    let begun = events(&stdout, "frame");
    let told: Vec<_> = begun
        .iter()
        .map(|event| (event["frame"].as_u64(), event["time"].as_f64()))
        .collect();
    assert_eq!(
        told,
        [(Some(1), Some(0.25)), (Some(2), Some(0.5)), (Some(3), Some(0.75))]
    );
    assert!(begun.iter().all(|event| event["first"] == 1 && event["last"] == 3));
    let done = events(&stdout, "frame_done");
    assert_eq!(done.len(), 3);
    assert!(
        done.iter()
            .all(|event| event["estimated_error"].as_f64().is_some_and(|error| error > 0.0))
    );
    assert!(done[0]["flicker"].is_null() && done[1]["same_as"].is_null());
    assert!(
        done[1..]
            .iter()
            .all(|event| event["flicker"]["noise"].as_f64().is_some_and(|noise| noise > 0.0))
    );
}

/// A session that follows on another one, of the same scene or of another, learns anew.
#[test]
fn a_still_scene_has_the_same_bits_in_every_frame() {
    let load = |name: &str| Scene::load(&shipped(name)).expect("a scene");
    let (spheres, box_) = (load("cornell-spheres.gltf"), load("cornell.gltf"));
    let [still, other] = [&spheres, &box_].map(|scene| PreparedScene::new(scene).expect("it fits"));
    let config = RenderConfig {
        resolution: [48, 32],
        photons: 4000,
        ..RenderConfig::default()
    };
    for platform in [Platform::default(), Platform::Cpu] {
        let camera = &spheres.cameras[0];
        let mut session = Session::new(&still, camera, &config, &platform).expect("a session");
        let first = session.render(Until::iterations(5)).expect("a picture");
        assert!(session.is_of(&still, camera, &config) && !session.is_of(&other, camera, &config));
        session = session.next(&still, camera, &config, &|_| ()).expect("a session");
        let second = session.render(Until::iterations(5)).expect("a picture");
        session = session
            .next(&other, &box_.cameras[0], &config, &|_| ())
            .expect("a session");
        session.render(Until::iterations(2)).expect("a picture");
        session = session.next(&still, camera, &config, &|_| ()).expect("a session");
        let third = session.render(Until::iterations(5)).expect("a picture");
        assert!(
            first.image() == second.image() && first.image() == third.image(),
            "{platform:?}"
        );
    }
}

#[test]
fn where_nothing_moves_a_frame_has_the_picture_of_the_one_before() {
    let folder = animated_cornell();
    // The animation ends after a second.
    let stdout = render(
        &folder,
        "scene.gltf",
        &["--frames", "1..3", "--fps", "1", "-o", "out.exr", "--progress", "json"],
    );
    let read = |frame: u32| fs::read(folder.path().join(format!("out.{frame:04}.exr"))).expect("a file");
    assert!(read(1) == read(2) && read(1) == read(3));
    let done = events(&stdout, "frame_done");
    assert_eq!(
        [&done[0]["same_as"], &done[1]["same_as"], &done[2]["same_as"]],
        [&Value::Null, &1.into(), &1.into()]
    );
    assert_eq!(
        (
            done[1]["flicker"]["still"].as_f64(),
            done[1]["flicker"]["difference"].as_f64()
        ),
        (Some(1.0), Some(0.0))
    );
    assert_eq!(events(&stdout, "iteration").len(), 8, "one frame is rendered");
}

/// Between two frames of the box the short block, its shadow and its reflected light move.
#[test]
fn where_nothing_moves_frames_differ_by_no_more_than_the_noise() {
    let folder = animated_cornell();
    let load = |time| {
        let options = ppm_vk::LoadOptions {
            frame_time: Some(time),
            ..ppm_vk::LoadOptions::default()
        };
        Scene::load_with(&folder.path().join("scene.gltf"), options).expect("a scene")
    };
    let config = RenderConfig {
        resolution: [64, 64],
        photons: 20_000,
        ..RenderConfig::default()
    };
    let scene = load(0.5);
    let prepared = PreparedScene::new(&scene).expect("it fits");
    let mut session = Session::new(&prepared, &scene.cameras[0], &config, &Platform::default()).expect("a session");
    let before = session.render(Until::iterations(32)).expect("a picture");
    let scene = load(0.54);
    let prepared = PreparedScene::new(&scene).expect("it fits");
    session = session
        .next(&prepared, &scene.cameras[0], &config, &|_| ())
        .expect("a session");
    let after = session.render(Until::iterations(32)).expect("a picture");

    let flicker: Flicker = after.flicker(&before).expect("errors are known");
    assert!((0.5..1.0).contains(&flicker.still), "{flicker}");
    assert!(flicker.difference <= flicker.noise, "{flicker}");

    // Chosen without looking at the pictures: the upper third, ceiling and walls, which lie far from the block.
    let upper = 64 * 21;
    let sum = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>();
    let differences = before.image().pixels()[..upper]
        .iter()
        .flatten()
        .zip(after.image().pixels()[..upper].iter().flatten());
    let difference2 = sum(&mut differences.map(|(x, y)| f64::from(x - y).powi(2)));
    let errors = [&before, &after].map(|rendered| rendered.pixel_errors().expect("errors are known"));
    let explained2 = sum(&mut errors
        .iter()
        .flat_map(|errors| errors.pixels()[..upper].iter().flatten())
        .map(|error| f64::from(*error).powi(2)));
    assert!(difference2 <= explained2, "{difference2} > {explained2}");
}

#[test]
fn states_and_parts_are_those_of_each_frame() {
    let folder = animated_cornell();
    assert_frames_go_on_and_merge(&folder, &["--frames", "0..1", "--fps", "2"], ["0000", "0001"]);
}

#[test]
fn ranges_and_flags_that_contradict_each_other_are_refused() {
    let folder = TempDir::new().expect("folder");
    for (arguments, words) in [
        (&["--frames", "5..3"][..], &["--frames", "3..5"][..]),
        (&["--frames", "-2..3"], &["--frames", "from 0 on"]),
        (&["--frames", "7"], &["--frames", "A..B"]),
        (
            &["--frames", "1..3", "--frame-time", "1"],
            &["--frames", "--frame-time"],
        ),
        (&["--fps", "25"], &["--frames"]),
        (&["--frames", "1..3", "--fps", "0"], &["--fps"]),
    ] {
        let scene = shipped("cornell.gltf");
        let all: Vec<&str> = ["--scene", scene.to_str().expect("UTF-8")]
            .into_iter()
            .chain(arguments.iter().copied())
            .collect();
        let output = ppm_vk(folder.path(), &all);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{arguments:?}: {text}");
    }
    assert_eq!(fs::read_dir(folder.path()).expect("folder").count(), 0);
}

#[test]
fn files_of_all_frames_are_checked_before_the_first() {
    let folder = animated_cornell();
    fs::create_dir(folder.path().join("out.0001.exr")).expect("folder");
    let output = ppm_vk(
        folder.path(),
        &["--scene", "scene.gltf", "--frames", "0..1", "-o", "out.exr", "--quiet"],
    );
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("out.0001.exr") && text.contains("folder"), "{text}");
    assert!(!folder.path().join("out.0000.exr").exists());
}
