//! When a render ends, and how far it is.

use std::time::Duration;

/// Iterations from which an estimated error may end a render: fewer have too little to tell it from.
const TRUSTED_FROM: u32 = 16;

/// When a render ends: at the first limit that is reached. Without any it goes on until it is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Until {
    /// After so many iterations of the session.
    pub iterations: Option<u32>,
    /// After so much time.
    pub time: Option<Duration>,
    /// When the estimated relative error is no larger than this, from iteration 16 on.
    pub error: Option<f64>,
}

impl Until {
    /// Until the session has had so many iterations.
    pub fn iterations(count: u32) -> Self {
        Self {
            iterations: Some(count),
            ..Self::default()
        }
    }

    /// For so long.
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

    /// The part of the render that is done, 0 to 1. `error` is the estimated relative error, where there is one.
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

/// How far a render is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iterations of the session.
    pub iterations: u32,
    /// Photon paths emitted in them.
    pub photons_emitted: u64,
    /// The estimated relative error, where there is one.
    pub error: Option<f64>,
    /// The part of the render that is done, 0 to 1; 0 where nothing but the user ends it.
    pub done: f64,
}
