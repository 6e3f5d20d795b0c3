//! Light behind glass that no photon has carried yet. A shadow ray that ends on glass estimates the light without refraction.
//! Only photons show where the light really goes. Until they do, the error of a pixel that might have such light is unknown: the
//! part that has not arrived counts as error. The pixel is decided if enough photons would have arrived without refraction for
//! their number to be significant; or if photons near it carried a part of the light: glass that focuses light leaves most of its
//! shadow without photons forever.

use crate::layout::BehindGlass;

/// Expected number of photons without refraction, from which on their absence means that the light goes elsewhere.
const TELLING: f64 = 4.0;
/// Share of the unrefracted light of a neighbourhood of pixels: if that much has arrived there, the light is found.
const FOUND: f64 = 0.25;
/// Minimum number of photons in one pixel for that, so that it is significant.
const FOUND_BY: f32 = 16.0;

/// Radiance that each pixel may lack. `photon` is the radiance of a white surface by one of all emitted photons, times R².
pub(super) fn missing(pixels: &[BehindGlass], width: usize, photon: f64) -> Vec<f64> {
    if pixels.iter().all(|pixel| pixel.unbent <= 0.0) {
        return vec![0.0; pixels.len()];
    }
    let sums = Sums::of(pixels, width);
    let found = found(pixels, width);
    let of_pixel = |(index, pixel): (usize, &BehindGlass)| {
        let unbent = sums.around(index, pixel.radius);
        let is_known = found[index] || unbent * f64::from(pixel.radius2) >= TELLING * photon;
        if is_known {
            0.0
        } else {
            f64::from(pixel.unbent - pixel.arrived).max(0.0)
        }
    };
    pixels.iter().enumerate().map(of_pixel).collect()
}

/// Sums of the unrefracted light over all pixels above and to the left.
struct Sums {
    width: usize,
    height: usize,
    sums: Vec<f64>,
}

impl Sums {
    fn of(pixels: &[BehindGlass], width: usize) -> Self {
        let height = pixels.len() / width;
        let stride = width + 1;
        let mut sums = vec![0.0; stride * (height + 1)];
        for (index, pixel) in pixels.iter().enumerate() {
            let at = (index / width + 1) * stride + index % width + 1;
            sums[at] = f64::from(pixel.unbent.max(0.0)) + sums[at - 1] + sums[at - stride] - sums[at - stride - 1];
        }
        Self { width, height, sums }
    }

    /// The mean over a square of this radius; 0 outside of the picture.
    fn around(&self, pixel: usize, radius: f32) -> f64 {
        let reach = (f64::from(radius).min(1e6)).round() as usize;
        let range = |at: usize, side: usize| (at.saturating_sub(reach), (at + reach + 1).min(side));
        let ((left, right), (top, bottom)) = (
            range(pixel % self.width, self.width),
            range(pixel / self.width, self.height),
        );
        let sum = |x: usize, y: usize| self.sums[y * (self.width + 1) + x];
        let inside = sum(right, bottom) - sum(left, bottom) - sum(right, top) + sum(left, top);
        inside.max(0.0) / (2 * reach + 1).pow(2) as f64
    }
}

/// Whether the light of each pixel and its neighbourhood has been found.
fn found(pixels: &[BehindGlass], width: usize) -> Vec<bool> {
    let height = pixels.len() / width;
    let mut is_seen: Vec<bool> = pixels.iter().map(|pixel| pixel.unbent <= 0.0).collect();
    let mut found = vec![false; pixels.len()];
    for first in 0..pixels.len() {
        if is_seen[first] {
            continue;
        }
        is_seen[first] = true;
        let mut together = vec![first];
        let mut next = 0;
        while let Some(&pixel) = together.get(next) {
            next += 1;
            let near = |at: usize, side: usize| at.saturating_sub(1)..(at + 2).min(side);
            for y in near(pixel / width, height) {
                for neighbour in near(pixel % width, width).map(|x| y * width + x) {
                    if !is_seen[neighbour] {
                        is_seen[neighbour] = true;
                        together.push(neighbour);
                    }
                }
            }
        }
        let sum = |part: fn(&BehindGlass) -> f32| -> f64 {
            let parts = together.iter().map(|&pixel| f64::from(part(&pixels[pixel])));
            parts.sum()
        };
        let has_many = together.iter().any(|&pixel| pixels[pixel].photons >= FOUND_BY);
        if has_many && sum(|pixel| pixel.arrived) >= FOUND * sum(|pixel| pixel.unbent) {
            together.iter().for_each(|&pixel| found[pixel] = true);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 40;

    /// A shadow of glass, 10 pixels wide, in which each pixel would have 1.
    fn shadow(radius: f32) -> Vec<BehindGlass> {
        let pixel = |index: usize| {
            let is_inside = (15..25).contains(&(index % SIDE)) && (15..25).contains(&(index / SIDE));
            BehindGlass {
                unbent: f32::from(is_inside),
                arrived: 0.0,
                photons: 0.0,
                radius,
                radius2: 1.0,
            }
        };
        (0..SIDE * SIDE).map(pixel).collect()
    }

    fn sum(pixels: &[BehindGlass], photon: f64) -> f64 {
        missing(pixels, SIDE, photon).iter().sum()
    }

    #[test]
    fn light_behind_glass_is_missing_until_so_many_photons_would_have_come_that_none_says_something() {
        assert_eq!(sum(&shadow(1.0), 0.3), 100.0);
        // Discs at the shadow's edge have a part of it.
        assert_eq!(sum(&shadow(1.0), 0.24), 36.0);
        assert_eq!(sum(&shadow(1.0), 0.01), 0.0);
        // In a disc that is much larger than the shadow the photons are few.
        assert_eq!(sum(&shadow(100.0), 0.01), 100.0);
        assert_eq!(sum(&shadow(100.0), 1e-4), 0.0);
    }

    #[test]
    fn light_that_glass_focuses_into_a_part_of_its_shadow_is_found_there() {
        let focused = |arrived: f32, photons: f32| {
            let mut pixels = shadow(1.0);
            (pixels[20 * SIDE + 20].arrived, pixels[20 * SIDE + 20].photons) = (arrived, photons);
            sum(&pixels, 1.0)
        };
        assert_eq!(focused(60.0, 30.0), 0.0);
        // Too little, or by chance.
        assert_eq!(focused(10.0, 30.0), 99.0);
        assert_eq!(focused(60.0, 1.0), 99.0);
    }

    #[test]
    fn what_is_found_in_one_shadow_says_nothing_of_another() {
        let mut pixels = shadow(1.0);
        (pixels[20 * SIDE + 20].arrived, pixels[20 * SIDE + 20].photons) = (60.0, 30.0);
        pixels[5 * SIDE + 5].unbent = 2.0;
        assert_eq!(sum(&pixels, 1.0), 2.0);
    }
}
