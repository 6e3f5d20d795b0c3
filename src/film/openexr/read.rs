//! Reads pictures from OpenEXR files.

use super::super::Image;
use crate::error::{Error, Result};
use crate::files;
use exr::image::read::image::ReadLayers;
use exr::image::read::layers::ReadChannels;
use exr::image::read::specific_channels::ReadSpecificChannel;
use exr::math::Vec2;
use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// Pictures with more pixels than this (16,384 × 8,192) are treated as damaged files.
const MAX_PIXELS: usize = 1 << 27;

/// Reads the first layer with channels R, G and B of an OpenEXR file, or else with luminance Y alone, which is grey; half, float
/// and integer samples become `f32`, other channels are ignored.
///
/// The picture is the file's display window: pixels that the data window lacks are black, pixels outside are cropped.
///
/// # Errors
/// A file that can't be opened, is damaged or cut short, has no such layer, has subsampled channels, or has more than
/// 2²⁷ pixels.
pub fn read_exr(path: &Path) -> Result<Image> {
    let file = files::open(path)?;
    decode(BufReader::new(file), path)
}

/// Number of pixels of the largest picture in an OpenEXR file, by its headers.
///
/// # Errors
/// A file that can't be opened or isn't OpenEXR.
pub fn exr_pixels(path: &Path) -> Result<u64> {
    let reader =
        exr::block::read(BufReader::new(files::open(path)?), false).map_err(|error| unreadable(path, &error))?;
    let sizes = |header: &Header| [header.layer_size, header.shared_attributes.display_window.size];
    let pixels = |Vec2(width, height): Vec2<usize>| (width as u64).saturating_mul(height as u64);
    Ok(reader.headers().iter().flat_map(sizes).map(pixels).max().unwrap_or(0))
}

fn unreadable(path: &Path, error: &exr::error::Error) -> Error {
    Error::file(
        path,
        format!("can't be read as OpenEXR ({error}): is it another format, or cut short?"),
    )
}

/// Reads the OpenEXR file `source`; errors name it `path`.
pub(super) fn decode(source: impl Read + Seek, path: &Path) -> Result<Image> {
    let damaged = |error: exr::error::Error| unreadable(path, &error);
    let reader = exr::block::read(source, false).map_err(damaged)?;
    check_headers(reader.headers()).map_err(|what| Error::file(path, what))?;

    let is_grey = is_grey(reader.headers());
    let names = if is_grey { &["Y"][..] } else { &["R", "G", "B"] };
    let Some(layer) = reader.headers().iter().find(|header| has(header, names)) else {
        return Err(Error::file(
            path,
            "has neither channels R, G and B nor luminance Y alone: convert it to RGB first",
        ));
    };
    let frame = Frame {
        position: layer.own_attributes.layer_position,
        display: layer.shared_attributes.display_window,
    };
    let levels = exr::image::read::read().no_deep_data().largest_resolution_level();
    let channels = levels.specific_channels();
    // A decoder that panics on a damaged file would abort the process from one of rayon's threads.
    let image = if is_grey {
        channels
            .required("Y")
            .collect_pixels(
                move |_, _| frame.black(),
                move |image, place, (luminance,): (f32,)| frame.put(image, place, [luminance; 3]),
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_chunks(reader)
            .map(|picture| picture.layer_data.channel_data.pixels)
    } else {
        channels
            .required("R")
            .required("G")
            .required("B")
            .collect_pixels(
                move |_, _| frame.black(),
                move |image, place, (r, g, b): (f32, f32, f32)| frame.put(image, place, [r, g, b]),
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_chunks(reader)
            .map(|picture| picture.layer_data.channel_data.pixels)
    };
    image.map_err(damaged)
}

/// Whether a layer has all these channels.
fn has(header: &Header, names: &[&str]) -> bool {
    let channels = &header.channels.list;
    names
        .iter()
        .all(|&name| channels.iter().any(|channel| channel.name == *name))
}

/// Whether the file has only luminance: no layer has colours, and one has luminance without chroma.
fn is_grey(headers: &[Header]) -> bool {
    let is_grey = |header: &Header| has(header, &["Y"]) && !has(header, &["RY"]) && !has(header, &["BY"]);
    !headers.iter().any(|header| has(header, &["R", "G", "B"])) && headers.iter().any(is_grey)
}

/// Maximum size of a block of lines or a tile, in bytes: the decoder holds several of them at once.
const MAX_BLOCK: usize = 1 << 26;

/// Rejects files for which the `exr` crate would exhaust memory, or that it does not support, before any pixel is read.
fn check_headers(headers: &[Header]) -> std::result::Result<(), &'static str> {
    let is_sound = |Vec2(width, height): Vec2<usize>| matches!(width.checked_mul(height), Some(1..=MAX_PIXELS));
    let subsampled = |header: &Header| {
        let channels = &header.channels.list;
        channels.iter().any(|c| c.sampling != Vec2(1, 1))
    };
    for header in headers {
        if !is_sound(header.layer_size) || !is_sound(header.shared_attributes.display_window.size) {
            return Err("has no pixels or more than 134 million: damaged, or scale it down first");
        }
        let Vec2(width, height) = header.max_block_pixel_size();
        let block = width
            .saturating_mul(height)
            .saturating_mul(header.channels.bytes_per_pixel);
        if block > MAX_BLOCK {
            return Err("has blocks of more than 64 MiB: damaged, or write it in smaller tiles first");
        }
        if subsampled(header) {
            return Err("has channels of lower resolution: convert it to full resolution RGB first");
        }
    }
    Ok(())
}

/// The window of a layer's pixels, and the part that is shown.
#[derive(Clone, Copy)]
struct Frame {
    position: Vec2<i32>,
    display: IntegerBounds,
}

impl Frame {
    /// The shown part, initially without pixels.
    fn black(self) -> Image {
        let Vec2(width, height) = self.display.size;
        Image::new(width, height, vec![[0.0; 3]; width * height])
    }

    /// Sets a pixel of the layer, if it is shown.
    fn put(self, image: &mut Image, Vec2(x, y): Vec2<usize>, pixel: [f32; 3]) {
        let shown = |at: usize, position: i32, display: i32, size: usize| {
            usize::try_from(at as i64 + i64::from(position) - i64::from(display))
                .ok()
                .filter(|&at| at < size)
        };
        let column = shown(x, self.position.x(), self.display.position.x(), image.width);
        let row = shown(y, self.position.y(), self.display.position.y(), image.height);
        if let (Some(column), Some(row)) = (column, row) {
            image.pixels[row * image.width + column] = pixel;
        }
    }
}
