//! Benches: the gather methods on one device against each other and against the paper.
//!
//! All figures of a bench come from one process. Methods take turns, so that what else the machine does meets them all;
//! times are device timestamps, and of repeated runs the median counts.

mod gather;
mod paper;
mod plot;
mod scaling;
mod structure;
mod tables;

pub use gather::{GatherBench, MethodResult, ResolutionResult, Results, StepTimes};
pub use plot::{plot_methods, plot_scaling};
pub use scaling::{Point, Scaling, Series, scaling};
pub use structure::{Clusters, Spread, Structure, cluster_picture};
pub use tables::{scaling_table, tables};

/// The middle one of the values, or the mean of the middle two; NaN if there is none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        count if count % 2 == 1 => values[middle],
        _ => 0.5 * (values[middle - 1] + values[middle]),
    }
}
