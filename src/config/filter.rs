//! Pixel filters: where in and around a pixel its camera paths pass the film.

use super::choices;
use crate::layout::FILTER_PLACES;

choices! {
    /// How a pixel weighs the film around its centre.
    pub enum PixelFilter {
        /// The pixel's square.
        Box => "box",
        /// A Gaussian of half a pixel's standard deviation, cut at two pixels.
        Gauss => "gauss",
        /// A Blackman–Harris window of 3 pixels' width, Blender's default.
        BlackmanHarris => "blackman-harris",
    }
}

/// Half widths in pixels.
const GAUSS_RADIUS: f64 = 2.0;
const BLACKMAN_HARRIS_RADIUS: f64 = 1.5;
const STANDARD_DEVIATION: f64 = 0.5;
/// Steps of the numerical integral over a filter: its error is far below f32's.
const STEPS: usize = 1 << 14;

impl PixelFilter {
    /// Half the filter's width, in pixels.
    pub fn radius(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Gauss => GAUSS_RADIUS,
            Self::BlackmanHarris => BLACKMAN_HARRIS_RADIUS,
        }
    }

    /// The filter at a distance from the pixel's centre along an axis, in pixels; not normalised. Filters are products of both
    /// axes.
    pub fn weight(self, distance: f64) -> f64 {
        let inside = distance / self.radius();
        if inside.abs() > 1.0 {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Gauss => {
                let gauss = |x: f64| (-0.5 * (x / STANDARD_DEVIATION).powi(2)).exp();
                gauss(distance) - gauss(GAUSS_RADIUS)
            }
            // Harris, «On the use of windows for harmonic analysis», 1978: four terms, −92 dB.
            Self::BlackmanHarris => {
                let wave = |number: f64| (std::f64::consts::PI * number * inside).cos();
                0.358_75 + 0.488_29 * wave(1.0) + 0.141_28 * wave(2.0) + 0.011_68 * wave(3.0)
            }
        }
    }

    /// Distances from the pixel's centre, in pixels, for `filter_place` of `glsl/stages/camera.comp`: beyond distance i lies
    /// (i / 63)² of the filter, counted on both sides. The square keeps the steps of the tail small. Paths that are uniform in
    /// that part need no weights.
    pub fn places(self) -> [f32; FILTER_PLACES as usize] {
        let width = self.radius() / STEPS as f64;
        let mut sums = vec![0.0];
        for step in 0..STEPS {
            let sum = sums[step] + self.weight(self.radius() - (step as f64 + 0.5) * width);
            sums.push(sum);
        }
        let total = sums[STEPS];
        let place = |tail: f64| {
            let step = sums.partition_point(|&sum| sum < tail * total).clamp(1, STEPS);
            let within = (tail * total - sums[step - 1]) / (sums[step] - sums[step - 1]).max(f64::MIN_POSITIVE);
            self.radius() - (step as f64 - 1.0 + within) * width
        };
        std::array::from_fn(|index| place((index as f64 / f64::from(FILTER_PLACES - 1)).powi(2)) as f32)
    }

    /// The place relative to the pixel's centre that belongs to a uniform number of a path; `places` are those of the filter.
    pub fn place(places: &[f32], number: f64) -> f64 {
        let tail = (1.0 - (2.0 * number - 1.0).abs()).max(0.0);
        let at = tail.sqrt() * (places.len() - 1) as f64;
        let index = (at as usize).min(places.len() - 2);
        let [before, behind] = [places[index], places[index + 1]].map(f64::from);
        let distance = before + (behind - before) * (at - index as f64);
        if number < 0.5 { -distance } else { distance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Choice as _;

    #[test]
    fn places_are_distributed_as_the_filter_weighs_them() {
        const NUMBERS: usize = 1 << 16;
        const BINS: usize = 32;
        for &filter in PixelFilter::ALL {
            let places = filter.places();
            let mut bins = [0.0; BINS];
            for number in 0..NUMBERS {
                let place = PixelFilter::place(&places, (number as f64 + 0.5) / NUMBERS as f64);
                let bin = (place / filter.radius() + 1.0) / 2.0 * BINS as f64;
                bins[(bin as usize).min(BINS - 1)] += 1.0 / NUMBERS as f64;
            }
            let steps = 64;
            let weight = |bin: usize| {
                let part = |step: usize| {
                    let inside = (bin * steps + step) as f64 + 0.5;
                    filter.weight((inside / (BINS * steps) as f64 * 2.0 - 1.0) * filter.radius())
                };
                (0..steps).map(part).sum::<f64>()
            };
            let whole: f64 = (0..BINS).map(weight).sum();
            for (bin, found) in bins.into_iter().enumerate() {
                let wanted = weight(bin) / whole;
                assert!(
                    (found - wanted).abs() < 2e-3 * wanted + 2e-4,
                    "{filter}: bin {bin} has {found}, not {wanted}"
                );
            }
        }
    }

    /// By integration: 1/√12 for the square; √(1/4) less what is cut; 0.277 half widths for four terms of cosines.
    #[test]
    fn filters_are_as_wide_as_they_say() {
        for (filter, wanted) in [
            (PixelFilter::Box, 0.288_7),
            (PixelFilter::Gauss, 0.498_0),
            (PixelFilter::BlackmanHarris, 0.277_0 * BLACKMAN_HARRIS_RADIUS),
        ] {
            let places = filter.places();
            let squares = (0..10_000).map(|i| PixelFilter::place(&places, (f64::from(i) + 0.5) / 1e4).powi(2));
            let deviation = (squares.sum::<f64>() / 1e4).sqrt();
            assert!(
                (deviation - wanted).abs() < 2e-3,
                "{filter}: {deviation} instead of {wanted}"
            );
        }
    }
}
