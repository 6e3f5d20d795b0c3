//! Pictures and states that are written while a render goes on.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::{Error, Result};

use super::advice;
use super::args::RenderArguments;
use super::events::Events;
use super::frames::RenderFiles;
use super::outputs::{PictureFiles, all};
use super::takers::{Mailbox, Pace, Taker};
use ppm_vk::{Rendered, Snapshot, Wanted};

/// Time from one save to the next where a state is kept.
const DEFAULT_EVERY: Duration = Duration::from_secs(60);

/// The files of a save.
#[derive(Debug, Clone)]
struct Files {
    pictures: PictureFiles,
    state: Option<PathBuf>,
}

/// Writes snapshots on a thread of its own, so that the render goes on meanwhile.
pub struct Saver {
    pace: Pace,
    wanted: Wanted,
    snapshots: Arc<Mailbox<Snapshot>>,
    thread: JoinHandle<()>,
}

impl Saver {
    /// For a render with these arguments; `None` if it saves nothing.
    pub fn new(arguments: &RenderArguments, files: &RenderFiles, events: &Arc<Events>) -> Option<Self> {
        let every = arguments
            .save_every
            .or(files.state.is_some().then_some(DEFAULT_EVERY))?;
        let wanted = if files.state.is_some() {
            Wanted::State
        } else {
            Wanted::Picture
        };
        let files = Files {
            pictures: arguments.picture_files(files),
            state: files.state.clone(),
        };
        let snapshots = Arc::new(Mailbox::default());
        let (incoming, events) = (snapshots.clone(), events.clone());
        let thread = thread::spawn(move || {
            while let Some(snapshot) = incoming.next() {
                if let Err(error) = files.write(&snapshot, &events) {
                    events.warning(format!(
                        "{}; the render goes on, and the files are those of the save before",
                        advice::line(&error)
                    ));
                }
            }
        });
        Some(Self {
            pace: Pace::every(every),
            wanted,
            snapshots,
            thread,
        })
    }
}

impl Taker for Saver {
    fn wants(&self) -> Option<Wanted> {
        (self.pace.is_due() && self.snapshots.is_awaited()).then_some(self.wanted)
    }

    fn take(&self, snapshot: &Snapshot) {
        self.pace.taken(snapshot.cost);
        self.snapshots.put(snapshot.clone());
    }

    /// Waits for the last write: the last picture is written after it.
    fn end(self: Box<Self>, _: Option<&Arc<Rendered>>) {
        self.snapshots.close();
        // A panic there has been told by its own message.
        let _ = self.thread.join();
    }
}

impl Files {
    fn write(&self, snapshot: &Snapshot, events: &Events) -> Result<()> {
        let iterations = snapshot.rendered.iterations();
        let mut written = self
            .pictures
            .write(&snapshot.rendered, |file| events.written(file, iterations));
        // Last: pictures are never older than the state.
        if let Some((file, state)) = self.state.as_deref().zip(snapshot.state.as_ref()) {
            let state = state.write(file).map(|()| events.written(file, iterations));
            written.push(state.map_err(Error::from));
        }
        all(written)
    }
}
