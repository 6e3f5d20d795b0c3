//! Reads pictures in the Radiance format (.hdr).

use super::Image;
use crate::error::{Error, Result};
use crate::files;
use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;
use std::io::BufReader;
use std::path::Path;

/// As for OpenEXR: pictures with more pixels are taken for damaged files.
const MAX_PIXELS: u64 = 1 << 27;

/// Reads a Radiance file (.hdr).
///
/// # Errors
/// A file that can't be opened, is damaged or cut short, or has more than 2²⁷ pixels.
pub fn read_hdr(path: &Path) -> Result<Image> {
    let file = files::open(path)?;
    let damaged = |error: image::ImageError| unreadable(path, &error);
    let decoder = HdrDecoder::new(BufReader::new(file)).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    if !(1..=MAX_PIXELS).contains(&(u64::from(width) * u64::from(height))) {
        return Err(Error::file(
            path,
            "has no pixels or more than 134 million: damaged, or scale it down first",
        ));
    }
    let mut pixels = vec![[0.0f32; 3]; width as usize * height as usize];
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut pixels))
        .map_err(damaged)?;
    Ok(Image::new(width as usize, height as usize, pixels))
}

/// Pixels of such a file, by its first bytes.
///
/// # Errors
/// A file that can't be opened or isn't such a one.
pub fn hdr_pixels(path: &Path) -> Result<u64> {
    let decoder = HdrDecoder::new(BufReader::new(files::open(path)?)).map_err(|error| unreadable(path, &error))?;
    let (width, height) = decoder.dimensions();
    Ok(u64::from(width) * u64::from(height))
}

fn unreadable(path: &Path, error: &image::ImageError) -> Error {
    Error::file(
        path,
        format!("can't be read as Radiance HDR ({error}): is it another format, or cut short?"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::hdr::HdrEncoder;
    use tempfile::tempdir;

    #[test]
    fn a_radiance_picture_is_read_from_the_top_left() {
        let folder = tempdir().expect("a temporary folder");
        let path = folder.path().join("sky.hdr");
        let pixels = [[1.0, 0.5, 0.25], [8.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1e4]];
        let mut bytes = Vec::new();
        HdrEncoder::new(&mut bytes)
            .encode(&pixels.map(image::Rgb), 2, 2)
            .expect("an encoded picture");
        std::fs::write(&path, &bytes).expect("a file");
        let image = read_hdr(&path).expect("a picture");
        assert_eq!((image.width(), image.height()), (2, 2));
        for (found, wanted) in image.pixels().iter().flatten().zip(pixels.iter().flatten()) {
            // The format has 8 bits of mantissa.
            assert!((found - wanted).abs() <= wanted / 128.0, "{found} instead of {wanted}");
        }
        for length in [0, 4, bytes.len() - 3] {
            std::fs::write(&path, &bytes[..length]).expect("a file");
            let error = read_hdr(&path).expect_err("a cut file").to_string();
            assert!(error.contains("Radiance HDR") && !error.contains('\n'), "{error}");
        }
        assert!(read_hdr(&folder.path().join("none")).is_err());
    }
}
