//! Independent parts of a render.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Which of several independent parts of a render it is. The mean of all parts is the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Part {
    /// Counted from 1.
    pub number: u32,
    /// How many there are.
    pub of: u32,
}

/// An odd number near 2³² over the golden ratio: products with different numbers differ in many bits.
const SPREAD: u32 = 0x9e37_79b9;

impl Part {
    /// The only part.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Whether there are no other parts.
    pub fn is_whole(self) -> bool {
        self.of == 1
    }

    /// The seed of its random numbers. Different parts of a render have different ones.
    pub(super) fn seed(self, seed: u32) -> u32 {
        if self.is_whole() {
            return seed;
        }
        seed.wrapping_add(self.number.wrapping_mul(SPREAD)) ^ SPREAD
    }

    /// Factor of the initial R². After n iterations R² is R₁² n^(α−1) (equation 2), in the whole R₁² (N n)^(α−1). So N parts that
    /// begin with R₁² N^(α−1) end with the whole's radius. A part's variance is N^(1−α) times that of a render of n iterations,
    /// about n^(−α), and that of the mean of N parts (N n)^(−α), as the whole's.
    pub fn radius2_factor(self, alpha: f32) -> f32 {
        f64::from(self.of).powf(f64::from(alpha) - 1.0) as f32
    }
}

impl Default for Part {
    fn default() -> Self {
        Self::WHOLE
    }
}

impl fmt::Display for Part {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(text, "{}/{}", self.number, self.of)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_part_has_its_own_seed_and_the_whole_has_the_users() {
        assert_eq!(Part::WHOLE.seed(7), 7);
        let of = 1000;
        let seeds: BTreeSet<u32> = (1..=of).map(|number| Part { number, of }.seed(7)).collect();
        assert_eq!(seeds.len(), of as usize);
        assert!(!seeds.contains(&7));
    }

    #[test]
    fn parts_end_with_the_radius_of_the_whole() {
        let alpha = 2.0 / 3.0;
        let after = |iterations: f64| iterations.powf(alpha - 1.0);
        let factor = f64::from(Part { number: 2, of: 8 }.radius2_factor(alpha as f32));
        assert!((factor * after(100.0) / after(800.0) - 1.0).abs() < 1e-6);
    }
}
