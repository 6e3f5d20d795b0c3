//! The picture and its files: OpenEXR with the radiance itself, PNG for looking at.
//!
//! An output file is whole or absent. [`check_writable`] tells before the rendering whether it can be written.

mod cryptomatte;
mod hdr;
mod openexr;
mod png;
mod tone;

pub use crate::files::{check_writable, write_whole};
pub use cryptomatte::Cryptomatte;
pub use hdr::{hdr_pixels, read_hdr};
pub use openexr::{Additions, Channel, ViewLayer, exr_pixels, read_exr, write_exr};
pub use png::{write_png, write_rgb8};
pub use tone::{Exposure, Look, Tone};

/// A picture of linear RGB radiance with Rec. 709 primaries.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Image {
    /// A picture of `width` × `height` pixels, given in rows from the top left.
    ///
    /// # Panics
    /// If there are not exactly `width * height` pixels, or none.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Self {
        assert!(
            width.checked_mul(height) == Some(pixels.len()) && !pixels.is_empty(),
            "{} pixels don't make a picture of {width}x{height}",
            pixels.len()
        );
        Self { width, height, pixels }
    }

    /// A picture of a renderer's film: four numbers a pixel, in rows from the top left; the fourth is left out.
    ///
    /// # Panics
    /// As [`Image::new`].
    pub fn from_film([width, height]: [u32; 2], film: &[[f32; 4]]) -> Self {
        let pixels = film.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
        Self::new(width as usize, height as usize, pixels)
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels in rows from the top left.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }
}

/// How a picture was made; written into the EXR file's header.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Metadata {
    /// Iterations done.
    pub iterations: u64,
    /// Photon paths emitted in all iterations.
    pub photons_emitted: u64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Name of the device that rendered.
    pub device: String,
    /// Rendering time in seconds.
    pub seconds: f64,
    /// Estimated relative error, where the run estimated it.
    pub estimated_error: Option<f64>,
    /// What removed the noise, with its version.
    pub denoised_by: Option<String>,
}
