//! Pictures as PNG files, tone-mapped for viewing.

use super::{Image, Look, write_whole};
use crate::error::{Error, Result};
use std::path::Path;

/// Writes an 8-bit sRGB PNG: radiance times 2 to the power of the exposure's stops, the tone mapper, the sRGB transfer function,
/// rounding without dither.
///
/// NaN and negative values become 0, infinity the brightest value.
///
/// # Errors
/// As [`check_writable`](super::check_writable); further if the disk is full.
pub fn write_png(image: &Image, path: &Path, look: Look) -> Result<()> {
    let gain = look.exposure.stops(image).exp2();
    let bytes: Vec<u8> = image
        .pixels
        .iter()
        .flat_map(|pixel| look.tone.map(pixel.map(|radiance| radiance * gain)))
        .map(|intensity| (srgb_transfer(intensity) * 255.0).round() as u8)
        .collect();
    write_rgb8([image.width, image.height], &bytes, path)
}

/// Writes a PNG of these bytes: sRGB, three per pixel, in rows from the top left.
///
/// # Errors
/// As [`write_png`].
pub fn write_rgb8(size: [usize; 2], bytes: &[u8], path: &Path) -> Result<()> {
    let cannot_encode = |what: String| Error::file(path, format!("can't be encoded as PNG: {what}"));
    let side = |pixels: usize| u32::try_from(pixels).map_err(|error| cannot_encode(error.to_string()));
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side(size[0])?, side(size[1])?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_filter(png::Filter::Adaptive);
    encoder
        .write_header()
        .and_then(|mut writer| {
            writer.write_image_data(bytes)?;
            writer.finish()
        })
        .map_err(|error| cannot_encode(error.to_string()))?;
    write_whole(path, &file)
}

/// The transfer function of IEC 61966-2-1 (sRGB): linear intensity in 0 ..= 1 to the signal in 0 ..= 1.
fn srgb_transfer(intensity: f32) -> f32 {
    if intensity <= 0.003_130_8 {
        12.92 * intensity
    } else {
        1.055 * intensity.powf(1.0 / 2.4) - 0.055
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Exposure;
    use std::fs;

    /// The 8-bit pixels of a picture's PNG.
    fn shown(pixels: Vec<[f32; 3]>, exposure_ev: f32) -> Vec<[u8; 3]> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("out.png");
        let image = Image::new(pixels.len(), 1, pixels);
        let look = Look {
            exposure: Exposure::Stops(exposure_ev),
            ..Look::default()
        };
        write_png(&image, &path, look).expect("a PNG file");
        let bytes = fs::read(path).expect("a file");
        let decoded = image::load_from_memory(&bytes).expect("a PNG").into_rgb8();
        decoded.pixels().map(|pixel| pixel.0).collect()
    }

    #[test]
    fn the_png_follows_the_srgb_curve_below_the_shoulder() {
        // Intensities after the tone mapper's offset of 0.04, and their sRGB signals: 0.2 → 0.4845, 0.5 → 0.7354.
        assert_eq!(shown(vec![[0.24; 3], [0.54; 3]], 0.0), [[124; 3], [188; 3]]);
        assert_eq!(shown(vec![[0.12; 3]], 1.0), [[124; 3]], "one stop doubles");
        assert_eq!(shown(vec![[0.0; 3]], 5.0), [[0; 3]]);
    }

    #[test]
    fn the_png_keeps_hues_and_order_of_brightness() {
        let red = shown(vec![[0.63, 0.065, 0.05], [6.3, 0.65, 0.5]], 0.0);
        for [r, g, b] in &red {
            assert!(r > g && g >= b, "red became {red:?}");
        }
        let ramp: Vec<_> = (0..200).map(|i| [i as f32 * 0.05; 3]).collect();
        assert!(shown(ramp, 0.0).is_sorted(), "brighter came out darker");
    }

    #[test]
    fn the_png_takes_any_value() {
        let extremes = vec![
            [f32::NAN; 3],
            [f32::NEG_INFINITY, -1.0, -0.0],
            [f32::INFINITY; 3],
            [f32::MAX; 3],
            [f32::INFINITY, 0.0, f32::NAN],
        ];
        let pixels = shown(extremes.clone(), 0.0);
        assert_eq!(pixels[..4], [[0; 3], [0; 3], [255; 3], [255; 3]]);
        assert_eq!(pixels[4][0], 255);
        shown(extremes, f32::INFINITY);
    }
}
