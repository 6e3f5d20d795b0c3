//! Limits and progress of a render.

use std::time::Duration;

/// Minimum number of iterations before an estimated error may end a render: with fewer, the estimate is unreliable.
const TRUSTED_FROM: u32 = 16;

/// The limits of a render: it ends at the first one that is reached. Without limits it continues until it is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Until {
    /// Number of iterations of the session.
    pub iterations: Option<u32>,
    /// Rendering time.
    pub time: Option<Duration>,
    /// When the estimated relative error is no larger than this, from iteration 16 on.
    pub error: Option<f64>,
}

impl Until {
    /// Until the session has done this number of iterations.
    pub fn iterations(count: u32) -> Self {
        Self {
            iterations: Some(count),
            ..Self::default()
        }
    }

    /// For this time.
    pub fn time(time: Duration) -> Self {
        Self {
            time: Some(time),
            ..Self::default()
        }
    }

    /// Until the estimated relative error (root of relMSE) is no larger than this.
    pub fn error(error: f64) -> Self {
        Self {
            error: Some(error),
            ..Self::default()
        }
    }

    /// The share of the render that is done, 0 to 1. `error` is the estimated relative error, if known.
    pub(super) fn done(&self, iterations: u32, elapsed: Duration, error: Option<f64>) -> f64 {
        let by_iterations = self
            .iterations
            .map_or(0.0, |limit| f64::from(iterations) / f64::from(limit));
        let by_time = self
            .time
            .map_or(0.0, |limit| elapsed.as_secs_f64() / limit.as_secs_f64());
        // Errors fall about as the cube root of the iterations.
        let by_error = self
            .error
            .zip(error)
            .filter(|_| iterations >= TRUSTED_FROM)
            .map_or(0.0, |(limit, error)| (limit / error.max(f64::MIN_POSITIVE)).powi(3));
        by_iterations.max(by_time).max(by_error).min(1.0)
    }
}

/// The progress of a render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iterations of the session.
    pub iterations: u32,
    /// Photon paths emitted in them.
    pub photons_emitted: u64,
    /// The estimated relative error, if known.
    pub error: Option<f64>,
    /// The share of the render that is done, 0 to 1; 0 if there are no limits.
    pub done: f64,
}
