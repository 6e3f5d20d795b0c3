//! Running the program.

use std::path::Path;
use std::process::{Command, Output};

/// What `ppm-vk ARGUMENTS` does in a folder.
pub fn ppm_vk(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("ppm-vk runs")
}

/// What it said to stderr.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
