//! Benches: the gather methods on one device against each other and against the paper, and error against time.
//!
//! All figures of a bench come from one process. Runs of the methods are interleaved, so that other load on the machine affects
//! all of them; times are device timestamps, and of repeated runs the median counts.

mod converge;
mod features;
mod gather;
mod kernels;
mod paper;
mod plot;
mod random;
mod scaling;
mod structure;
mod tables;

pub use converge::{Converge, Curve, converge, converge_table, csv};
pub use features::{feature_costs, features_table};
pub use gather::GatherBench;
pub use kernels::{compiled_kernels, kernels_table};
pub use plot::{plot_convergence, plot_methods, plot_scaling};
pub use random::{battery, battery_table};
pub use scaling::scaling;
pub use structure::cluster_picture;
pub use tables::{scaling_table, tables};

use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::{Error, Result, Session};

/// The stages of a session, one by one.
fn stages_of(session: &mut Session) -> Result<&mut Renderer> {
    let on_cpu = || Error::Config("stages are measured on Vulkan devices only".to_owned());
    session.on_device().ok_or_else(on_cpu)
}

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

/// Slope of the line through the points, in logarithms, by least squares; `None` with fewer than two.
fn log_slope(points: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let (mean_x, mean_y) = (
        logs.iter().map(|log| log.0).sum::<f64>() / count,
        logs.iter().map(|log| log.1).sum::<f64>() / count,
    );
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let variance: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    (logs.len() > 1 && variance > 0.0).then_some(covariance / variance)
}

/// A slope as text.
fn slope_text(slope: Option<f64>) -> String {
    slope.map_or("unknown".to_owned(), |slope| format!("{slope:.2}"))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_slope_of_a_power_is_its_exponent() {
        let points = [1.0, 10.0, 1e3].map(|x: f64| (x, 7.0 * x.powf(1.5)));
        let slope = super::log_slope(points.into_iter()).expect("a slope");
        assert!((slope - 1.5).abs() < 1e-12);
        assert_eq!(super::log_slope(std::iter::once((2.0, 3.0))), None);
    }
}
