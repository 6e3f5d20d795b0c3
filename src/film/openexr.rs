//! Pictures as OpenEXR files.

mod read;
#[cfg(test)]
mod tests;

pub use read::{exr_pixels, read_exr};

use super::{Image, Metadata, write_whole};
use crate::error::{Error, Result};
use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Layer};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, LineOrder, Text};
use exr::meta::header::LayerAttributes;
use exr::prelude::SmallVec;
use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

/// Primaries and white point of Rec. ITU-R BT.709 in CIE xy: the program's linear RGB.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// The custom attributes of the header. OpenEXR's integers end at 2³¹ − 1, so counts and the seed are text.
fn custom_attributes(metadata: &Metadata) -> HashMap<Text, AttributeValue> {
    let text = |value: &str| AttributeValue::Text(Text::from_slice_unchecked(value.as_bytes()));
    let mut attributes = HashMap::from([
        (Text::from("iterations"), text(&metadata.iterations.to_string())),
        (
            Text::from("photonsEmitted"),
            text(&metadata.photons_emitted.to_string()),
        ),
        (Text::from("seed"), text(&metadata.seed.to_string())),
        (Text::from("device"), text(&metadata.device)),
        (Text::from("seconds"), AttributeValue::F64(metadata.seconds)),
    ]);
    if let Some(error) = metadata.estimated_error {
        attributes.insert(Text::from("estimatedError"), AttributeValue::F64(error));
    }
    if let Some(denoiser) = &metadata.denoised_by {
        attributes.insert(Text::from("denoisedBy"), text(denoiser));
    }
    attributes
}

/// A channel of a picture's file.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// A value for each pixel, in rows from the top left.
    pub samples: Vec<f32>,
}

/// The name of a view layer, if channels are named as Blender names them: `NAME.Combined.R` instead of `R`.
#[derive(Debug, Clone, Copy, Default)]
pub struct ViewLayer<'a>(pub Option<&'a str>);

impl ViewLayer<'_> {
    /// The one of a channel's or layer's two names that is used: alone, or in the view layer.
    pub fn name(self, alone: &str, in_view_layer: &str) -> String {
        self.0
            .map_or(alone.to_owned(), |name| format!("{name}.{in_view_layer}"))
    }
}

/// What a picture's file has beside the colours.
#[derive(Debug, Clone, Default)]
pub struct Additions<'a> {
    /// Channel A: the share of each pixel that shows a surface, in rows from the top left. Colours are not multiplied by it; they
    /// include the background.
    pub alpha: Option<&'a [f32]>,
    /// Channels `error_R`, `error_G`, `error_B`: the error of each pixel, as the render estimated it. Names have no dot: it would
    /// make several layers, whose pixels Blender does not read.
    pub errors: Option<&'a Image>,
    /// Channels `noisy_R`, `noisy_G`, `noisy_B`: the picture before its noise was removed.
    pub noisy: Option<&'a Image>,
    /// Further channels.
    pub channels: Vec<Channel>,
    /// Further attributes, texts by their names.
    pub attributes: Vec<(String, String)>,
    /// How channels are named.
    pub view_layer: ViewLayer<'a>,
    /// The first pixel's place in a whole picture, and that one's size; `None` if the image is the whole.
    pub place: Option<([u32; 2], [u32; 2])>,
}

/// The samples of an image's three components.
fn planes(image: &Image) -> impl Iterator<Item = Vec<f32>> {
    (0..3).map(|component| image.pixels.iter().map(|pixel| pixel[component]).collect())
}

/// Writes a scanline OpenEXR file: 32-bit float R, G, B and what is added, ZIP compression over 16 lines (lossless), the
/// chromaticities of Rec. 709, the program's version as `software`, and `metadata` as the attributes `iterations`,
/// `photonsEmitted`, `seed` (decimal text), `device`, `seconds` and, if known, `estimatedError` (double) and `denoisedBy`.
///
/// The same picture and metadata give the same bytes. NaN and infinity are written as they are.
///
/// # Errors
/// As [`check_writable`](super::check_writable); further if the disk is full.
pub fn write_exr(image: &Image, additions: Additions<'_>, path: &Path, metadata: &Metadata) -> Result<()> {
    let mut custom = custom_attributes(metadata);
    for (name, text) in &additions.attributes {
        let text = AttributeValue::Text(Text::from_slice_unchecked(text.as_bytes()));
        custom.insert(Text::from_slice_unchecked(name.as_bytes()), text);
    }
    let attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("ppm-vk ", env!("CARGO_PKG_VERSION")))),
        other: custom,
        ..LayerAttributes::default()
    };
    let encoding = Encoding {
        compression: exr::compression::Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    let mut add = |name: &str, samples: Vec<f32>| {
        let name = Text::from_slice_unchecked(name.as_bytes());
        channels.push(AnyChannel::new(name, FlatSamples::F32(samples)));
    };
    let view_layer = additions.view_layer;
    let combined = |component: &str| view_layer.name(component, &format!("Combined.{component}"));
    for (component, samples) in ["R", "G", "B"].into_iter().zip(planes(image)) {
        add(&combined(component), samples);
    }
    let layers = [
        (additions.errors, "error", "Error"),
        (additions.noisy, "noisy", "Noisy Image"),
    ];
    for (layer, alone, in_view_layer) in layers {
        let planes = layer.into_iter().flat_map(planes);
        for (component, samples) in ["R", "G", "B"].into_iter().zip(planes) {
            let name = view_layer.name(&format!("{alone}_{component}"), &format!("{in_view_layer}.{component}"));
            add(&name, samples);
        }
    }
    if let Some(alpha) = additions.alpha {
        add(&combined("A"), alpha.to_vec());
    }
    for channel in additions.channels {
        add(&channel.name, channel.samples);
    }
    let size = (image.width, image.height);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let mut picture = exr::image::Image::from_layer(layer);
    picture.attributes.chromaticities = Some(REC_709);
    if let Some(([x, y], [width, height])) = additions.place {
        picture.layer_data.attributes.layer_position = Vec2(x as i32, y as i32);
        picture.attributes.display_window = IntegerBounds::from_dimensions((width as usize, height as usize));
    }

    let mut file = Vec::new();
    picture
        .write()
        .to_buffered(Cursor::new(&mut file))
        .map_err(|error| Error::file(path, format!("can't be encoded as OpenEXR: {error}")))?;
    sort_attributes(&mut file);
    write_whole(path, &file)
}

/// Puts the attributes of an EXR file's header into alphabetical order, as the OpenEXR library does: the `exr` crate
/// keeps custom ones in a hash map, whose order differs from run to run.
fn sort_attributes(file: &mut [u8]) {
    /// Bytes of the attribute at the start of `header`: name, 0, type, 0, size, value. `None` at the header's end.
    fn attribute_length(header: &[u8]) -> Option<usize> {
        let text_length = |start: usize| header.get(start..)?.iter().position(|&byte| byte == 0);
        let name = text_length(0).filter(|&length| length > 0)? + 1;
        let kind = name + text_length(name)? + 1;
        let (size, _) = header.get(kind..)?.split_first_chunk()?;
        Some(kind + 4 + u32::from_le_bytes(*size) as usize)
    }

    const MAGIC_AND_VERSION: usize = 8;
    let header = &mut file[MAGIC_AND_VERSION..];
    let mut attributes = Vec::new();
    let mut rest = &*header;
    while let Some((attribute, behind)) = attribute_length(rest).and_then(|length| rest.split_at_checked(length)) {
        attributes.push(attribute);
        rest = behind;
    }
    attributes.sort_unstable();
    let sorted = attributes.concat();
    header[..sorted.len()].copy_from_slice(&sorted);
}
