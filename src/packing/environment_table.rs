//! The environment in the layout of the device, with the probabilities by which directions are chosen.

use std::f64::consts::PI;

use crate::scene::Environment;

/// The share of directions that is chosen by solid angle alone, so that dim parts are sampled too.
const UNIFORM: f64 = 0.1;

impl Environment {
    /// The picture with the probabilities by which directions are chosen, as `glsl/lights/environment.glsl` reads it: the size
    /// and the rotation in turns; each row's cosines at its upper and lower edge; the pixels. w: the cumulative probability of
    /// rows, and of a row's pixels.
    pub(crate) fn table(&self) -> Vec<[f32; 4]> {
        let [width, height] = self.size();
        let weights = self.weights();
        let mean = self.total() / (4.0 * PI);
        let density = |weight: f64| (1.0 - UNIFORM) * weight + UNIFORM * mean;
        let rows: Vec<Vec<f32>> = weights
            .chunks(width)
            .map(|weights| cumulative(&weights.iter().map(|&weight| density(weight)).collect::<Vec<_>>()))
            .collect();
        let of_rows = weights.chunks(width).enumerate().map(|(row, weights)| {
            let sum: f64 = weights.iter().map(|&weight| density(weight)).sum();
            sum * self.solid_angle(row)
        });
        let edge = |row: usize| (PI * row as f64 / height as f64).cos() as f32;
        let size = [width, height].map(|side| f32::from_bits(side as u32));
        let mut table = vec![[size[0], size[1], self.rotation() as f32, 0.0]];
        let sums = cumulative(&of_rows.collect::<Vec<_>>());
        table.extend(
            sums.iter()
                .enumerate()
                .map(|(row, &sum)| [edge(row), edge(row + 1), 0.0, sum]),
        );
        let pixels = self.image().pixels().iter().zip(rows.iter().flatten());
        table.extend(pixels.map(|(&[r, g, b], &sum)| [r, g, b, sum]));
        table
    }
}

/// An empty table, for scenes without an environment.
pub(crate) fn no_table() -> Vec<[f32; 4]> {
    vec![
        [f32::from_bits(1), f32::from_bits(1), 0.0, 0.0],
        [1.0, -1.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Cumulative shares of the sum, in multiples of 2⁻²⁴ like random numbers. Each value has at least one such step, so that every
/// value can be chosen; the higher probability is accounted for by its weight.
fn cumulative(values: &[f64]) -> Vec<f32> {
    const STEPS: f64 = (1 << 24) as f64;
    let total: f64 = values.iter().sum();
    let mut sum = 0.0;
    let mut before = 0.0;
    let sums = values.iter().zip((0..values.len()).rev()).map(|(value, after)| {
        sum += value;
        before = (sum / total * STEPS)
            .round()
            .max(before + 1.0)
            .min(STEPS - after as f64);
        (before / STEPS) as f32
    });
    sums.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_can_be_chosen() {
        let mut values = vec![1e-30; 5000];
        values[0] = 1.0;
        values[2500] = 1.0;
        let sums = cumulative(&values);
        assert_eq!(sums.last(), Some(&1.0));
        assert!(sums.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
