//! Renders seen while they go on: events for scripts.

#[path = "watching/events.rs"]
mod events;

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
