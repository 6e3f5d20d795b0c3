//! What a pixel had in each batch of iterations.

use super::MOST_BATCHES;

/// One value of a pixel in each batch of iterations.
pub(super) struct Batches {
    values: [f64; MOST_BATCHES],
    count: usize,
    pub mean: f64,
}

impl Batches {
    /// From the pictures after 1, 2, … batches.
    pub fn of(cumulative: impl Iterator<Item = f32>) -> Self {
        let (mut values, mut count, mut sum) = ([0.0; MOST_BATCHES], 0, 0.0);
        for (own, value) in values.iter_mut().zip(cumulative) {
            count += 1;
            let until_here = f64::from(value) * count as f64;
            *own = until_here - sum;
            sum = until_here;
        }
        let mean = sum / count as f64;
        Self { values, count, mean }
    }

    /// Squared standard error of the mean, a batch's share of it divided by what `divisor` gives for the batch.
    fn noise2_over(&self, divisor: impl Fn(f64) -> f64) -> f64 {
        let count = self.count;
        let squares: f64 = self.values[..count]
            .iter()
            .map(|value| (value - self.mean).powi(2) / divisor(*value))
            .sum();
        squares / (count * (count - 1)) as f64
    }

    /// Squared standard error of the mean.
    pub fn noise2(&self) -> f64 {
        self.noise2_over(|_| 1.0)
    }

    /// The same over relMSE's denominator. Light that comes seldom and is bright makes a pixel far too bright: over that
    /// value's square its error would seem small. Each batch's part is therefore over what the other batches have of the
    /// pixel, or the pixels around it if that is more, if it is less than what all have.
    pub fn relative_noise2(&self, around: f64, floor: f64) -> f64 {
        let count = self.count as f64;
        self.noise2_over(|value| {
            let others = (self.mean * count - value) / (count - 1.0);
            others.max(around).min(self.mean).powi(2) + floor
        })
    }
}
