//! Error measures of a picture against a reference, and invalid values in pictures.

mod flip;

use crate::error::{Error, Result};
use crate::film::Image;

/// The weight of the squared mean in relMSE's denominator, which keeps dark pixels from dominating it.
pub const REL_MSE_FLOOR: f64 = 0.01;

/// Error measures of a picture x against a reference r; each is a mean over all pixels and channels.
///
/// NaN in the picture or the reference makes them NaN; [`Defects`] counts such pixels.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// Root of the mean squared error, in units of radiance.
    pub rmse: f64,
    /// Mean of (x − r)² / (r² + 0.01·m²), where m is one number: the reference's mean over all pixels and channels.
    /// Not defined (NaN or infinite) where the reference is black everywhere.
    pub rel_mse: f64,
    /// Mean absolute error, in units of radiance.
    pub mae: f64,
    /// The picture's mean over the reference's, for red, green and blue.
    pub mean_ratio: [f64; 3],
}

pub use flip::flip;

/// relMSE's denominator without the reference's square, the same for all values.
pub(crate) fn floor_of(reference: &Image) -> f64 {
    REL_MSE_FLOOR * (mean(reference).iter().sum::<f64>() / 3.0).powi(2)
}

/// relMSE of an image with these errors, root of the mean square of each pixel, relative to itself.
pub fn relative2(image: &Image, errors: &Image, floor: f64) -> f64 {
    let values = image.pixels().iter().flatten().zip(errors.pixels().iter().flatten());
    let squares = values.map(|(&value, &error)| f64::from(error).powi(2) / (f64::from(value).powi(2) + floor));
    squares.sum::<f64>() / (3 * image.pixels().len()) as f64
}

/// A value's contribution to relMSE.
fn relative_square(x: f64, r: f64, floor: f64) -> f64 {
    (x - r).powi(2) / (r * r + floor)
}

/// (x − r)² / (r² + 0.01·m²) of each pixel, the mean over its channels.
///
/// # Errors
/// As [`compare`].
pub fn relative_errors(image: &Image, reference: &Image) -> Result<Vec<f32>> {
    compare(image, reference)?;
    let floor = floor_of(reference);
    let pixels = image.pixels().iter().zip(reference.pixels());
    Ok(pixels
        .map(|(x, r)| {
            let channels = x.iter().zip(r);
            let terms = channels.map(|(&x, &r)| relative_square(x.into(), r.into(), floor));
            (terms.sum::<f64>() / 3.0) as f32
        })
        .collect())
}

/// Numbers of pixels with invalid values in any channel; a pixel may count in several.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Defects {
    /// Pixels with a NaN.
    pub nan: usize,
    /// Pixels with an infinity of either sign.
    pub infinite: usize,
    /// Pixels with a finite value below zero.
    pub negative: usize,
}

/// Mean of each channel over all pixels.
pub fn mean(image: &Image) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in image.pixels() {
        for (sum, &value) in sum.iter_mut().zip(pixel) {
            *sum += f64::from(value);
        }
    }
    sum.map(|sum| sum / image.pixels().len() as f64)
}

/// Compares a picture with a reference; sums are in f64.
///
/// # Errors
/// [`Error::Config`] if the sizes differ.
pub fn compare(image: &Image, reference: &Image) -> Result<Comparison> {
    let size = |image: &Image| (image.width(), image.height());
    if size(image) != size(reference) {
        let ((w, h), (reference_w, reference_h)) = (size(image), size(reference));
        return Err(Error::Config(format!(
            "the picture has {w}x{h} pixels, the reference {reference_w}x{reference_h}: render at the reference's size"
        )));
    }
    let (means, reference_means) = (mean(image), mean(reference));
    let floor = floor_of(reference);

    let (mut absolute, mut squared, mut relative) = (0.0, 0.0, 0.0);
    let samples = image.pixels().as_flattened();
    for (&x, &r) in samples.iter().zip(reference.pixels().as_flattened()) {
        let (x, r) = (f64::from(x), f64::from(r));
        let error = x - r;
        absolute += error.abs();
        squared += error * error;
        relative += relative_square(x, r, floor);
    }
    let count = samples.len() as f64;
    Ok(Comparison {
        rmse: (squared / count).sqrt(),
        rel_mse: relative / count,
        mae: absolute / count,
        mean_ratio: std::array::from_fn(|channel| means[channel] / reference_means[channel]),
    })
}

/// Counts the pixels with NaN, infinite and negative values.
pub fn defects(image: &Image) -> Defects {
    let count = |is_defect: fn(&f32) -> bool| {
        let pixels = image.pixels().iter();
        pixels.filter(|pixel| pixel.iter().any(is_defect)).count()
    };
    Defects {
        nan: count(|value| value.is_nan()),
        infinite: count(|value| value.is_infinite()),
        negative: count(|value| value.is_finite() && *value < 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: f64, expected: f64) -> bool {
        (value - expected).abs() <= 1e-12 * expected.abs()
    }

    #[test]
    fn the_measures_are_those_worked_out_by_hand() {
        // Channel means of the reference (2, 3, 4), so m = 3 and 0.01·m² = 0.09. Errors: 1 at r = 1, −2 at r = 6.
        let reference = Image::new(2, 1, vec![[1.0, 0.0, 4.0], [3.0, 6.0, 4.0]]);
        let image = Image::new(2, 1, vec![[2.0, 0.0, 4.0], [3.0, 4.0, 4.0]]);
        let comparison = compare(&image, &reference).expect("pictures of one size");
        let rel_mse = (1.0 / 1.09 + 4.0 / 36.09) / 6.0;
        assert!(close(comparison.rel_mse, rel_mse), "{comparison:?}");
        assert!(close(comparison.rmse, (5.0_f64 / 6.0).sqrt()), "{comparison:?}");
        assert!(close(comparison.mae, 3.0 / 6.0), "{comparison:?}");
        assert_eq!(comparison.mean_ratio, [2.5 / 2.0, 2.0 / 3.0, 1.0]);
    }

    #[test]
    fn a_black_pixel_is_weighed_against_the_mean() {
        // m = 0.5: the error of 0.1 at r = 0 weighs 0.01 / (0.01 · 0.25) = 4.
        let reference = Image::new(2, 1, vec![[0.0; 3], [1.0; 3]]);
        let image = Image::new(2, 1, vec![[0.1; 3], [1.0; 3]]);
        let comparison = compare(&image, &reference).expect("pictures of one size");
        assert!((comparison.rel_mse - 2.0).abs() < 1e-6, "{comparison:?}");
    }

    #[test]
    fn a_picture_equals_itself() {
        let image = Image::new(1, 2, vec![[1.0, 2.0, 3.0], [0.0, 0.5, 1e9]]);
        let comparison = compare(&image, &image).expect("pictures of one size");
        let expected = Comparison {
            rmse: 0.0,
            rel_mse: 0.0,
            mae: 0.0,
            mean_ratio: [1.0; 3],
        };
        assert_eq!(comparison, expected);
    }

    #[test]
    fn sums_are_in_double_precision() {
        // In f32 the sum would stop growing at 2²⁴.
        let pixels = vec![[1.0; 3]; (1 << 24) + 1000];
        let image = Image::new(pixels.len(), 1, pixels);
        assert_eq!(mean(&image), [1.0; 3]);
    }

    #[test]
    fn pictures_of_different_size_are_refused() {
        let wide = Image::new(2, 1, vec![[0.0; 3]; 2]);
        let tall = Image::new(1, 2, vec![[0.0; 3]; 2]);
        let error = compare(&wide, &tall).expect_err("an error").to_string();
        assert!(error.contains("2x1") && error.contains("1x2"), "{error}");
    }

    #[test]
    fn defects_count_pixels_not_channels() {
        let pixels = vec![
            [f32::NAN, f32::NAN, -1.0],
            [f32::INFINITY, f32::NEG_INFINITY, 1.0],
            [-1.0, -2.0, 0.0],
            [-0.0, 0.0, 1.0],
        ];
        let expected = Defects {
            nan: 1,
            infinite: 1,
            negative: 2,
        };
        assert_eq!(defects(&Image::new(2, 2, pixels)), expected);
        let clean = Image::new(1, 1, vec![[-0.0, 1.0, f32::MIN_POSITIVE]]);
        assert_eq!(defects(&clean), Defects::default());
    }
}
