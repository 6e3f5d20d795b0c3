//! What a page shows of a render.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::super::events::{Event, Frame, Iteration, Listener, Phase};
use ppm_vk::{Image, Rendered, Snapshot, StageTimes};

/// A browser that asked within this time still shows the page.
const WATCHING: Duration = Duration::from_secs(5);
/// Maximum wait for browsers to fetch the last picture.
const LAST_WAIT: Duration = Duration::from_secs(3);
/// Maximum number of points of the error's curve.
const MAX_POINTS: usize = 1000;
/// Maximum number of warnings.
const MAX_WARNINGS: usize = 50;

/// The state of a render, for all connections.
pub struct Board {
    shown: Mutex<Shown>,
    changed: Condvar,
}

struct Shown {
    title: String,
    /// The frame of an animation.
    frame: Option<Frame>,
    phase: Option<Phase>,
    iteration: Option<Iteration>,
    /// Seconds of rendering and estimated error.
    errors: Vec<[f64; 2]>,
    warnings: Vec<String>,
    picture: Option<Arc<Rendered>>,
    stages: StageTimes,
    /// Number of pictures so far.
    version: u64,
    /// Time that the render spent on them.
    cost: Duration,
    /// How it ended.
    end: Option<&'static str>,
    /// When a browser last asked.
    asked: Option<Instant>,
    /// The last picture that a browser has fetched.
    fetched: u64,
    /// Whether a browser knows of the end.
    is_end_known: bool,
}

impl Board {
    /// For a render by this title.
    pub fn new(title: String) -> Self {
        Self {
            shown: Mutex::new(Shown {
                title,
                frame: None,
                phase: None,
                iteration: None,
                errors: Vec::new(),
                warnings: Vec::new(),
                picture: None,
                stages: StageTimes::default(),
                version: 0,
                cost: Duration::ZERO,
                end: None,
                asked: None,
                fetched: 0,
                is_end_known: false,
            }),
            changed: Condvar::new(),
        }
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a browser shows the page.
    pub fn is_watched(&self) -> bool {
        self.shown().is_watched()
    }

    /// Shows a picture.
    pub fn show(&self, snapshot: &Snapshot) {
        let mut shown = self.shown();
        shown.stages = snapshot.stages.clone();
        shown.cost += snapshot.cost;
        drop(shown);
        self.show_last(&snapshot.rendered);
    }

    /// Shows the last picture.
    pub fn show_last(&self, rendered: &Arc<Rendered>) {
        let mut shown = self.shown();
        shown.picture = Some(rendered.clone());
        shown.version += 1;
    }

    /// Waits until the browsers that show the page have the last picture, for a few seconds at most.
    pub fn wait_for_browsers(&self) {
        let waits = |shown: &mut Shown| shown.is_watched() && !(shown.is_end_known && shown.fetched == shown.version);
        drop(self.changed.wait_timeout_while(self.shown(), LAST_WAIT, waits));
    }

    /// The state as JSON.
    pub fn status(&self) -> Value {
        let mut shown = self.shown();
        shown.asked = Some(Instant::now());
        let picture = shown.picture.as_ref().map(|rendered| {
            let subject = rendered.subject();
            json!({
                "version": shown.version,
                "resolution": subject.resolution,
                "iteration": rendered.iterations(),
                "device": subject.device.name,
            })
        });
        let status = json!({
            "title": shown.title,
            "frame": shown.frame,
            "phase": shown.phase,
            "progress": shown.iteration,
            "picture": picture,
            "errors": shown.errors,
            "snapshot_seconds": shown.cost.as_secs_f64(),
            "stages": shown.stages.stages(),
            "warnings": shown.warnings,
            "end": shown.end,
        });
        shown.is_end_known |= shown.end.is_some();
        self.changed.notify_all();
        status
    }

    /// The picture so far, or its error, and its version.
    pub fn pixels(&self, is_error: bool) -> Option<(u64, Pixels)> {
        let mut shown = self.shown();
        shown.asked = Some(Instant::now());
        let (version, picture) = (shown.version, shown.picture.clone()?);
        // Making them takes a while.
        drop(shown);
        let pixels = if is_error {
            Pixels::of(&picture.pixel_errors()?)
        } else {
            Pixels::of(picture.image())
        };
        Some((version, pixels))
    }

    /// A browser has a picture.
    pub fn fetched(&self, version: u64) {
        let mut shown = self.shown();
        shown.fetched = shown.fetched.max(version);
        self.changed.notify_all();
    }
}

impl Shown {
    fn is_watched(&self) -> bool {
        self.asked.is_some_and(|at| at.elapsed() < WATCHING)
    }

    fn add_error(&mut self, iteration: &Iteration) {
        let Some(error) = iteration.estimated_error else { return };
        if self.errors.last().is_some_and(|[_, last]| *last == error) {
            return;
        }
        self.errors.push([iteration.rendering_seconds, error]);
        if self.errors.len() > MAX_POINTS {
            let mut keeps = false;
            self.errors.retain(|_| {
                keeps = !keeps;
                keeps
            });
        }
    }
}

impl Listener for Arc<Board> {
    fn hear(&self, event: &Event, _: f64) {
        let mut shown = self.shown();
        match event {
            Event::Frame(frame) => {
                shown.frame = Some(*frame);
                shown.iteration = None;
                shown.errors.clear();
            }
            Event::Phase { phase } => shown.phase = Some(*phase),
            Event::Iteration(iteration) => {
                shown.add_error(iteration);
                shown.iteration = Some(iteration.clone());
            }
            Event::Warning { text } if !shown.warnings.contains(text) && shown.warnings.len() < MAX_WARNINGS => {
                shown.warnings.push(text.clone());
            }
            Event::Error { text } => {
                shown.warnings.push(text.clone());
                shown.end = Some("failed");
            }
            Event::Done { interrupted } => shown.end = Some(if *interrupted { "interrupted" } else { "done" }),
            _ => {}
        }
    }
}

/// Linear RGB as half floats.
pub struct Pixels {
    /// Width and height.
    pub size: [usize; 2],
    /// Little-endian, three values per pixel, in rows from the top left.
    pub bytes: Vec<u8>,
}

impl Pixels {
    fn of(image: &Image) -> Self {
        let most = half::f16::MAX.to_f32();
        let values = image.pixels().iter().flatten();
        Self {
            size: [image.width(), image.height()],
            bytes: values
                .flat_map(|value| half::f16::from_f32(value.clamp(-most, most)).to_le_bytes())
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_errors_curve_is_thinned_rather_than_cut() {
        let board = Arc::new(Board::new("test".to_owned()));
        for i in 1..=10 * MAX_POINTS {
            board.hear(
                &Event::Iteration(Iteration {
                    iteration: i as u32,
                    iterations: None,
                    share: 0.0,
                    rendering_seconds: i as f64,
                    seconds_left: None,
                    photons_emitted: 0,
                    photons_per_second: 0.0,
                    estimated_error: Some(1.0 / i as f64),
                }),
                0.0,
            );
        }
        let errors = &board.shown().errors;
        assert!(
            (MAX_POINTS / 2..=MAX_POINTS).contains(&errors.len()),
            "{}",
            errors.len()
        );
        assert_eq!(errors[0][0], 1.0, "the beginning is kept");
        assert!(errors[errors.len() - 1][0] > 9.9 * MAX_POINTS as f64, "and the end");
    }

    #[test]
    fn nobody_is_waited_for_where_nobody_watches() {
        let board = Arc::new(Board::new("test".to_owned()));
        let begin = Instant::now();
        board.wait_for_browsers();
        assert!(!board.is_watched() && begin.elapsed() < Duration::from_secs(1));
        board.status();
        board.hear(&Event::Done { interrupted: false }, 0.0);
        let browser = board.clone();
        let browser = std::thread::spawn(move || browser.status());
        board.wait_for_browsers();
        assert!(
            board.is_watched() && begin.elapsed() < Duration::from_secs(2),
            "the browser knows"
        );
        browser.join().expect("a status");
    }
}
