//! Tests the random numbers of paths: χ² of tuples, within a path and across paths and iterations.

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use ppm_vk::internals::config::Sampler;
use ppm_vk::internals::random::{PathKind, Random};

/// Cells along each axis of the table of 2-, 3- and 4-tuples, as powers of two: some ten thousand cells in all.
const DIGITS: [u32; 3] = [8, 5, 4];
/// Standard deviations beyond which a χ² fails: 2 in 10⁹ of those of random numbers do.
pub const LIMIT: f64 = 6.0;
/// Tuples that a task counts.
const CHUNK: u64 = 1 << 20;

/// The source of the numbers of a tuple.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Across {
    /// One path: its first four numbers.
    Numbers,
    /// Neighbouring paths: the first number of each.
    Paths,
    /// One path in successive iterations: the first number of each.
    Iterations,
}

/// A test's outcome.
#[derive(Debug, Clone, Serialize)]
pub struct ChiSquare {
    /// The generator.
    pub sampler: &'static str,
    /// The source of the tuples.
    pub across: Across,
    /// Numbers of a tuple.
    pub length: usize,
    /// Tuples counted.
    pub tuples: u64,
    /// Distance of χ² from its mean in standard deviations; χ² has enough degrees of freedom to be normal.
    pub deviations: f64,
    /// Whether that is at most [`LIMIT`].
    pub passes: bool,
}

/// All outcomes.
#[derive(Debug, Clone, Serialize)]
pub struct Battery {
    /// Numbers that each test draws.
    pub numbers: u64,
    /// One for each generator and test.
    pub tests: Vec<ChiSquare>,
}

/// Tests the independent generators with this number of numbers each; `note` gets progress messages.
pub fn battery(numbers: u64, seed: u32, note: &dyn Fn(&str)) -> Battery {
    let mut tests = Vec::new();
    for (name, sampler) in [
        ("independent", Sampler::Independent),
        ("congruential", Sampler::Congruential),
    ] {
        for across in [Across::Numbers, Across::Paths, Across::Iterations] {
            let begin = Instant::now();
            for length in 2..=4 {
                let tuples = (numbers / length as u64).max(1);
                let deviations = deviations(sampler, across, length, tuples, seed);
                tests.push(ChiSquare {
                    sampler: name,
                    across,
                    length,
                    tuples,
                    deviations,
                    passes: deviations.abs() <= LIMIT,
                });
            }
            note(&format!("{name} across {across:?}: {:.1} s", begin.elapsed().as_secs_f64()).to_lowercase());
        }
    }
    Battery { numbers, tests }
}

/// χ² of tuples over the cells of a cube, in standard deviations from its mean.
fn deviations(sampler: Sampler, across: Across, length: usize, tuples: u64, seed: u32) -> f64 {
    let digits = DIGITS[length - 2];
    let cells = 1usize << (digits * length as u32);
    let count_chunk = |chunk: u64| {
        let mut counts = vec![0u32; cells];
        for tuple in chunk * CHUNK..((chunk + 1) * CHUNK).min(tuples) {
            let cell = (0..length).fold(0, |cell, i| {
                let number = draw(sampler, across, tuple, i, length, seed);
                cell << digits | (number * f64::from(1u32 << digits)) as usize
            });
            counts[cell] += 1;
        }
        counts
    };
    let counts = (0..tuples.div_ceil(CHUNK))
        .into_par_iter()
        .map(count_chunk)
        .reduce(|| vec![0; cells], |a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect());
    let expected = tuples as f64 / cells as f64;
    let chi_square: f64 = counts
        .iter()
        .map(|&n| (f64::from(n) - expected).powi(2) / expected)
        .sum();
    let freedom = (cells - 1) as f64;
    (chi_square - freedom) / (2.0 * freedom).sqrt()
}

/// The i-th number of a tuple.
fn draw(sampler: Sampler, across: Across, tuple: u64, i: usize, length: usize, seed: u32) -> f64 {
    // No two tuples share a number: tuples follow each other across paths or iterations.
    const PATHS: u64 = 1 << 17;
    let (row, column) = (tuple / PATHS, tuple % PATHS);
    let next = |line: u64| (line * length as u64 + i as u64) as u32;
    let (path, iteration, number) = match across {
        Across::Numbers => (column as u32, row as u32, i),
        Across::Paths => (next(column), row as u32, 0),
        Across::Iterations => (column as u32, next(row), 0),
    };
    Random::with(sampler, PathKind::Photon, path, iteration, seed).next4()[number]
}

/// The battery as a table.
pub fn battery_table(battery: &Battery) -> String {
    let mut text = format!(
        "χ² of tuples of {:.1e} numbers each, in standard deviations from its mean; beyond {LIMIT} it fails\n\n\
         {:<14} {:<12} {:>10} {:>10} {:>10}\n",
        battery.numbers as f64, "generator", "across", "2-tuples", "3-tuples", "4-tuples"
    );
    for row in battery.tests.chunks(3) {
        text += &format!(
            "{:<14} {:<12}",
            row[0].sampler,
            format!("{:?}", row[0].across).to_lowercase()
        );
        for test in row {
            let sign = if test.passes { "" } else { " fails" };
            text += &format!(" {:>10}", format!("{:.1}{sign}", test.deviations));
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eighteen normal deviates; one of them lies beyond 6 with a probability below 10⁻⁷.
    #[test]
    fn independent_numbers_pass_and_the_papers_fail() {
        let battery = battery(4 << 20, 0, &|_| ());
        let failed = |sampler: &str| {
            let of = battery.tests.iter().filter(|test| test.sampler == sampler);
            of.filter(|test| !test.passes).count()
        };
        assert_eq!(failed("independent"), 0, "{}", battery_table(&battery));
        assert!(failed("congruential") >= 3, "{}", battery_table(&battery));
    }
}
