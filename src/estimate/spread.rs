//! The value of a pixel by each sequence.

use crate::config::{SEQUENCES, SequenceIterations};

const COUNT: usize = SEQUENCES as usize;

/// The share of the iterations of each sequence.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights([f64; COUNT]);

impl Weights {
    /// After these iterations.
    pub fn of(iterations: SequenceIterations) -> Self {
        Self(iterations.0.map(|count| f64::from(count) / iterations.total()))
    }
}

/// A pixel's value by each sequence.
pub(super) struct Spread {
    weights: [f64; COUNT],
    values: [f64; COUNT],
    pub mean: f64,
}

impl Spread {
    pub fn of(Weights(weights): Weights, values: [f64; COUNT]) -> Self {
        let mean = weights.iter().zip(values).map(|(weight, value)| weight * value).sum();
        Self { weights, values, mean }
    }

    /// Squared standard error of the mean, a sequence's share of it divided by what `divisor` gives for the sequence.
    fn noise2_over(&self, divisor: impl Fn(f64, f64) -> f64) -> f64 {
        let of_sequence =
            |(&weight, &value): (&f64, &f64)| (weight * (value - self.mean)).powi(2) / divisor(weight, value);
        let squares: f64 = self.weights.iter().zip(&self.values).map(of_sequence).sum();
        // Correction of the spread, because the mean is that of the same values.
        squares / (1.0 - self.weights.iter().map(|weight| weight * weight).sum::<f64>())
    }

    /// Squared standard error of the mean.
    pub fn noise2(&self) -> f64 {
        self.noise2_over(|_, _| 1.0)
    }

    /// The same over relMSE's denominator. Rare bright contributions make a pixel far too bright: relative to that value's square
    /// its error would seem small. So each sequence's share is divided by the value of the other sequences, or of the surrounding
    /// pixels if that is larger, if that is less than the value of all.
    pub fn relative_noise2(&self, around: f64, floor: f64) -> f64 {
        self.noise2_over(|weight, value| {
            let others = (self.mean - weight * value) / (1.0 - weight);
            others.max(around).min(self.mean).powi(2) + floor
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequences_count_by_their_iterations() {
        let spread = Spread::of(Weights::of(6.into()), [3.0, 3.0, 0.0, 0.0]);
        assert_eq!(spread.mean, 2.0);
        // Two sequences of a third each are off by 1, two of a sixth by 2.
        let expected = 8.0 / 13.0;
        assert!((spread.noise2() - expected).abs() < 1e-12, "{}", spread.noise2());
    }
}
