//! The progress bar: iterations, photons a second, time left; and a sign of life where there is nothing to count.

use std::io::IsTerminal;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::backend::Backend;

/// Iterations from which an estimated error may end a render: fewer have too little to tell it from.
const TRUSTED_FROM: u32 = 16;

/// When a render stops.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// After so many iterations.
    pub iterations: Option<u32>,
    /// After so much time.
    pub time: Option<Duration>,
    /// When the estimated relative error is no larger than this.
    pub error: Option<f64>,
}

impl Limits {
    /// The part of the render that is done, 0 to 1. `error` is the estimated relative error, where there is one.
    pub fn done(&self, iterations: u32, elapsed: Duration, error: Option<f64>) -> f64 {
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

/// A bar on stderr; nothing where stderr is no terminal.
pub struct Progress {
    bar: ProgressBar,
    limits: Limits,
    start: Instant,
}

const STEPS: u64 = 1000;

impl Progress {
    /// A bar for a render that begins now; invisible if `quiet`.
    pub fn new(limits: Limits, quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3} % {msg}") {
            bar.set_style(style);
        }
        Self {
            bar,
            limits,
            start: Instant::now(),
        }
    }

    /// Shows where the render is.
    pub fn show(&self, backend: &dyn Backend, error: Option<f64>) {
        let elapsed = self.start.elapsed();
        let done = self.limits.done(backend.iterations(), elapsed, error);
        self.bar.set_position((done * STEPS as f64) as u64);
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let of = self
            .limits
            .iterations
            .map_or(String::new(), |limit| format!("/{limit}"));
        let left = if done > 0.0 { seconds * (1.0 - done) / done } else { 0.0 };
        let error = error.map_or(String::new(), |error| format!(", error about {:.1} %", 100.0 * error));
        self.bar.set_message(format!(
            "{}{of} iterations{error}, {} photon paths/s, {} left",
            backend.iterations(),
            with_prefix(backend.emitted() as f64 / seconds),
            clock(left)
        ));
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// What a user waits for before a render.
pub const READING: &str = "reading the scene";
pub const BUILDING: &str = "building the hierarchy of its triangles";

/// Work that takes longer than this shows that it goes on.
const PATIENCE: Duration = Duration::from_secs(1);

/// Does `work`, and shows for how long it has been at it once that is more than a second: neither a file's reader nor the
/// hierarchy's builder tells how far it is.
pub fn while_showing<T>(text: &'static str, quiet: bool, work: impl FnOnce() -> T) -> T {
    if quiet || !std::io::stderr().is_terminal() {
        return work();
    }
    let (done, end) = mpsc::channel::<()>();
    thread::scope(|scope| {
        scope.spawn(move || {
            if end.recv_timeout(PATIENCE) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let bar = ProgressBar::new_spinner().with_elapsed(PATIENCE).with_message(text);
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(Duration::from_millis(100));
            // Nothing is ever sent: the channel closes when the work ends, by a panic as well.
            let _ = end.recv();
            bar.finish_and_clear();
        });
        let _done = done;
        work()
    })
}

/// A number with a metric prefix.
pub fn with_prefix(value: f64) -> String {
    match value {
        v if v >= 1e9 => format!("{:.2} G", v * 1e-9),
        v if v >= 1e6 => format!("{:.2} M", v * 1e-6),
        v if v >= 1e3 => format!("{:.0} k", v * 1e-3),
        v => format!("{v:.0} "),
    }
}

fn clock(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m}:{s:02} min"),
        (h, m, _) => format!("{h}:{m:02} h"),
    }
}
