//! Pictures and states that are written while a render goes on.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::{Error, Result};

use super::advice;
use super::args::RenderArguments;
use super::outputs::all;
use ppm_vk::{Look, Snapshot, Snapshots};

/// Time from one save to the next where a state is kept.
const DEFAULT_EVERY: Duration = Duration::from_secs(60);

/// The files of a save.
#[derive(Debug, Clone)]
struct Files {
    exr: PathBuf,
    png: Option<PathBuf>,
    look: Look,
    state: Option<PathBuf>,
}

/// Writes snapshots on a thread of its own, so that the render goes on meanwhile.
pub struct Saver {
    every: Duration,
    with_state: bool,
    snapshots: SyncSender<Snapshot>,
    thread: JoinHandle<()>,
}

impl Saver {
    /// For a render with these arguments; `None` if it saves nothing.
    pub fn new(arguments: &RenderArguments, output: &Path) -> Option<Self> {
        let every = arguments
            .save_every
            .or(arguments.state.is_some().then_some(DEFAULT_EVERY))?;
        let files = Files {
            exr: output.to_owned(),
            png: arguments.png.clone(),
            look: arguments.look.into(),
            state: arguments.state.clone(),
        };
        // No queue: a snapshot that comes while the previous one is being written is left out.
        let (snapshots, taken) = sync_channel(0);
        let thread = thread::spawn(move || {
            for snapshot in taken {
                if let Err(error) = files.write(&snapshot) {
                    say!(
                        "warning: {}; the render goes on, and the files are those of the save before",
                        advice::line(&error)
                    );
                }
            }
        });
        Some(Self {
            every,
            with_state: arguments.state.is_some(),
            snapshots,
            thread,
        })
    }

    /// The snapshots that it asks for.
    pub fn snapshots<'a>(&self, take: &'a dyn Fn(Snapshot)) -> Snapshots<'a> {
        Snapshots {
            every: self.every,
            with_state: self.with_state,
            take,
        }
    }

    /// Writes a snapshot, unless the previous one is still being written.
    pub fn save(&self, snapshot: Snapshot) {
        // The thread waits for snapshots until `finish`.
        let _ = self.snapshots.try_send(snapshot);
    }

    /// Waits for the last write.
    pub fn finish(self) {
        drop(self.snapshots);
        // A panic there has been told by its own message.
        let _ = self.thread.join();
    }
}

impl Files {
    fn write(&self, snapshot: &Snapshot) -> Result<()> {
        let rendered = &snapshot.rendered;
        let written = [
            Some(rendered.write_exr(&self.exr)),
            self.png.as_ref().map(|png| rendered.write_png(png, self.look)),
            // Last: pictures are never older than the state.
            self.state
                .as_ref()
                .zip(snapshot.state.as_ref())
                .map(|(file, state)| state.write(file)),
        ];
        all(written
            .into_iter()
            .flatten()
            .map(|written| written.map_err(Error::from)))
    }
}
