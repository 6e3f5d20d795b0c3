//! The squared errors of each pixel, and their sum, the relative error of the picture.

use rayon::prelude::*;

/// Ratio of the squared second differences along rows and columns to the squared error, for pixels sampled at their centres: a
/// vertical edge of height h leaves two differences of h, and the mean squared error of a pixel that it crosses at a uniform
/// position is h²/12. A slanted edge has 40, a line thinner than a pixel 6.
const BEND_OVER_CENTRE: f64 = 24.0;

/// The errors of a picture, from the pictures of its sequences.
#[derive(Debug)]
pub(super) struct Parts {
    pub width: usize,
    pub pixels: Vec<OfPixel>,
    /// relMSE's denominator without the square.
    pub floor: f64,
    /// Whether pixels are sampled at their centres only.
    pub sees_centres: bool,
    /// Radiance behind glass that each pixel may lack; empty if it is not estimated.
    pub missing: Vec<f64>,
}

/// The same of a pixel's channels.
#[derive(Debug)]
pub(super) struct OfPixel {
    /// By all sequences together.
    pub values: [f64; 3],
    /// Squared standard errors.
    pub noise2: [f64; 3],
    /// The same, over relMSE's denominator.
    pub relative_noise2: [f64; 3],
    /// The part of the squared errors that is the contribution of one photon that might have arrived.
    pub photon2: f64,
    /// Squared bias of the mean of the channels; 0 on average for pure noise.
    pub bias2: f64,
    /// The pixel's value without the light that R certainly blurs into it, as a share of its value.
    pub own: f64,
}

impl Parts {
    fn per_sample(&self) -> f64 {
        1.0 / (3 * self.pixels.len()) as f64
    }

    /// Contribution of noise to relMSE.
    pub fn relative_noise2(&self) -> f64 {
        let parts = self.pixels.iter().flat_map(|pixel| pixel.relative_noise2);
        parts.sum::<f64>() * self.per_sample()
    }

    /// Contribution of bias to relMSE.
    pub fn relative_bias2(&self) -> f64 {
        self.relative_of(&self.bias2())
    }

    fn bias2(&self) -> Vec<f64> {
        self.pixels.iter().map(|pixel| pixel.bias2).collect()
    }

    /// Contribution of aliasing to relMSE.
    pub fn relative_aliasing2(&self) -> f64 {
        self.aliasing2().1
    }

    /// Contribution of missing light to relMSE; the reference would include it.
    pub fn relative_missing2(&self) -> f64 {
        let of_pixel = |(pixel, missing): (&OfPixel, &f64)| {
            let of_channel = |value: f64| missing.powi(2) / ((value + missing).powi(2) + self.floor);
            pixel.values.map(of_channel).iter().sum::<f64>()
        };
        self.pixels.iter().zip(&self.missing).map(of_pixel).sum::<f64>() * self.per_sample()
    }

    /// Contribution to relMSE of pixels without photons, as if they had received one, and their share.
    pub fn without_photons(&self) -> (f64, f64) {
        let waiting = self.pixels.iter().filter(|pixel| pixel.photon2 > 0.0);
        let (mut relative2, mut count) = (0.0, 0);
        for pixel in waiting {
            let parts = pixel.values.map(|value| pixel.photon2 / (value * value + self.floor));
            relative2 += parts.iter().sum::<f64>() * self.per_sample();
            count += 1;
        }
        (relative2, f64::from(count) / self.pixels.len() as f64)
    }

    /// Each pixel's squared error, of all parts together.
    pub fn of_pixels(&self) -> Vec<[f64; 3]> {
        // A pixel's own bias is dominated by noise. Negative estimates are clamped, so a scale keeps the sum equal to the
        // picture's error.
        let bias2 = self.bias2();
        let around: Vec<f64> = sums_around(&bias2, self.width)
            .into_iter()
            .map(|(sum, count)| sum.max(0.0) / count as f64)
            .collect();
        let bias_scale = scale(self.relative_of(&bias2), self.relative_of(&around));
        let mut aliasing2 = self.aliasing2().0;
        let whole = aliasing2.as_flattened().iter().sum();
        aliasing2
            .as_flattened_mut()
            .iter_mut()
            .for_each(|part| *part = part.max(0.0));
        let aliasing_scale = scale(whole, aliasing2.as_flattened().iter().sum());
        let missing = self.missing.iter().copied().chain(std::iter::repeat(0.0));
        let parts = self.pixels.iter().zip(around).zip(aliasing2).zip(missing);
        parts
            .map(|(((pixel, bias2), aliasing2), missing)| {
                let share2 = share2(&pixel.values);
                [0, 1, 2].map(|channel| {
                    pixel.noise2[channel]
                        + bias2 * share2[channel] * bias_scale
                        + aliasing2[channel] * aliasing_scale
                        + missing.powi(2)
                })
            })
            .collect()
    }

    /// relMSE of squared biases of the channels' means.
    fn relative_of(&self, bias2: &[f64]) -> f64 {
        let of_pixel = |(pixel, bias2): (&OfPixel, &f64)| {
            let shares = share2(&pixel.values).into_iter().zip(pixel.values);
            let weighed: f64 = shares
                .map(|(share, value)| share / ((value * pixel.own).powi(2) + self.floor))
                .sum();
            bias2 * weighed
        };
        self.pixels.iter().zip(bias2).map(of_pixel).sum::<f64>() * self.per_sample()
    }

    /// Squared error of each pixel sampled at its centre only, from the second differences to its neighbours, and its
    /// contribution to relMSE. The differences by noise are subtracted, so some are negative.
    fn aliasing2(&self) -> (Vec<[f64; 3]>, f64) {
        let mut of_pixels = vec![[0.0; 3]; self.pixels.len()];
        if !self.sees_centres {
            return (of_pixels, 0.0);
        }
        let (width, height) = (self.width, self.pixels.len() / self.width);
        let mut relative = 0.0;
        for (pixel, of_pixel) in of_pixels.iter_mut().enumerate() {
            for (at, side, stride) in [(pixel % width, width, 1), (pixel / width, height, width)] {
                if at == 0 || at + 1 == side {
                    continue;
                }
                for (channel, of_channel) in of_pixel.iter_mut().enumerate() {
                    let [before, here, after] = [pixel - stride, pixel, pixel + stride]
                        .map(|pixel| (self.pixels[pixel].values[channel], self.pixels[pixel].noise2[channel]));
                    let bend2 = (before.0 - 2.0 * here.0 + after.0).powi(2) - (before.1 + 4.0 * here.1 + after.1);
                    let around = (before.0 + 2.0 * here.0 + after.0) / 4.0;
                    *of_channel += bend2 / BEND_OVER_CENTRE;
                    relative += bend2 / BEND_OVER_CENTRE / (around * around + self.floor);
                }
            }
        }
        (of_pixels, relative * self.per_sample())
    }
}

/// A channel's bias is proportional to its value; its square over that of the pixel.
fn share2(values: &[f64; 3]) -> [f64; 3] {
    let mean = values.iter().sum::<f64>() / 3.0;
    values.map(|value| if mean > 0.0 { (value / mean).powi(2) } else { 0.0 })
}

/// The scale that restores the signed sum after negative parts were clamped.
fn scale(signed: f64, positive: f64) -> f64 {
    if positive > 0.0 {
        signed.max(0.0) / positive
    } else {
        0.0
    }
}

/// Sum over the pixels within two columns and rows, including the pixel itself, and their number.
pub(super) fn sums_around(values: &[f64], width: usize) -> Vec<(f64, usize)> {
    const REACH: usize = 2;
    let height = values.len() / width;
    let near = |at: usize, side: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(side);
    let of_row = |pixel: usize| values[pixel / width * width..][near(pixel % width, width)].iter().sum();
    let of_rows: Vec<f64> = (0..values.len()).into_par_iter().map(of_row).collect();
    let of_pixel = |pixel: usize| {
        let rows = near(pixel / width, height);
        let count = near(pixel % width, width).len() * rows.len();
        (rows.map(|row| of_rows[row * width + pixel % width]).sum(), count)
    };
    (0..values.len()).into_par_iter().map(of_pixel).collect()
}
