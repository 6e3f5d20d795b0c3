//! Removes a picture's noise before it is written.

use std::env;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use ppm_vk::{Denoiser, Rendered};

/// The environment variable that names the library's file.
pub const LIBRARY: &str = "PPM_VK_OIDN";

/// Whether to do it.
#[derive(Debug, Clone, Copy, Args)]
pub struct DenoiseArguments {
    /// Remove noise by Open Image Denoise 2, a library that is loaded then (docs/denoising.md); the EXR has the noisy picture as
    /// a layer. Caustics get softer.
    #[arg(long)]
    denoise: bool,
}

impl DenoiseArguments {
    /// The denoiser, if one is wanted. Opened before a render, so that none is made in vain.
    pub fn open(self) -> Result<Option<Denoiser>> {
        let library = env::var_os(LIBRARY).filter(|file| !file.is_empty());
        let library = library.as_deref().map(Path::new);
        Ok(self.denoise.then(|| Denoiser::open(library)).transpose()?)
    }
}

/// Removes the noise, if there is a denoiser. If that fails, the picture stays as it is.
pub fn denoise(rendered: &mut Rendered, denoiser: Option<&Denoiser>) -> Result<()> {
    let Some(denoiser) = denoiser else {
        return Ok(());
    };
    let start = Instant::now();
    rendered.denoise(denoiser).context("the picture is not denoised")?;
    let seconds = start.elapsed().as_secs_f64();
    say!(
        "denoised by {} in {seconds:.1} s; the estimated error is that of the noisy picture",
        denoiser.name()
    );
    Ok(())
}
