//! Environment lighting: a picture of the sphere of directions, or one radiance.
//!
//! Pictures are equirectangular as in the Khronos glTF sample viewer: the upper edge is +Y, the centre +Z, and −X lies to
//! the right of it. Between the centres of pixels radiance is interpolated.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::film::{Image, exr_pixels, hdr_pixels, read_exr, read_hdr};
use crate::text::bytes;

/// Maximum number of pixels, to which larger pictures are reduced: one buffer of every device holds that many.
const MAX_PIXELS: usize = 1 << 22;

/// Radiance from each direction, not black everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    image: Image,
    /// Rotation about +Y, in turns, 0 ..= 1.
    rotation: f64,
    /// Size of the picture that it was reduced from.
    reduced_from: Option<[usize; 2]>,
    /// Number of values that were negative or not finite.
    replaced: usize,
}

impl Environment {
    /// The same radiance from all directions.
    pub fn constant(radiance: Vec3) -> Self {
        Self {
            image: Image::new(1, 1, vec![radiance.to_array()]),
            rotation: 0.0,
            reduced_from: None,
            replaced: 0,
        }
    }

    /// Reads an OpenEXR or Radiance picture, by the name's ending, within a limit of memory in bytes.
    ///
    /// # Errors
    /// A file that can't be read, whose name ends in neither `.exr` nor `.hdr`, that is too large, or black.
    pub fn read(path: &Path, memory_limit: u64) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let image = match extension.to_str() {
            Some("exr") => {
                check_size(path, exr_pixels(path)?, memory_limit)?;
                read_exr(path)?
            }
            Some("hdr") => {
                check_size(path, hdr_pixels(path)?, memory_limit)?;
                read_hdr(path)?
            }
            _ => {
                return Err(Error::file(
                    path,
                    "is no environment: the name of a picture ends in .exr or .hdr, and a radiance is three numbers, such as 1,1,1",
                ));
            }
        };
        Self::new(image).map_err(|what| Error::file(path, what))
    }

    /// From an equirectangular picture. Values that are negative or not finite are replaced by 0 and counted.
    ///
    /// # Errors
    /// A text, if nothing is above 0.
    pub fn new(image: Image) -> std::result::Result<Self, String> {
        let values = || image.pixels().iter().flatten();
        let is_bad = |value: f32| !(value.is_finite() && value >= 0.0);
        if !values().any(|&value| value > 0.0 && value.is_finite()) {
            return Err("is black and emits no light; choose another one".into());
        }
        let replaced = values().filter(|value| is_bad(**value)).count();
        let size = [image.width(), image.height()];
        let factor = (1..)
            .find(|factor| (size[0] / factor).max(1) * (size[1] / factor).max(1) <= MAX_PIXELS)
            .unwrap_or(1);
        Ok(Self {
            image: reduce(&image, size.map(|side| (side / factor).max(1))),
            rotation: 0.0,
            reduced_from: (factor > 1).then_some(size),
            replaced,
        })
    }

    /// Rotated about +Y by an angle in degrees, which takes +Z towards +X.
    #[must_use]
    pub fn rotated(self, degrees: f64) -> Self {
        Self {
            rotation: (degrees / 360.0).rem_euclid(1.0),
            ..self
        }
    }

    /// With its radiance multiplied by a factor.
    ///
    /// # Errors
    /// A text, if the result is out of the range of radiance.
    pub fn scaled(self, strength: f64) -> std::result::Result<Self, String> {
        let scale = |value: f32| (f64::from(value) * strength) as f32;
        let pixels: Vec<[f32; 3]> = self.image.pixels().iter().map(|pixel| pixel.map(scale)).collect();
        let image = Image::new(self.image.width(), self.image.height(), pixels);
        let values = || image.pixels().iter().flatten();
        if values().any(|value| !value.is_finite()) || values().all(|&value| value == 0.0) {
            return Err(format!(
                "{strength} times the environment is out of floating-point range; choose another strength"
            ));
        }
        Ok(Self { image, ..self })
    }

    /// Its size in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(self.image.pixels()) as u64
    }

    /// Changes that were made to the picture, one line each.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.replaced > 0 {
            warnings.push(format!(
                "{} values of the environment are negative, infinite or NaN, and are taken for 0: where they are infinite, as a sun \
                 that half floats don't hold, that light is missing; export it as 32-bit floats",
                self.replaced
            ));
        }
        if let Some([width, height]) = self.reduced_from {
            let [to_width, to_height] = self.size();
            warnings.push(format!(
                "the environment of {width}x{height} pixels is larger than devices support, and is reduced to \
                 {to_width}x{to_height}: its light stays, but it is seen less sharp"
            ));
        }
        warnings
    }

    /// The picture.
    pub(crate) fn image(&self) -> &Image {
        &self.image
    }

    /// Rotation about +Y, in turns, 0 ..= 1.
    pub(crate) fn rotation(&self) -> f64 {
        self.rotation
    }

    /// Width and height in pixels; 1 × 1 for one radiance.
    pub fn size(&self) -> [usize; 2] {
        [self.image.width(), self.image.height()]
    }

    /// Mean of the RGB radiance, integrated over all directions.
    pub(crate) fn total(&self) -> f64 {
        let weights = self.weights();
        let rows = weights.chunks(self.image.width()).enumerate();
        rows.map(|(row, weights)| weights.iter().sum::<f64>() * self.solid_angle(row))
            .sum()
    }

    /// Approximate share of all directions that the light comes from: 1 if it is uniform.
    pub(crate) fn spread(&self) -> f64 {
        let weights = self.weights();
        let rows = weights.chunks(self.image.width()).enumerate();
        let squares: f64 = rows
            .map(|(row, weights)| weights.iter().map(|weight| weight * weight).sum::<f64>() * self.solid_angle(row))
            .sum();
        self.total().powi(2) / (4.0 * PI * squares)
    }

    /// Solid angle of a pixel of a row.
    pub(crate) fn solid_angle(&self, row: usize) -> f64 {
        let [width, height] = self.size();
        let edge = |row: usize| (PI * row as f64 / height as f64).cos();
        2.0 * PI / width as f64 * (edge(row) - edge(row + 1))
    }

    /// Mean of the interpolated radiance (mean of RGB) over each pixel: a pixel and its neighbours in a row and a column weigh
    /// 1/8, 6/8 and 1/8.
    pub(crate) fn weights(&self) -> Vec<f64> {
        let [width, height] = self.size();
        let pixels = self.image.pixels();
        let mean = |x: usize, y: usize| DVec3::from(pixels[y * width + x].map(f64::from)).element_sum() / 3.0;
        let blend = |before: f64, at: f64, after: f64| 0.125 * before + 0.75 * at + 0.125 * after;
        let in_row = |x: usize, y: usize| blend(mean((x + width - 1) % width, y), mean(x, y), mean((x + 1) % width, y));
        let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        all.map(|(x, y)| {
            blend(
                in_row(x, y.saturating_sub(1)),
                in_row(x, y),
                in_row(x, (y + 1).min(height - 1)),
            )
        })
        .collect()
    }
}

/// Bytes per pixel while reading: in the file's format, and as stored.
const BYTES_A_PIXEL: u64 = 24;

fn check_size(path: &Path, pixels: u64, memory_limit: u64) -> Result<()> {
    let needed = pixels.saturating_mul(BYTES_A_PIXEL);
    if needed <= memory_limit {
        return Ok(());
    }
    Err(Error::Memory {
        path: path.to_owned(),
        what: format!(
            "has {pixels} pixels, which need {} of memory; the limit of a scene is {}",
            bytes(needed),
            bytes(memory_limit)
        ),
        needed,
    })
}

/// The picture with fewer pixels, each the mean of those that it replaces; invalid values are 0.
fn reduce(image: &Image, [width, height]: [usize; 2]) -> Image {
    let part = |i: usize, from: usize, to: usize| i * from / to..(i + 1) * from / to;
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let rows = part(y, image.height(), height);
            let columns = part(x, image.width(), width);
            let count = (rows.len() * columns.len()) as f64;
            let sum: DVec3 = rows
                .flat_map(|row| &image.pixels()[row * image.width()..][columns.clone()])
                .map(|pixel| {
                    DVec3::from(pixel.map(|value| f64::from(if value.is_finite() { value.max(0.0) } else { 0.0 })))
                })
                .sum();
            pixels.push((sum / count).as_vec3().to_array());
        }
    }
    Image::new(width, height, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_radiance_comes_from_the_whole_sphere() {
        let environment = Environment::constant(Vec3::new(1.0, 2.0, 6.0));
        assert!((environment.total() - 12.0 * PI).abs() < 1e-12);
        assert!((environment.spread() - 1.0).abs() < 1e-12);
        let [_, row, pixel] = environment.table()[..] else {
            panic!("a header, a row and a pixel");
        };
        assert_eq!(row, [1.0, -1.0, 0.0, 1.0]);
        assert_eq!(pixel, [1.0, 2.0, 6.0, 1.0]);
    }

    #[test]
    fn large_pictures_are_reduced_and_keep_their_light() {
        let (width, height) = (4097, 2050);
        let pixel = |i: usize| [(i % 7) as f32, -1.0, 1.0];
        let large = Image::new(width, height, (0..width * height).map(pixel).collect());
        let environment = Environment::new(large).expect("an environment");
        assert_eq!(environment.size(), [2048, 1025]);
        let warnings = environment.warnings();
        assert!(
            warnings[0].starts_with("8398850 values") && warnings[1].contains("4097x2050"),
            "{warnings:?}"
        );
        // The mean of 0 to 6, none for the negative values, and 1.
        let mean = environment.total() / (4.0 * PI);
        assert!((mean - 4.0 / 3.0).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn black_pictures_are_refused() {
        for value in [0.0, -1.0, f32::INFINITY, f32::NAN] {
            let error = Environment::new(Image::new(1, 1, vec![[value; 3]])).expect_err("no environment");
            assert!(error.contains("black"), "{error}");
        }
    }

    #[test]
    fn values_that_are_no_radiance_are_counted_and_taken_for_0() {
        let pixels = vec![[f32::NAN, 1.0, -2.0], [1.0, f32::INFINITY, f32::NEG_INFINITY]];
        let environment = Environment::new(Image::new(2, 1, pixels)).expect("an environment");
        assert_eq!(environment.image.pixels(), [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
        assert!(
            environment.warnings()[0].starts_with("4 values"),
            "{:?}",
            environment.warnings()
        );
        assert!(environment.table().iter().flatten().all(|value| value.is_finite()));
    }

    #[test]
    fn a_strength_multiplies_radiance_and_says_where_that_has_no_number() {
        let environment = Environment::constant(Vec3::new(1.0, 2.0, 6.0));
        let stronger = environment.clone().scaled(0.5).expect("an environment");
        assert_eq!(stronger, Environment::constant(Vec3::new(0.5, 1.0, 3.0)));
        for strength in [1e300, 1e-300] {
            let error = environment.clone().scaled(strength).expect_err("no radiance");
            assert!(error.contains("another strength"), "{error}");
        }
    }
}
