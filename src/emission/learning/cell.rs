//! Cells of starts, the statistics of their paths, and how they are split.

use serde::{Deserialize, Serialize};

use crate::emission::table::DIMENSIONS;

/// Rays and starts that each cell is assumed to have had before, with the average value.
pub(super) const PRIOR: f64 = 16.0;
/// Number of bins of a cell along each coordinate.
pub(super) const BINS: usize = 8;
/// Minimum number of paths in a cell that is split.
const CUT_PATHS: f64 = 64.0;
/// Minimum share of the variance that a separate density for each bin would save, for a cell to be split.
const CUT_CONTRAST: f64 = 0.04;
/// Minimum χ² of the bins' values, with one degree of freedom less than bins: exceeded by chance in 1 of 1000 cases.
const SIGNIFICANT: f64 = 24.0;
/// Minimum width of a cell: random numbers have steps of 2⁻²⁴.
const THINNEST: f32 = 1.0 / 65536.0;

/// Statistics of a cell's paths: sums in path order, so that they have the same bits in every run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Counts {
    pub paths: f64,
    pub value: f64,
    pub rays: f64,
    /// Σ value².
    pub squares: f64,
    /// Along each coordinate, the number of paths in equal bins of the cell.
    pub paths_in: [[f64; BINS]; DIMENSIONS],
    /// Sums of their values.
    pub value_in: [[f64; BINS]; DIMENSIONS],
}

impl Counts {
    /// Cost of its paths: one for each start, and one for each ray.
    pub fn cost(&self) -> f64 {
        self.paths + self.rays
    }

    /// Statistics with these shares of the paths and of the value, without distribution over bins.
    pub fn part(&self, paths: f64, value: f64) -> Self {
        Self {
            paths: self.paths * paths,
            value: self.value * value,
            rays: self.rays * paths,
            squares: self.squares * value,
            paths_in: scaled(self.paths_in, paths),
            value_in: scaled(self.value_in, value),
        }
    }

    /// Statistics of the same paths with scaled values.
    pub fn revalued(&self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            squares: self.squares * factor * factor,
            value_in: scaled(self.value_in, factor),
            ..*self
        }
    }
}

fn scaled(sums: [[f64; BINS]; DIMENSIONS], factor: f64) -> [[f64; BINS]; DIMENSIONS] {
    sums.map(|along| along.map(|sum| sum * factor))
}

/// The bins of half a cell, from the bins of the whole cell.
fn of_half(sums: [f64; BINS], upper: bool) -> [f64; BINS] {
    let first = if upper { BINS / 2 } else { 0 };
    std::array::from_fn(|part| 0.5 * sums[first + part / 2])
}

/// A box of a stratum's starts.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Cell {
    pub stratum: usize,
    pub low: [f32; DIMENSIONS],
    pub size: [f32; DIMENSIONS],
    pub probability: f64,
    /// Probability that a path starts in it.
    pub density: f64,
    pub counts: Counts,
}

impl Cell {
    pub fn volume(&self) -> f64 {
        self.size.iter().map(|&side| f64::from(side)).product()
    }

    /// The most useful split along one of the first `usable` coordinates, if one is significant.
    pub fn best_cut(&self, usable: usize) -> Option<Cut> {
        let counts = &self.counts;
        if counts.paths < CUT_PATHS || counts.value == 0.0 {
            return None;
        }
        let value = counts.value;
        // The number of equal values with the same relative variance.
        let effective = value * value / counts.squares;
        let prior = PRIOR / BINS as f64;
        let rate = |value: f64, paths: f64| (value + prior * counts.value / counts.paths) / (paths + prior);
        let cuts = (0..usable).filter(|&dimension| self.size[dimension] > THINNEST);
        let cuts = cuts.filter_map(|dimension| {
            let (paths, values) = (&counts.paths_in[dimension], &counts.value_in[dimension]);
            let rates: [f64; BINS] = std::array::from_fn(|bin| rate(values[bin], paths[bin]));
            let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
            // Because the density is proportional to the root.
            let contrast = 1.0 - mean(&rates.map(f64::sqrt)).powi(2) / mean(&rates);
            let squares: f64 = values.iter().map(|part| (part / value).powi(2)).sum();
            let chi2 = effective * (BINS as f64 * squares - 1.0);
            let (lower, upper) = rates.split_at(BINS / 2);
            let (a, b) = (mean(lower).sqrt(), mean(upper).sqrt());
            let cut = Cut {
                dimension,
                lower: a / (a + b),
                contrast,
            };
            (contrast > CUT_CONTRAST && chi2 > SIGNIFICANT).then_some(cut)
        });
        cuts.max_by(|a, b| a.contrast.total_cmp(&b.contrast))
    }

    /// Both halves after a split, the lower one first.
    pub fn halves(&self, Cut { dimension, lower, .. }: Cut) -> [Self; 2] {
        let counts = &self.counts;
        let of_lower = |sums: &[f64; BINS]| sums[..BINS / 2].iter().sum::<f64>();
        let paths = of_lower(&counts.paths_in[dimension]) / counts.paths;
        let value = of_lower(&counts.value_in[dimension]) / counts.value;
        [false, true].map(|upper| {
            let part = |lower: f64| if upper { 1.0 - lower } else { lower };
            let mut cell = self.clone();
            cell.size[dimension] *= 0.5;
            if upper {
                cell.low[dimension] += cell.size[dimension];
            }
            cell.probability *= part(lower);
            cell.counts = counts.part(part(paths), part(value));
            cell.counts.paths_in[dimension] = of_half(counts.paths_in[dimension], upper);
            cell.counts.value_in[dimension] = of_half(counts.value_in[dimension], upper);
            cell
        })
    }
}

/// The split of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    pub dimension: usize,
    /// Share of the cell's probability for the lower half.
    pub lower: f64,
    pub contrast: f64,
}
