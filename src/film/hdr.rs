//! Reads pictures in the Radiance format (.hdr).

use super::Image;
use crate::error::{Error, Result};
use crate::files;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// As for OpenEXR: pictures with more pixels are treated as damaged files.
const MAX_PIXELS: u64 = 1 << 27;
/// Maximum size of a header, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// Reads a Radiance file (.hdr).
///
/// # Errors
/// A file that can't be opened, is damaged or cut short, or has more than 2²⁷ pixels.
pub fn read_hdr(path: &Path) -> Result<Image> {
    let mut reader = BufReader::new(files::open(path)?);
    let [width, height] = size(&mut reader).map_err(|error| unreadable(path, &error))?;
    if !(1..=MAX_PIXELS).contains(&(u64::from(width) * u64::from(height))) {
        return Err(Error::file(
            path,
            "has no pixels or more than 134 million: damaged, or scale it down first",
        ));
    }
    let [width, height] = [width as usize, height as usize];
    let mut pixels = vec![[0.0f32; 3]; width * height];
    let mut row = vec![[0; 4]; width];
    for target in pixels.chunks_exact_mut(width) {
        read_row(&mut reader, &mut row).map_err(|error| unreadable(path, &error))?;
        for (pixel, &rgbe) in target.iter_mut().zip(&row) {
            *pixel = radiance(rgbe);
        }
    }
    Ok(Image::new(width, height, pixels))
}

/// Number of pixels of a Radiance file, by its header.
///
/// # Errors
/// A file that can't be opened or is not a Radiance file.
pub fn hdr_pixels(path: &Path) -> Result<u64> {
    let mut reader = BufReader::new(files::open(path)?);
    let [width, height] = size(&mut reader).map_err(|error| unreadable(path, &error))?;
    Ok(u64::from(width) * u64::from(height))
}

fn unreadable(path: &Path, error: &io::Error) -> Error {
    Error::file(
        path,
        format!("can't be read as Radiance HDR ({error}): is it another format, or cut short?"),
    )
}

fn damaged(what: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.into())
}

/// Reads the header; returns width and height.
fn size(reader: &mut impl BufRead) -> io::Result<[u32; 2]> {
    let mut header = reader.take(MAX_HEADER);
    let mut next_line = || -> io::Result<String> {
        let mut line = Vec::new();
        header.read_until(b'\n', &mut line)?;
        match line.pop() {
            Some(b'\n') => Ok(String::from_utf8_lossy(&line).into_owned()),
            _ => Err(damaged("its header doesn't end")),
        }
    };
    if !next_line()?.starts_with("#?RADIANCE") {
        return Err(damaged("it doesn't begin with #?RADIANCE"));
    }
    loop {
        let line = next_line()?;
        match line.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
            _ if line.is_empty() => break,
            Some(("FORMAT", format)) if format != "32-bit_rle_rgbe" => {
                return Err(damaged("its colours aren't 32-bit_rle_rgbe"));
            }
            _ => (),
        }
    }
    let line = next_line()?;
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["-Y", height, "+X", width] => {
            let side = |text: &str| text.parse().map_err(|_| damaged("its size is no number"));
            Ok([side(width)?, side(height)?])
        }
        _ => Err(damaged("its rows don't go from the top left")),
    }
}

/// Reads a row: four bytes per pixel, or run lengths of each channel, or of whole pixels in old files.
fn read_row(reader: &mut impl Read, row: &mut [[u8; 4]]) -> io::Result<()> {
    let first = read_bytes(reader)?;
    let [2, 2, high, _] = first else {
        return read_pixels(reader, first, row);
    };
    if high >= 128 {
        return read_pixels(reader, first, row);
    }
    for channel in 0..4 {
        let mut at = 0;
        while at < row.len() {
            let [count] = read_bytes(reader)?;
            let (count, is_run) = match count {
                129.. => (usize::from(count - 128), true),
                _ => (usize::from(count), false),
            };
            let end = at + count;
            let run = row.get_mut(at..end).ok_or_else(|| damaged("a row is too long"))?;
            if count == 0 {
                return Err(damaged("a run of nothing"));
            }
            let [mut value] = [0];
            for (index, pixel) in run.iter_mut().enumerate() {
                if index == 0 || !is_run {
                    [value] = read_bytes(reader)?;
                }
                pixel[channel] = value;
            }
            at = end;
        }
    }
    Ok(())
}

/// Pixels from the second one on. 1, 1, 1 and a number repeat the previous pixel that often; consecutive ones are digits of a
/// larger number.
fn read_pixels(reader: &mut impl Read, first: [u8; 4], row: &mut [[u8; 4]]) -> io::Result<()> {
    if first[..3] == [1, 1, 1] {
        return Err(damaged("a row begins with a repetition"));
    }
    row[0] = first;
    let (mut at, mut before, mut digit) = (1, first, 1usize);
    while at < row.len() {
        let pixel: [u8; 4] = read_bytes(reader)?;
        let count = if let [1, 1, 1, count] = pixel {
            let count = usize::from(count).saturating_mul(digit);
            digit = digit.saturating_mul(256);
            count
        } else {
            (before, digit) = (pixel, 1);
            1
        };
        let run = row.get_mut(at..at.saturating_add(count));
        run.ok_or_else(|| damaged("a row is too long"))?.fill(before);
        at += count;
    }
    Ok(())
}

fn read_bytes<const N: usize>(reader: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    reader.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// Mantissas of 8 bits with a common exponent.
fn radiance([r, g, b, exponent]: [u8; 4]) -> [f32; 3] {
    // 2 to the power of (exponent − 128 − 8).
    let scale = match exponent {
        0 => 0.0,
        _ => (f64::from(exponent) - 136.0).exp2() as f32,
    };
    [r, g, b].map(|mantissa| scale * f32::from(mantissa))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::hdr::HdrEncoder;
    use tempfile::tempdir;

    fn read(bytes: &[u8]) -> Result<Image> {
        let folder = tempdir().expect("a temporary folder");
        let path = folder.path().join("sky.hdr");
        std::fs::write(&path, bytes).expect("a file");
        read_hdr(&path)
    }

    #[test]
    fn a_radiance_picture_is_read_from_the_top_left() {
        let pixels = [[1.0, 0.5, 0.25], [8.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1e4]];
        let mut bytes = Vec::new();
        HdrEncoder::new(&mut bytes)
            .encode(&pixels.map(image::Rgb), 2, 2)
            .expect("an encoded picture");
        let image = read(&bytes).expect("a picture");
        assert_eq!((image.width(), image.height()), (2, 2));
        for (found, wanted) in image.pixels().iter().flatten().zip(pixels.iter().flatten()) {
            // The format has 8 bits of mantissa.
            assert!((found - wanted).abs() <= wanted / 128.0, "{found} instead of {wanted}");
        }
        for length in [0, 4, bytes.len() - 3] {
            let error = read(&bytes[..length]).expect_err("a cut file").to_string();
            assert!(error.contains("Radiance HDR") && !error.contains('\n'), "{error}");
        }
        assert!(read_hdr(Path::new("none")).is_err());
    }

    #[test]
    fn run_lengths_are_read_as_another_decoder_reads_them() {
        let wide: Vec<[f32; 3]> = (0..300u16)
            .map(|x| [f32::from(x / 40), 0.25 * f32::from(x % 7), 3.0].map(|value| value * f32::from(1 + x / 150)))
            .collect();
        let mut bytes = Vec::new();
        let rgb: Vec<image::Rgb<f32>> = wide.iter().copied().map(image::Rgb).collect();
        HdrEncoder::new(&mut bytes)
            .encode(&rgb, 150, 2)
            .expect("an encoded picture");
        let found = read(&bytes).expect("a picture");
        let expected = image::load_from_memory(&bytes).expect("a picture").into_rgb32f();
        assert_eq!(found.pixels().as_flattened(), expected.as_raw().as_slice());
    }

    #[test]
    fn repetitions_of_old_files_are_read() {
        let head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 6\n".to_vec();
        let (red, dark) = ([128, 0, 0, 129], [0, 0, 0, 0]);
        let row = [red, [1, 1, 1, 4], dark].concat();
        let image = read(&[head.clone(), row].concat()).expect("a picture");
        assert_eq!(image.pixels()[..5], [[1.0, 0.0, 0.0]; 5]);
        assert_eq!(image.pixels()[5], [0.0; 3]);
        for row in [[[1, 1, 1, 6], red].concat(), [red, [1, 1, 1, 9]].concat()] {
            assert!(read(&[head.clone(), row].concat()).is_err());
        }
    }

    #[test]
    fn every_exponent_is_what_the_format_says() {
        for exponent in 0..=255u8 {
            let [found, ..] = radiance([1, 0, 0, exponent]);
            let expected = if exponent == 0 {
                0.0
            } else {
                2f64.powi(i32::from(exponent) - 136)
            };
            assert_eq!(f64::from(found), expected, "{exponent}");
        }
    }
}
