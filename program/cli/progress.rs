//! The progress bar: iterations, photons per second, remaining time; and a spinner for other work.

use std::io::IsTerminal;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use ppm_vk::{Progress, Until};

/// A bar on stderr; nothing if stderr is no terminal.
pub struct Bar {
    bar: ProgressBar,
    until: Until,
    start: Instant,
}

const STEPS: u64 = 1000;

impl Bar {
    /// A bar for a render that begins now; invisible if `quiet`.
    pub fn new(until: Until, quiet: bool) -> Self {
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
            until,
            start: Instant::now(),
        }
    }

    /// Shows the progress of the render.
    pub fn show(&self, progress: Progress) {
        let Progress {
            iterations,
            photons_emitted,
            error,
            done,
        } = progress;
        self.bar.set_position((done * STEPS as f64) as u64);
        let seconds = self.start.elapsed().as_secs_f64().max(1e-9);
        let of = self.until.iterations.map_or(String::new(), |limit| format!("/{limit}"));
        let left = if done > 0.0 { seconds * (1.0 - done) / done } else { 0.0 };
        let error = error.map_or(String::new(), |error| format!(", error about {:.1} %", 100.0 * error));
        self.bar.set_message(format!(
            "{iterations}{of} iterations{error}, {} photon paths/s, {} left",
            with_prefix(photons_emitted as f64 / seconds),
            clock(left)
        ));
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// What a user waits for before a render.
pub const READING: &str = "reading the scene";
pub const BUILDING: &str = "building the hierarchy of its triangles";

/// Work that takes longer than this shows a spinner.
const PATIENCE: Duration = Duration::from_secs(1);

/// Does `work`, and shows the elapsed time once it is more than a second: neither a file's reader nor the hierarchy's builder
/// reports progress.
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
