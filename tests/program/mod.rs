//! Running the program.

use std::path::Path;
use std::process::{Command, Output};

/// Runs `ppm-vk ARGUMENTS` in a folder.
pub fn ppm_vk(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ppm-vk"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("ppm-vk runs")
}

/// Its output to stderr.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
