//! Counts how many comparisons agree, and describes those that differ.

use std::fmt::Display;

/// Counts comparisons.
#[derive(Default)]
pub struct Agreement {
    compared: usize,
    differing: usize,
    first: String,
}

/// Maximum number of differences in a message.
const SHOWN: usize = 3;

impl Agreement {
    /// Counts a comparison; `what` describes it if it failed.
    pub fn note<T: Display>(&mut self, agrees: bool, what: impl FnOnce() -> T) {
        self.compared += 1;
        if !agrees {
            self.differing += 1;
            if self.differing <= SHOWN {
                self.first += &format!("\n  {}", what());
            }
        }
    }

    /// Fails if too few agreed, or if there were too few comparisons.
    pub fn assert(&self, what: &str, least_share: f64, least_compared: usize) {
        let share = (self.compared - self.differing) as f64 / self.compared.max(1) as f64;
        println!(
            "{what}: {} of {} differ ({:.4} % agree){}",
            self.differing,
            self.compared,
            share * 100.0,
            self.first
        );
        assert!(
            self.compared >= least_compared,
            "{what}: only {} compared, {least_compared} expected: does the scene still show what the test is about?",
            self.compared
        );
        assert!(
            share >= least_share,
            "{what}: {} of {} differ, {} % must agree; the first:{}",
            self.differing,
            self.compared,
            least_share * 100.0,
            self.first
        );
    }
}

/// |a − b| over the larger magnitude; 0 for two zeros.
pub fn relative_difference(a: f64, b: f64) -> f64 {
    if a == b {
        0.0
    } else {
        (a - b).abs() / a.abs().max(b.abs())
    }
}
