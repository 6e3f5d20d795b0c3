//! Adds up the parts of a render.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;

use super::Outcome;
use super::args::{LookArguments, exr_file, png_file, view_layer};
use super::denoise::{DenoiseArguments, denoise};
use super::outputs::{PictureFiles, all, check_outputs, named};
use ppm_vk::internals::files::Writing;
use ppm_vk::{Merge, Rendered, State};

/// Merge the states of parts (--part K/N --state FILE) into a picture. The order of parts does not matter, to the bit.
#[derive(Debug, Args)]
pub struct MergeArguments {
    /// States of parts, or of merged parts.
    #[arg(required = true, value_name = "PART.state")]
    pub parts: Vec<PathBuf>,
    /// Linear RGB OpenEXR picture.
    #[arg(short, long, value_name = "FILE.exr", value_parser = exr_file)]
    pub output: PathBuf,
    /// Tone-mapped picture.
    #[arg(long, value_name = "FILE.png", value_parser = png_file)]
    pub png: Option<PathBuf>,
    /// Name the EXR's channels as Blender names those of this view layer.
    #[arg(long, value_name = "NAME", value_parser = view_layer)]
    pub layer_name: Option<String>,
    #[command(flatten)]
    pub look: LookArguments,
    #[command(flatten)]
    pub denoise: DenoiseArguments,
    /// Write the sum, which can be merged with other parts.
    #[arg(long, value_name = "FILE", value_parser = named("state"))]
    pub state: Option<PathBuf>,
}

/// The command.
pub fn run(arguments: &MergeArguments) -> Result<Outcome> {
    let inputs: Vec<&Path> = arguments.parts.iter().map(PathBuf::as_path).collect();
    let outputs = [
        Some(&arguments.output),
        arguments.png.as_ref(),
        arguments.state.as_ref(),
    ];
    check_outputs(&inputs, outputs.into_iter().flatten().map(PathBuf::as_path))?;
    let denoiser = arguments.denoise.open()?;
    let mut merge: Option<Merge> = None;
    for path in &arguments.parts {
        let state = State::read(path)?;
        let added = match &mut merge {
            Some(merge) => merge.add(&state),
            none => Merge::new(&state).map(|merge| *none = Some(merge)),
        };
        added.with_context(|| path.display().to_string())?;
    }
    let merge = merge.context("no part is given")?;
    let mut rendered = merge.rendered();
    let denoised = denoise(&mut rendered, denoiser.as_ref());
    say_merged(&merge, &rendered, &arguments.output);
    let _writing = Writing::begin();
    let files = PictureFiles {
        exr: arguments.output.clone(),
        png: arguments.png.clone(),
        view_layer: arguments.layer_name.clone(),
        look: arguments.look.into(),
    };
    let state = arguments.state.as_ref();
    let state = state.map(|file| Ok(merge.state()?.write(file)?));
    all(files
        .write(&rendered, |_| ())
        .into_iter()
        .chain(state)
        .chain([denoised]))?;
    Ok(Outcome::Done)
}

fn say_merged(merge: &Merge, rendered: &Rendered, output: &Path) {
    let missing = merge.missing();
    if !missing.is_empty() {
        let numbers: Vec<String> = missing.iter().map(u32::to_string).collect();
        say!(
            "warning: of {} parts, {} are missing ({}): the picture is noisier than the whole",
            merge.parts(),
            missing.len(),
            numbers.join(", ")
        );
    }
    say!(
        "{}: {} of {} parts, {} iterations, {} photon paths{}",
        output.display(),
        merge.parts() as usize - missing.len(),
        merge.parts(),
        rendered.iterations(),
        rendered.subject().photons_emitted,
        rendered.error().map_or(String::new(), |error| format!("; {error}")),
    );
}
