//! What happens in a render, told to all who follow it: the progress bar, a script (`--progress json`), a browser (`--serve`).

use std::collections::HashSet;
use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use clap::ValueEnum;
use serde::Serialize;

use ppm_vk::Flicker;
use ppm_vk::internals::text::escaped;

/// The value of `--progress`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressFormat {
    /// A JSON line for each event, on stdout (docs/watching.md).
    Json,
}

/// An event of a render.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A frame of an animation begins.
    Frame(Frame),
    /// A frame is done, and its files are written.
    FrameDone {
        /// Its number.
        frame: u32,
        /// The frame whose picture it has, because nothing moved since.
        same_as: Option<u32>,
        /// Estimated relative error, if known.
        estimated_error: Option<f64>,
        /// How it differs from the frame before it (docs/animation.md), if known.
        flicker: Option<Flicker>,
    },
    /// A phase begins.
    Phase {
        /// The phase.
        phase: Phase,
    },
    /// An iteration is done.
    Iteration(Iteration),
    /// A remark.
    Note {
        /// One line.
        text: String,
    },
    /// A defect, or something that failed while the render goes on.
    Warning {
        /// One line.
        text: String,
    },
    /// A file is written.
    Written {
        /// Its name.
        path: String,
        /// Iterations in it.
        iteration: u32,
    },
    /// The render has failed.
    Error {
        /// One line.
        text: String,
    },
    /// The render has ended, and all files are written.
    Done {
        /// Whether it was interrupted.
        interrupted: bool,
    },
}

/// A frame of an animation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Frame {
    /// Its number.
    pub frame: u32,
    /// Number of the first frame that is rendered.
    pub first: u32,
    /// Number of the last frame that is rendered.
    pub last: u32,
    /// Its time in the scene's animations, in seconds.
    pub time: f64,
}

/// The phases of a render, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// The scene is read.
    Load,
    /// The hierarchy of its triangles is built.
    Build,
    /// The kernels are compiled.
    Compile,
    /// Pilot photons find radii and where photons are needed.
    Pilot,
    /// The picture is rendered.
    Iterate,
    /// The files are written.
    Write,
}

/// The state of a render after an iteration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Iteration {
    /// Iterations done.
    pub iteration: u32,
    /// Number of iterations to do, if that is a limit.
    pub iterations: Option<u32>,
    /// Share of the render that is done.
    pub share: f64,
    /// Seconds of rendering, by this process.
    pub rendering_seconds: f64,
    /// Estimated seconds to its end, if there is a limit.
    pub seconds_left: Option<f64>,
    /// Photon paths emitted.
    pub photons_emitted: u64,
    /// Photon paths emitted per second of rendering.
    pub photons_per_second: f64,
    /// Estimated relative error, if known.
    pub estimated_error: Option<f64>,
}

/// Follows a render.
pub trait Listener: Send + Sync {
    /// Hears of an event, this many seconds after the start of the program.
    fn hear(&self, event: &Event, seconds: f64);
}

/// Tells of events.
pub struct Events {
    start: Instant,
    listeners: Vec<Box<dyn Listener>>,
    /// Remarks that are told once.
    told: Mutex<HashSet<String>>,
}

impl Events {
    /// For these listeners.
    pub fn new(listeners: Vec<Box<dyn Listener>>) -> Self {
        Self {
            start: Instant::now(),
            listeners,
            told: Mutex::default(),
        }
    }

    /// Tells of an event.
    pub fn tell(&self, event: &Event) {
        let seconds = self.start.elapsed().as_secs_f64();
        for listener in &self.listeners {
            listener.hear(event, seconds);
        }
    }

    /// Tells of the beginning of a phase.
    pub fn begin(&self, phase: Phase) {
        self.tell(&Event::Phase { phase });
    }

    /// Tells of a remark, also on stderr.
    pub fn note(&self, text: String) {
        say!("note: {text}");
        self.tell(&Event::Note { text });
    }

    /// The same once, however many frames it is true of.
    pub fn note_once(&self, text: String) {
        if self.is_new(&text) {
            self.note(text);
        }
    }

    /// Tells of a warning once.
    pub fn warning_once(&self, text: String) {
        if self.is_new(&text) {
            self.warning(text);
        }
    }

    /// Whether a text was not asked for before.
    pub fn is_new(&self, text: &str) -> bool {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        told.insert(text.to_owned())
    }

    /// Tells of a warning, also on stderr.
    pub fn warning(&self, text: String) {
        say!("warning: {text}");
        self.tell(&Event::Warning { text });
    }

    /// Tells of a file with a picture or a state of this number of iterations.
    pub fn written(&self, path: &Path, iteration: u32) {
        let path = path.to_string_lossy().into_owned();
        self.tell(&Event::Written { path, iteration });
    }
}

/// Writes a JSON line for each event to stdout.
#[derive(Debug, Default)]
pub struct JsonLines {
    /// Whether nobody reads them any longer.
    closed: AtomicBool,
}

/// A line.
#[derive(Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    event: &'a Event,
    seconds: f64,
}

impl Listener for JsonLines {
    fn hear(&self, event: &Event, seconds: f64) {
        if self.closed.load(Ordering::Relaxed) {
            return;
        }
        let Ok(json) = serde_json::to_string(&Line { event, seconds }) else {
            return;
        };
        let mut stdout = std::io::stdout().lock();
        // Escaped in JSON's own way: still the same value.
        let line = format!("{}\n", escaped(&json));
        if let Err(error) = stdout.write_all(line.as_bytes()).and_then(|()| stdout.flush()) {
            self.closed.store(true, Ordering::Relaxed);
            if error.kind() != ErrorKind::BrokenPipe {
                say!("warning: no more progress is written to stdout: {error}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_one_line_of_snake_case() {
        let event = Event::Iteration(Iteration {
            iteration: 3,
            iterations: Some(4),
            share: 0.75,
            rendering_seconds: 1.5,
            seconds_left: None,
            photons_emitted: 30,
            photons_per_second: 20.0,
            estimated_error: None,
        });
        let line = Line {
            event: &event,
            seconds: 2.0,
        };
        let json = serde_json::to_value(line).expect("JSON");
        let expected = serde_json::json!({
            "event": "iteration", "iteration": 3, "iterations": 4, "share": 0.75, "rendering_seconds": 1.5,
            "seconds_left": null, "photons_emitted": 30, "photons_per_second": 20.0, "estimated_error": null, "seconds": 2.0,
        });
        assert_eq!(json, expected);
    }
}
