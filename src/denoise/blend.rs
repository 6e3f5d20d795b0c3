//! Denoised pictures are too smooth: caustics and textures lose contrast, which more iterations don't bring back. Where the picture is
//! known better than that, it is kept.

use crate::film::Image;

/// Pixels on each side whose differences count.
const AROUND: usize = 2;

/// The denoised picture, and the noisy one where it differs from it by more than its `errors` explain, in the pixel itself and in the
/// pixels around it.
///
/// If the noisy value has the variance σ² and the denoised one is off by b, then the mean squared difference is σ² + b², and the
/// mixture with the smallest error has the share b² / (σ² + b²) of the noisy value. The pixel itself is left out of the estimate
/// of its surroundings: bright specks, whose error is estimated too small, are noise all around.
pub(crate) fn blend(noisy: &Image, denoised: &Image, errors: &Image) -> Image {
    let [width, height] = [noisy.width(), noisy.height()];
    let of_pixel = |((noisy, denoised), error): ((&[f32; 3], &[f32; 3]), &[f32; 3])| {
        let difference2 = (0..3)
            .map(|i| (f64::from(noisy[i]) - f64::from(denoised[i])).powi(2))
            .sum();
        let error2 = error.iter().map(|&part| f64::from(part).powi(2)).sum();
        let is_known = f64::is_finite(difference2) && f64::is_finite(error2);
        if is_known { [difference2, error2] } else { [0.0; 2] }
    };
    let values = noisy.pixels().iter().zip(denoised.pixels()).zip(errors.pixels());
    let squares: Vec<[f64; 2]> = values.map(of_pixel).collect();
    let sum = |of: &mut dyn Iterator<Item = [f64; 2]>| of.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
    let within = |at: usize, size: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(size);
    let rows: Vec<[f64; 2]> = (0..width * height)
        .map(|index| {
            let row = index / width * width;
            sum(&mut within(index % width, width).map(|x| squares[row + x]))
        })
        .collect();
    let pixels = (0..width * height).map(|index| {
        let window = sum(&mut within(index / width, height).map(|y| rows[y * width + index % width]));
        let own = squares[index];
        let around = [window[0] - own[0], window[1] - own[1]];
        let share = (excess(own) * excess(around)) as f32;
        let (noisy, denoised) = (noisy.pixels()[index], denoised.pixels()[index]);
        if share > 0.0 {
            std::array::from_fn(|i| denoised[i] + share * (noisy[i] - denoised[i]))
        } else {
            denoised
        }
    });
    Image::new(width, height, pixels.collect())
}

/// The share of a squared difference that the squared error does not explain.
fn excess([difference2, error2]: [f64; 2]) -> f64 {
    if difference2 > error2 {
        1.0 - error2 / difference2
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 9;

    fn image(pixel: impl Fn(usize, usize) -> f32) -> Image {
        let pixels = (0..SIZE * SIZE).map(|index| [pixel(index % SIZE, index / SIZE); 3]);
        Image::new(SIZE, SIZE, pixels.collect())
    }

    fn centre(image: &Image) -> f32 {
        image.pixels()[SIZE * SIZE / 2][0]
    }

    #[test]
    fn differences_within_the_error_are_noise() {
        let denoised = image(|_, _| 1.0);
        let noisy = image(|x, y| if (x + y).is_multiple_of(2) { 1.1 } else { 0.9 });
        assert_eq!(blend(&noisy, &denoised, &image(|_, _| 0.11)), denoised);
    }

    #[test]
    fn the_share_of_the_noisy_picture_is_that_with_the_smallest_error() {
        // Off by 2 with an error of 1: three quarters, by the pixel and again by those around it.
        let blended = blend(&image(|_, _| 3.0), &image(|_, _| 1.0), &image(|_, _| 1.0));
        assert!(
            (centre(&blended) - (1.0 + 2.0 * 0.75 * 0.75)).abs() < 1e-6,
            "{}",
            centre(&blended)
        );
        let sure = blend(&image(|_, _| 3.0), &image(|_, _| 1.0), &image(|_, _| 0.0));
        assert_eq!(sure, image(|_, _| 3.0), "without an error the picture is kept");
    }

    #[test]
    fn a_speck_alone_is_noise_even_if_its_error_is_underestimated() {
        let speck = |x: usize, y: usize| if (x, y) == (SIZE / 2, SIZE / 2) { 50.0 } else { 1.0 };
        let denoised = image(|_, _| 1.0);
        assert_eq!(blend(&image(speck), &denoised, &image(|_, _| 0.1)), denoised);
    }

    #[test]
    fn values_that_are_no_numbers_are_not_kept() {
        for bad in [f32::NAN, f32::INFINITY] {
            let noisy = image(|x, y| if (x, y) == (4, 4) { bad } else { 3.0 });
            let blended = blend(&noisy, &image(|_, _| 1.0), &image(|_, _| 0.0));
            assert_eq!(centre(&blended), 1.0);
            assert_eq!(blended.pixels()[0][0], 3.0, "others are");
        }
    }
}
