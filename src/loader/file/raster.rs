//! Decodes the raster formats of images: PNG, JPEG, WebP.

use std::fmt::Display;
use std::io::Cursor;

use image_webp::WebPDecoder;
use png::{ColorType, Transformations};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// A picture in a file.
pub(crate) struct Raster<'a> {
    format: Format,
    bytes: &'a [u8],
}

#[derive(Clone, Copy)]
enum Format {
    Png,
    Jpeg,
    WebP,
}

impl<'a> Raster<'a> {
    /// The format of a file, by its first bytes.
    pub(crate) fn open(bytes: &'a [u8]) -> Option<Self> {
        let format = match bytes {
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Format::Png,
            [0xff, 0xd8, 0xff, ..] => Format::Jpeg,
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Format::WebP,
            _ => return None,
        };
        Some(Self { format, bytes })
    }

    /// Width and height, by the first bytes.
    ///
    /// # Errors
    /// A text, if the header is damaged.
    pub(crate) fn size(&self) -> Result<[u32; 2], String> {
        match self.format {
            Format::Png => {
                let mut decoder = png::Decoder::new(Cursor::new(self.bytes));
                let info = decoder.read_header_info().map_err(text)?;
                Ok([info.width, info.height])
            }
            Format::Jpeg => {
                let mut decoder = self.jpeg(DecoderOptions::default());
                decoder.decode_headers().map_err(text)?;
                let (width, height) = decoder.dimensions().ok_or("no size")?;
                let side = |side: usize| u32::try_from(side).map_err(text);
                Ok([side(width)?, side(height)?])
            }
            Format::WebP => {
                let decoder = WebPDecoder::new(Cursor::new(self.bytes)).map_err(text)?;
                Ok(decoder.dimensions().into())
            }
        }
    }

    /// The pixels in rows from the top left. Deeper channels are rounded to 8 bits. The second argument limits the memory of
    /// decoding, in bytes.
    ///
    /// # Errors
    /// A text, if the file is damaged.
    pub(crate) fn rgba(&self, memory: usize) -> Result<Vec<[u8; 4]>, String> {
        match self.format {
            Format::Png => self.png_rgba(memory),
            Format::Jpeg => self.jpeg_rgba(),
            Format::WebP => {
                let mut decoder = WebPDecoder::new(Cursor::new(self.bytes)).map_err(text)?;
                decoder.set_memory_limit(memory);
                let mut samples = vec![0; decoder.output_buffer_size().ok_or("too large")?];
                decoder.read_image(&mut samples).map_err(text)?;
                Ok(expand(&samples, if decoder.has_alpha() { 4 } else { 3 }))
            }
        }
    }

    fn png_rgba(&self, memory: usize) -> Result<Vec<[u8; 4]>, String> {
        let limits = png::Limits { bytes: memory };
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(self.bytes), limits);
        decoder.set_transformations(Transformations::EXPAND);
        decoder.set_ignore_text_chunk(true);
        let mut reader = decoder.read_info().map_err(text)?;
        let size = reader.output_buffer_size().filter(|&size| size <= memory);
        let mut samples = vec![0; size.ok_or("too large")?];
        reader.next_frame(&mut samples).map_err(text)?;
        let (color, depth) = reader.output_color_type();
        if depth == png::BitDepth::Sixteen {
            samples = samples
                .as_chunks::<2>()
                .0
                .iter()
                .map(|&sample| rounded(sample))
                .collect();
        }
        let channels = match color {
            ColorType::Grayscale => 1,
            ColorType::GrayscaleAlpha => 2,
            ColorType::Rgb => 3,
            ColorType::Rgba => 4,
            ColorType::Indexed => return Err("an invalid palette".to_owned()),
        };
        Ok(expand(&samples, channels))
    }

    fn jpeg(&self, options: DecoderOptions) -> JpegDecoder<ZCursor<&'a [u8]>> {
        let options = options
            .set_strict_mode(false)
            .set_max_width(usize::MAX)
            .set_max_height(usize::MAX);
        JpegDecoder::new_with_options(ZCursor::new(self.bytes), options)
    }

    fn jpeg_rgba(&self) -> Result<Vec<[u8; 4]>, String> {
        let mut decoder = self.jpeg(DecoderOptions::default());
        decoder.decode_headers().map_err(text)?;
        let (space, channels) = match decoder.input_colorspace() {
            Some(ColorSpace::Luma) => (ColorSpace::Luma, 1),
            Some(ColorSpace::LumaA) => (ColorSpace::LumaA, 2),
            Some(ColorSpace::RGBA) => (ColorSpace::RGBA, 4),
            _ => (ColorSpace::RGB, 3),
        };
        let mut decoder = self.jpeg(DecoderOptions::default().jpeg_set_out_colorspace(space));
        Ok(expand(&decoder.decode().map_err(text)?, channels))
    }
}

fn text(error: impl Display) -> String {
    error.to_string()
}

/// Big-endian 16-bit samples as 8 bits.
fn rounded(sample: [u8; 2]) -> u8 {
    ((u32::from(u16::from_be_bytes(sample)) + 128) / 257) as u8
}

/// Samples of 1 to 4 channels as RGBA: grey, grey and alpha, RGB, RGBA.
fn expand(samples: &[u8], channels: usize) -> Vec<[u8; 4]> {
    let pixels = samples.chunks_exact(channels);
    let rgba = pixels.map(|pixel| match *pixel {
        [grey] => [grey, grey, grey, 255],
        [grey, alpha] => [grey, grey, grey, alpha],
        [r, g, b] => [r, g, b, 255],
        [r, g, b, alpha, ..] => [r, g, b, alpha],
        [] => [0; 4],
    });
    rgba.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat};

    /// A picture that differs from pixel to pixel.
    fn pattern() -> DynamicImage {
        let of =
            |x: u32, y: u32| image::Rgba([x * 9001, y * 13007, (x + y) * 7001, x * y * 3001].map(|value| value as u16));
        DynamicImage::ImageRgba16(image::ImageBuffer::from_fn(7, 5, of))
    }

    /// `image` decodes each kind of samples differently.
    #[test]
    fn every_kind_of_samples_is_decoded_as_another_decoder_does() {
        let wide = pattern();
        let kinds = [
            ("grey of 16 bits", DynamicImage::ImageLuma16(wide.to_luma16())),
            ("grey and alpha", DynamicImage::ImageLumaA8(wide.to_luma_alpha8())),
            ("grey", DynamicImage::ImageLuma8(wide.to_luma8())),
            ("RGB", DynamicImage::ImageRgb8(wide.to_rgb8())),
            ("RGBA", DynamicImage::ImageRgba8(wide.to_rgba8())),
            ("RGBA of 16 bits", wide),
        ];
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP] {
            let mut decoded = 0;
            for (kind, picture) in &kinds {
                let mut bytes = Cursor::new(Vec::new());
                // Not every format has every kind.
                if picture.write_to(&mut bytes, format).is_err() {
                    continue;
                }
                let bytes = bytes.into_inner();
                let raster = Raster::open(&bytes).unwrap_or_else(|| panic!("{kind} as {format:?} isn't known"));
                assert_eq!(raster.size(), Ok([7, 5]), "{kind} as {format:?}");
                let found = raster
                    .rgba(1 << 20)
                    .unwrap_or_else(|error| panic!("{kind} as {format:?}: {error}"));
                let expected = image::load_from_memory(&bytes).expect("a picture").into_rgba8();
                assert_eq!(
                    found.as_flattened(),
                    expected.as_raw().as_slice(),
                    "{kind} as {format:?}"
                );
                decoded += 1;
            }
            assert!(decoded >= 2, "{format:?} holds {decoded} kinds of samples");
        }
    }

    #[test]
    fn a_cut_picture_is_an_error() {
        for format in [ImageFormat::Png, ImageFormat::WebP] {
            let mut bytes = Cursor::new(Vec::new());
            let picture = DynamicImage::ImageRgba8(pattern().to_rgba8());
            picture.write_to(&mut bytes, format).expect("a picture");
            let bytes = bytes.into_inner();
            let raster = Raster::open(&bytes[..bytes.len() / 2]).expect("its head is there");
            assert!(raster.rgba(1 << 20).is_err(), "half of a {format:?}");
        }
        assert!(Raster::open(b"no picture").is_none());
    }
}
