//! Small renders of scenes that move.

use ppm_vk::{Image, read_exr};
use tempfile::TempDir;

use super::program::{ppm_vk, stderr};

const SMALL: [&str; 5] = ["--quiet", "--resolution", "48x32", "--photons", "4000"];

/// Renders; returns stdout.
#[track_caller]
pub fn render(folder: &TempDir, scene: &str, more: &[&str]) -> String {
    let mut arguments = [&["--scene", scene], &SMALL[..], more].concat();
    if !more.contains(&"--iterations") {
        arguments.extend(["--iterations", "8"]);
    }
    let output = ppm_vk(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{more:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("UTF-8")
}

pub fn picture(folder: &TempDir, name: &str) -> Image {
    read_exr(&folder.path().join(name)).unwrap_or_else(|error| panic!("{error}"))
}

/// Frames of the animated `scene.gltf` of a folder, by these arguments: they go on from their states with the same bits, and their parts
/// can be merged.
#[track_caller]
pub fn assert_frames_go_on_and_merge(folder: &TempDir, frames: &[&str], numbers: [&str; 2]) {
    let render = |more: &[&str]| render(folder, "scene.gltf", &[frames, more].concat());
    render(&["-o", "whole.exr"]);
    render(&["-o", "on.exr", "--state", "on.state", "--iterations", "3"]);
    render(&["-o", "on.exr", "--state", "on.state", "--resume"]);
    for part in ["1/2", "2/2"] {
        let state = format!("part{}.state", &part[..1]);
        render(&["-o", "part.exr", "--state", &state, "--part", part]);
    }
    for frame in numbers {
        let [whole, on] = ["whole", "on"].map(|name| picture(folder, &format!("{name}.{frame}.exr")));
        assert!(whole == on, "frame {frame} goes on with other bits");
        let [first, second] = [1, 2].map(|part| format!("part{part}.{frame}.state"));
        let merged = ppm_vk(folder.path(), &["merge", &first, &second, "-o", "merged.exr"]);
        assert_eq!(merged.status.code(), Some(0), "{}", stderr(&merged));
    }
}
