//! Reads the images of a glTF file.

use std::path::Path;

use gltf_json as json;

use super::budget::Budget;
use super::buffer::read_uri;
use super::document::Document;
use super::ktx2;
use super::ktx2::Ktx2;
use super::raster::Raster;
use crate::loader::diagnostic::{Check, damaged};

/// Longest side of an image, in texels: sides are stored as 16 bits.
const LONGEST_SIDE: u32 = 32_768;
/// Maximum size of a file's other data: profiles, comments, previews.
const BESIDE_PIXELS: u64 = 64 << 20;
/// Temporary memory limit of decoding, in bytes per texel: 16-bit channels, and rows of filters.
const MEMORY_A_TEXEL: u64 = 16;
/// Temporary memory of decoding: the pixels in the file's format, and a copy.
const DECODING_A_TEXEL: u64 = 8;

/// Maximum size of a file with this header and one picture, in bytes.
fn most_bytes(head: &[u8]) -> u64 {
    let size = Raster::open(head).and_then(|raster| raster.size().ok());
    let pixels = size.map_or(u64::MAX, |[width, height]| u64::from(width) * u64::from(height));
    pixels.saturating_mul(MEMORY_A_TEXEL).saturating_add(BESIDE_PIXELS)
}

/// Pixels of an image, RGBA, as the file has them, in rows from the top left. Deeper channels are rounded to 8 bits.
pub(crate) struct Pixels {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<[u8; 4]>,
}

impl Pixels {
    /// Reads an image of `document`, whose file is in `folder`.
    pub(crate) fn read(document: &Document, image: &json::Image, folder: &Path) -> Check<Self> {
        let budget = &document.budget;
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => Self::decode(&read_uri(uri, folder, most_bytes, budget)?, budget),
            (None, Some(view)) => {
                let views = &document.root.buffer_views;
                let json = views.get(view.value()).ok_or_else(|| {
                    damaged(format_args!(
                        "there is no bufferView {view}, the file has {}",
                        views.len()
                    ))
                })?;
                Self::decode(document.view_bytes(view.value(), json)?, budget)
            }
            (None, None) => Err(damaged("it has neither a uri nor a bufferView")),
        }
    }

    fn decode(bytes: &[u8], budget: &Budget) -> Check<Self> {
        if ktx2::is_ktx2(bytes) {
            let picture = Ktx2::open(bytes)?;
            take(picture.size, budget)?;
            let [width, height] = picture.size;
            return Ok(Self {
                width,
                height,
                rgba: texels(&picture.decode()?),
            });
        }
        let unreadable =
            |error: String| format!("it can't be decoded ({error}); export it as PNG, JPEG, WebP or KTX 2.0");
        let raster = Raster::open(bytes).ok_or("it is not PNG, JPEG, WebP or KTX 2.0; convert it")?;
        let [width, height] = raster.size().map_err(unreadable)?;
        let texels = take([width, height], budget)?;
        let memory = (MEMORY_A_TEXEL * texels).saturating_add(1 << 20);
        let rgba = raster
            .rgba(usize::try_from(memory).unwrap_or(usize::MAX))
            .map_err(unreadable)?;
        if rgba.len() as u64 != texels {
            return Err(unreadable("it has fewer pixels than its header says".to_owned()));
        }
        Ok(Self { width, height, rgba })
    }
}

/// Number of texels of an image; takes their memory from the budget. A few bytes can claim any number of texels, so this is
/// checked before allocation.
fn take([width, height]: [u32; 2], budget: &Budget) -> Check<u64> {
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 {
        return Err(damaged("it has no texels"));
    }
    if width.max(height) > LONGEST_SIDE {
        return Err(format!(
            "it has {width}x{height} texels, more than the {LONGEST_SIDE} along a side that are read; make it smaller"
        ));
    }
    let kept = size_of::<u32>() as u64 * texels;
    let what = format!("an image of {width}x{height} texels");
    budget.check(kept + DECODING_A_TEXEL * texels, &what)?;
    budget.take(kept, &what)?;
    Ok(texels)
}

fn texels(rgba: &[u8]) -> Vec<[u8; 4]> {
    rgba.as_chunks::<4>().0.to_vec()
}
