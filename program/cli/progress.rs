//! The progress bar: iterations, photons per second, remaining time; and a spinner for other work.

use std::io::IsTerminal;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::events::{Event, Frame, Iteration, Listener, Phase};
use ppm_vk::{Progress, Session, Until};

/// Measures a render.
pub struct Meter {
    until: Until,
    start: Instant,
    /// Iterations and photon paths before the start.
    iterations: u32,
    emitted: u64,
}

impl Meter {
    /// Of a render that begins now.
    pub fn new(until: Until, session: &Session) -> Self {
        Self {
            until,
            start: Instant::now(),
            iterations: session.iterations(),
            emitted: session.photons_emitted(),
        }
    }

    /// The state after an iteration.
    pub fn measure(&self, progress: Progress) -> Iteration {
        let seconds = self.start.elapsed().as_secs_f64().max(1e-9);
        let of_before = |limit| f64::from(self.iterations) / f64::from(limit);
        let before = self.until.iterations.map_or(0.0, of_before);
        let done = progress.done - before;
        let emitted = progress.photons_emitted.saturating_sub(self.emitted);
        Iteration {
            iteration: progress.iterations,
            iterations: self.until.iterations,
            share: progress.done,
            rendering_seconds: seconds,
            seconds_left: (done > 0.0).then(|| seconds * (1.0 - progress.done) / done),
            photons_emitted: progress.photons_emitted,
            photons_per_second: emitted as f64 / seconds,
            estimated_error: progress.error,
        }
    }
}

/// A bar on stderr; nothing if stderr is no terminal.
pub struct Bar {
    bar: ProgressBar,
    /// The frame of an animation.
    frame: Mutex<Option<Frame>>,
}

const STEPS: u64 = 1000;

impl Bar {
    /// A bar that appears with the first iteration; never if `quiet`.
    pub fn new(quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3} % {msg}") {
            bar.set_style(style);
        }
        let frame = Mutex::default();
        Self { bar, frame }
    }

    fn show(&self, state: &Iteration) {
        self.bar.set_position((state.share * STEPS as f64) as u64);
        let of = state.iterations.map_or(String::new(), |limit| format!("/{limit}"));
        let error = state
            .estimated_error
            .map_or(String::new(), |error| format!(", error about {:.1} %", 100.0 * error));
        let left = state
            .seconds_left
            .map_or(String::new(), |left| format!(", {} left", clock(left)));
        let frame = *self.frame.lock().unwrap_or_else(PoisonError::into_inner);
        let frame = frame.map_or(String::new(), |frame| {
            format!("frame {} of {}..{}: ", frame.frame, frame.first, frame.last)
        });
        self.bar.set_message(format!(
            "{frame}{}{of} iterations{error}, {} photon paths/s{left}",
            state.iteration,
            with_prefix(state.photons_per_second),
        ));
    }
}

impl Listener for Bar {
    fn hear(&self, event: &Event, _: f64) {
        match event {
            Event::Iteration(state) => self.show(state),
            Event::Frame(frame) => {
                *self.frame.lock().unwrap_or_else(PoisonError::into_inner) = Some(*frame);
                self.bar.reset();
            }
            Event::Phase { phase: Phase::Write } | Event::Error { .. } => self.bar.finish_and_clear(),
            _ => {}
        }
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
