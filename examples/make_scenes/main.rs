//! Writes the scenes of this repository: `cargo run --example make_scenes -- scenes`.

mod scenes;

use anyhow::Context;
use std::fs;
use std::path::PathBuf;

fn main() -> anyhow::Result<()> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder = folder.context("name the folder to write to: cargo run --example make_scenes -- scenes")?;
    for file in scenes::all() {
        let path = folder.join(&file.name);
        fs::write(&path, &file.bytes).with_context(|| format!("{} can't be written", path.display()))?;
    }
    Ok(())
}
