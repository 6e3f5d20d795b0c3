//! Renders seen while they go on: events for scripts, a viewer.

#[path = "watching/events.rs"]
mod events;
#[path = "watching/viewer.rs"]
mod viewer;

use std::path::Path;
use std::process::{Command, Output};

/// The program, which renders a small picture of a scene in a folder, to `o.exr`: of 32x24 pixels, unless the
/// arguments say otherwise.
fn small(folder: &Path, arguments: &[&str]) -> Command {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.gltf");
    let mut command = Command::new(env!("CARGO_BIN_EXE_ppm-vk"));
    command
        .current_dir(folder)
        .arg("--scene")
        .arg(scene)
        .args(["-o", "o.exr", "--photons", "2000"])
        .args(arguments);
    if !arguments.contains(&"--resolution") {
        command.args(["--resolution", "32x24"]);
    }
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    small(folder, arguments).output().expect("ppm-vk runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The pixels of the picture that the program wrote.
fn written(folder: &Path) -> ppm_vk::Image {
    ppm_vk::read_exr(&folder.join("o.exr")).expect("a picture")
}

#[test]
fn wrong_arguments_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for arguments in [
        ["--view", "localhost"],
        ["--view", "localhost:0x1"],
        ["--progress", "xml"],
    ] {
        let output = run(folder.path(), &arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(arguments[0]), "{arguments:?}: {text}");
    }
}
