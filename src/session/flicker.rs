//! How much a frame of an animation differs from the one before, where the picture does not change.

use std::fmt;

use super::Rendered;
use crate::film::Image;
use crate::metrics::floor_of;

/// Pixels of a tile's side: enough for a mean of noise to be close to its expectation, few enough to tell what moves from what
/// doesn't.
const TILE: usize = 8;
/// A tile changes if its root mean square difference is larger than this many times what the noise of both frames explains.
const CHANGES: f64 = 2.0;

/// The difference between two frames of an animation.
///
/// Differences are as relMSE has them: (x − y)² / (m² + 0.01·M²), with m the mean of both pixels and M that of both pictures, root of
/// the mean. They are taken of the tiles (8×8 pixels) in which noise explains a quarter or more of the squared difference: the others
/// show what moves, or its light.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Flicker {
    /// Share of the picture that does not change.
    pub still: f64,
    /// Relative difference there.
    pub difference: f64,
    /// The difference there that independent noise of both frames explains. With one seed the noise of both may be similar, and the
    /// difference smaller.
    pub noise: f64,
}

impl Flicker {
    /// Of two pictures, and their squared noise.
    fn of(pictures: [&Image; 2], noise2: [&[[f64; 3]]; 2]) -> Self {
        let [width, height] = [pictures[0].width(), pictures[0].height()];
        let floor = 0.5 * pictures.iter().map(|picture| floor_of(picture)).sum::<f64>();
        let (mut still, mut difference2, mut relative_noise2) = (0, 0.0, 0.0);
        for top in (0..height).step_by(TILE) {
            for left in (0..width).step_by(TILE) {
                let rows = top..height.min(top + TILE);
                let pixels = rows.flat_map(|y| (left..width.min(left + TILE)).map(move |x| y * width + x));
                let values = pixels.flat_map(|pixel| {
                    [0, 1, 2].map(|channel| {
                        let [x, y] = pictures.map(|picture| f64::from(picture.pixels()[pixel][channel]));
                        let noise2 = noise2.iter().map(|noise2| noise2[pixel][channel]).sum::<f64>();
                        ((x - y).powi(2), noise2, (0.5 * (x + y)).powi(2) + floor)
                    })
                });
                let values: Vec<_> = values.collect();
                let sum = |of: fn(&(f64, f64, f64)) -> f64| values.iter().map(of).sum::<f64>();
                if sum(|(difference2, ..)| *difference2) <= CHANGES * CHANGES * sum(|(_, noise2, _)| *noise2) {
                    still += values.len();
                    difference2 += sum(|(difference2, _, scale)| difference2 / scale);
                    relative_noise2 += sum(|(_, noise2, scale)| noise2 / scale);
                }
            }
        }
        let mean = |sum: f64| if still > 0 { (sum / still as f64).sqrt() } else { 0.0 };
        Self {
            still: still as f64 / (3 * width * height) as f64,
            difference: mean(difference2),
            noise: mean(relative_noise2),
        }
    }
}

impl fmt::Display for Flicker {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [still, difference, noise] =
            [self.still, self.difference, self.noise].map(|part| format!("{:.2} %", 100.0 * part));
        write!(
            text,
            "the {still} of the picture that do not change differ by {difference}; noise explains {noise}"
        )
    }
}

impl Rendered {
    /// How it differs from the frame before it; `None` if one of both has no [error](Rendered::error), or another size. Of denoised
    /// pictures the noisy ones are compared.
    pub fn flicker(&self, before: &Self) -> Option<Flicker> {
        let pictures = [before.noisy(), self.noisy()];
        let [one, other] = pictures.map(|picture| [picture.width(), picture.height()]);
        if one != other {
            return None;
        }
        Some(Flicker::of(pictures, [&before.noise2()?, &self.noise2()?]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::pcg4d;

    const SIDE: usize = 64;
    const NOISE: f64 = 0.1;

    /// A grey picture with noise: uniform numbers, independent for each seed.
    fn noisy(seed: u32) -> Image {
        let value = |pixel: usize, channel: usize| {
            let [number, ..] = pcg4d([seed, pixel as u32, channel as u32, 0]);
            let unit = f64::from(number) / f64::from(u32::MAX) - 0.5;
            (1.0 + NOISE * 12f64.sqrt() * unit) as f32
        };
        let pixels = (0..SIDE * SIDE).map(|pixel| [0, 1, 2].map(|channel| value(pixel, channel)));
        Image::new(SIDE, SIDE, pixels.collect())
    }

    fn of(one: &Image, other: &Image) -> Flicker {
        let noise2 = vec![[NOISE * NOISE; 3]; SIDE * SIDE];
        Flicker::of([one, other], [&noise2, &noise2])
    }

    #[test]
    fn equal_frames_do_not_differ() {
        let flicker = of(&noisy(1), &noisy(1));
        assert_eq!((flicker.still, flicker.difference), (1.0, 0.0));
        assert!(flicker.noise > 0.1, "{flicker}");
    }

    #[test]
    fn independent_noise_differs_by_what_it_explains_and_what_moves_is_left_out() {
        let mut moved = noisy(2);
        let mut pixels = moved.pixels().to_vec();
        // A block of three by two tiles, between the tiles' edges.
        for y in 11..27 {
            for x in 20..44 {
                pixels[y * SIDE + x] = [3.0; 3];
            }
        }
        for (what, picture, changed) in [
            ("nothing", moved.clone(), 0.0),
            (
                "a block",
                {
                    moved = Image::new(SIDE, SIDE, pixels);
                    moved
                },
                12.0 / 64.0,
            ),
        ] {
            let flicker = of(&noisy(1), &picture);
            assert!(
                (flicker.still - (1.0 - changed)).abs() < 1e-9,
                "{what} moves: {flicker}"
            );
            // The squares of 9,984 or more triangular differences have a relative standard error of 1.2 %, its root 0.6 %: five of
            // those. It is the same in every run.
            let ratio = flicker.difference / flicker.noise;
            assert!((ratio - 1.0).abs() < 0.03, "{what} moves: {flicker}");
        }
    }
}
