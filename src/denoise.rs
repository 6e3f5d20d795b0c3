//! Removes noise from pictures, by Open Image Denoise 2, which is loaded when it is asked for.

mod blend;
mod oidn;

use std::path::Path;

use crate::error::Result;
use crate::film::Image;
pub(crate) use blend::blend;

/// Open Image Denoise, ready to use.
pub struct Denoiser(oidn::Device);

/// What surfaces are like in each pixel: edges in them are edges in the picture. They may be noisy.
#[derive(Debug, Clone, Copy)]
pub struct Guides<'a> {
    /// Colours of surfaces, 0 to 1.
    pub albedo: &'a Image,
    /// Shading normals, −1 to 1.
    pub normal: &'a Image,
}

impl Denoiser {
    /// Loads the library from this file, or from where the system looks for libraries.
    ///
    /// # Errors
    /// A library that is not there, is another one, or does not run on this CPU.
    pub fn open(library: Option<&Path>) -> Result<Self> {
        Ok(Self(oidn::Device::open(library)?))
    }

    /// Name and version.
    pub fn name(&self) -> String {
        let [major, minor, patch] = self.0.version();
        format!("Open Image Denoise {major}.{minor}.{patch}")
    }

    /// The picture without its noise. The same picture gives the same bits, with any number of threads. Values that are no finite
    /// numbers are replaced by the mean of the pixels around them, negative ones by 0.
    ///
    /// # Errors
    /// The library's, such as too little memory.
    ///
    /// # Panics
    /// If the guides have another size than the picture.
    pub fn denoise(&self, picture: &Image, guides: Option<Guides<'_>>) -> Result<Image> {
        let size = [picture.width(), picture.height()];
        let finite = finite(picture);
        let Some(scale) = scale_of(&finite) else {
            return Ok(Image::new(size[0], size[1], vec![[0.0; 3]; picture.pixels().len()]));
        };
        let color = scaled(&with_margin(&finite), scale);
        let denoised = match guides {
            None => self
                .0
                .filter(&[("color", &color)], oidn::Kind::Radiance { clean_guides: false })?,
            Some(Guides { albedo, normal }) => {
                let prefiltered = |name, guide: &Image| {
                    assert_eq!([guide.width(), guide.height()], size, "{name}");
                    let guide = with_margin(&self::finite(guide));
                    self.0.filter(&[(name, &guide)], oidn::Kind::Guide)
                };
                let (albedo, normal) = (prefiltered("albedo", albedo)?, prefiltered("normal", normal)?);
                let inputs = [("color", &color), ("albedo", &albedo), ("normal", &normal)];
                self.0.filter(&inputs, oidn::Kind::Radiance { clean_guides: true })?
            }
        };
        Ok(scaled(&without_margin(&denoised, size), 1.0 / scale))
    }
}

fn scaled(image: &Image, scale: f32) -> Image {
    let pixels = image.pixels().iter().map(|pixel| pixel.map(|value| value * scale));
    Image::new(image.width(), image.height(), pixels.collect())
}

/// The power of two that brings the mean near 1: the library does not see light below about 10⁻⁸. Scaling by it is exact.
/// `None` if there is no light.
fn scale_of(image: &Image) -> Option<f32> {
    // Beyond, the scale or its inverse would not be a normal number.
    const MOST: f64 = 120.0;
    let values = image.pixels().iter().flatten();
    let sum: f64 = values.map(|&value| f64::from(value.max(0.0))).sum();
    let mean = sum / (3 * image.pixels().len()) as f64;
    (mean > 0.0).then(|| (-mean.log2().round().clamp(-MOST, MOST)).exp2() as f32)
}

/// The library takes what is outside of a picture for black, which shows in corners (17 % off in a plain grey picture) and in small
/// pictures. So it gets a margin of this many pixels.
const MARGIN: usize = 16;

/// The picture with a margin, in which it is mirrored.
fn with_margin(image: &Image) -> Image {
    let [width, height] = [image.width(), image.height()];
    let mirrored = |at: usize, size: usize| {
        // Counted from a multiple of the period, for it may be less than the margin.
        let at = (at + 2 * size * MARGIN - MARGIN) % (2 * size);
        at.min(2 * size - 1 - at)
    };
    let [wide, high] = [width, height].map(|size| size + 2 * MARGIN);
    let pixels = (0..high).flat_map(|y| {
        let row = mirrored(y, height) * width;
        (0..wide).map(move |x| image.pixels()[row + mirrored(x, width)])
    });
    Image::new(wide, high, pixels.collect())
}

fn without_margin(image: &Image, [width, height]: [usize; 2]) -> Image {
    let rows = image.pixels().chunks(image.width()).skip(MARGIN).take(height);
    let pixels = rows.flat_map(|row| &row[MARGIN..MARGIN + width]);
    Image::new(width, height, pixels.copied().collect())
}

/// The picture with finite numbers only: one NaN would spread to all pixels of a neighbourhood.
fn finite(image: &Image) -> Image {
    let [width, height] = [image.width(), image.height()];
    let pixels = image.pixels();
    let around = |index: usize, channel: usize| {
        let [x, y] = [index % width, index / width];
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let indices = rows.flat_map(|row| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| row * width + x));
        let values = indices
            .map(|index| pixels[index][channel])
            .filter(|value| value.is_finite());
        let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + f64::from(value), count + 1));
        (sum / f64::from(count.max(1))) as f32
    };
    let finite = pixels.iter().enumerate().map(|(index, pixel)| {
        std::array::from_fn(|channel| {
            let value = pixel[channel];
            if value.is_finite() {
                value
            } else {
                around(index, channel)
            }
        })
    });
    Image::new(width, height, finite.collect())
}

#[cfg(test)]
mod tests;
