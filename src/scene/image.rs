//! Reads the images of a glTF file.

use std::io::Cursor;
use std::path::Path;

use gltf::json;
use image::{ImageFormat, ImageReader, Limits};

use super::buffer::read_uri;
use super::diagnostic::{Check, damaged};
use super::document::Document;

/// Longest side of an image, in texels: sides are stored as 16 bits.
const LONGEST_SIDE: u32 = 32_768;
/// What decoding may take, in bytes.
const MOST_MEMORY: u64 = 4 << 30;

/// Pixels of an image, RGBA, as the file has them, in rows from the top left. What has more than 8 bits is rounded to them.
pub(super) struct Pixels {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<[u8; 4]>,
}

impl Pixels {
    /// Reads an image of `document`, whose file is in `folder`.
    pub(super) fn read(document: &Document, image: &json::Image, folder: &Path) -> Check<Self> {
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => Self::decode(&read_uri(uri, folder)?),
            (None, Some(view)) => {
                let views = &document.root.buffer_views;
                let json = views.get(view.value()).ok_or_else(|| {
                    damaged(format_args!(
                        "there is no bufferView {view}, the file has {}",
                        views.len()
                    ))
                })?;
                Self::decode(document.view_bytes(view.value(), json)?)
            }
            (None, None) => Err(damaged("it has neither a uri nor a bufferView")),
        }
    }

    fn decode(bytes: &[u8]) -> Check<Self> {
        let unreadable = |error| format!("it can't be decoded ({error}); export it as PNG or JPEG");
        let format = match image::guess_format(bytes) {
            Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
            Ok(other) => return Err(format!("it is {other:?}, but only PNG and JPEG are read; convert it")),
            Err(_) => return Err("it is neither PNG nor JPEG; convert it".into()),
        };
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut limits = Limits::default();
        limits.max_image_width = Some(LONGEST_SIDE);
        limits.max_image_height = Some(LONGEST_SIDE);
        limits.max_alloc = Some(MOST_MEMORY);
        reader.limits(limits);
        let decoded = reader.decode().map_err(unreadable)?.into_rgba8();
        let (width, height) = decoded.dimensions();
        Ok(Self {
            width,
            height,
            rgba: decoded.into_raw().as_chunks::<4>().0.to_vec(),
        })
    }
}
