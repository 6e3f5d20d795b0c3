//! Stages to commands: puts a barrier before each command that touches what an earlier one wrote, or writes what an
//! earlier one read. Knows no Vulkan, so that the hazards of a whole iteration are tested without a device.

use std::collections::{BTreeSet, HashMap};
use std::time::Duration;

use crate::stage::{BufferId, StageDesc};

/// One step of a recording.
#[derive(Debug, Clone)]
pub enum Command {
    /// Launches a stage.
    Dispatch(StageDesc),
    /// Sets every word of a buffer.
    Fill(BufferId, u32),
    /// Makes every write so far visible to every later command, and keeps those from starting before.
    Barrier,
}

impl Command {
    /// The buffers that the command touches, and whether it writes them.
    pub fn touches(&self) -> Vec<(BufferId, bool)> {
        match self {
            Self::Dispatch(stage) => stage
                .uses()
                .map(|(_, buffer, access)| (buffer, access.writes()))
                .collect(),
            Self::Fill(buffer, _) => vec![(*buffer, true)],
            Self::Barrier => Vec::new(),
        }
    }
}

/// Commands in order, barriers included.
#[derive(Debug, Default)]
pub struct Recording {
    commands: Vec<Command>,
    /// Buffers touched since the last barrier, and whether they were written.
    pending: HashMap<BufferId, bool>,
}

impl Recording {
    /// An empty recording.
    pub fn new() -> Self {
        Self::default()
    }

    /// Launches a stage; one without invocations is left out.
    pub fn dispatch(&mut self, stage: StageDesc) {
        if stage.threads > 0 {
            self.push(Command::Dispatch(stage));
        }
    }

    /// Sets every word of `buffer` to `word`.
    pub fn fill(&mut self, buffer: BufferId, word: u32) {
        self.push(Command::Fill(buffer, word));
    }

    /// The commands.
    pub fn commands(&self) -> &[Command] {
        &self.commands
    }

    /// The buffers that the commands touch, each once.
    pub fn buffers(&self) -> BTreeSet<BufferId> {
        let touches = self.commands.iter().flat_map(Command::touches);
        touches.map(|(buffer, _)| buffer).collect()
    }

    fn push(&mut self, command: Command) {
        let touches = command.touches();
        let hazard = touches.iter().any(|(buffer, writes)| match self.pending.get(buffer) {
            Some(written) => *writes || *written,
            None => false,
        });
        // One global barrier serves as well as one a buffer: drivers flush caches as a whole.
        if hazard {
            self.commands.push(Command::Barrier);
            self.pending.clear();
        }
        for (buffer, writes) in touches {
            *self.pending.entry(buffer).or_default() |= writes;
        }
        self.commands.push(command);
    }
}

/// When a launch of a stage ran.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Launch {
    /// The stage.
    pub stage: &'static str,
    /// Begin, in nanoseconds of the device's clock.
    pub begin_ns: f64,
    /// Nanoseconds that it took.
    pub duration_ns: f64,
}

/// What a run of a recording took.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Its launches in order.
    pub launches: Vec<Launch>,
    /// From the submission to the fence.
    pub wall: Duration,
}

impl Run {
    /// Adds what came after it.
    pub fn add(&mut self, later: Self) {
        self.launches.extend(later.launches);
        self.wall += later.wall;
    }
}
