//! Combines pictures of one size, PNG or OpenEXR, into a contact sheet: `cargo run --example contact_sheet -- SHEET.png PICTURE...`

use std::path::Path;

use anyhow::{Context, Result, ensure};
use image::{GenericImage, RgbImage};
use ppm_vk::Look;
use ppm_vk::internals::film;

/// Pixels between pictures.
const GAP: u32 = 4;

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let sheet = arguments.next().context("name the sheet to write, then its pictures")?;
    let mut pictures = Vec::new();
    for name in arguments {
        let name = Path::new(&name);
        pictures.push(open(name).with_context(|| name.display().to_string())?);
    }
    let first = pictures.first().context("name the pictures after the sheet")?;
    let (width, height) = first.dimensions();
    ensure!(
        pictures.iter().all(|picture| picture.dimensions() == (width, height)),
        "the pictures have different sizes"
    );
    let columns = (pictures.len() as f64).sqrt().ceil() as u32;
    let rows = (pictures.len() as u32).div_ceil(columns);
    let mut whole = RgbImage::from_pixel(
        columns * (width + GAP) - GAP,
        rows * (height + GAP) - GAP,
        image::Rgb([255; 3]),
    );
    for (index, picture) in (0..).zip(&pictures) {
        let (column, row) = (index % columns, index / columns);
        whole.copy_from(picture, column * (width + GAP), row * (height + GAP))?;
    }
    whole.save(&sheet)?;
    Ok(())
}

/// A picture as it is shown: OpenEXR with the program's tone mapping.
fn open(name: &Path) -> Result<RgbImage> {
    if name.extension().is_none_or(|extension| extension != "exr") {
        return Ok(image::open(name)?.into_rgb8());
    }
    let folder = tempfile::tempdir()?;
    let shown = folder.path().join("shown.png");
    film::write_png(&film::read_exr(name)?, &shown, Look::default())?;
    Ok(image::open(shown)?.into_rgb8())
}
