//! Stages to commands: puts a barrier before each command that touches what an earlier one wrote, or writes what an
//! earlier one read. Knows no Vulkan, so that the hazards of a whole iteration are tested without a device.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::time::Duration;

use crate::stage::{BufferId, StageDesc};

/// One step of a recording.
#[derive(Debug, Clone)]
pub enum Command {
    /// Launches a stage.
    Dispatch(StageDesc),
    /// Sets every word of a buffer.
    Fill(BufferId, u32),
    /// Reads a buffer's first bytes back to the host, so many at the most.
    ReadBack(BufferId, u64),
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
            Self::ReadBack(buffer, _) => vec![(*buffer, false)],
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

    /// Reads the first bytes of `buffer`, so many at the most, back to the host along with what the launches took.
    pub fn read_back(&mut self, buffer: BufferId, bytes: u64) {
        self.push(Command::ReadBack(buffer, bytes));
    }

    /// Parts of the commands that take no longer than `most_ns` each, where no single launch does. `expected_ns` is what a launch
    /// is expected to take: one of which that isn't known is a part of its own.
    pub fn parts(&self, most_ns: f64, expected_ns: impl Fn(&StageDesc) -> Option<f64>) -> Vec<Range<usize>> {
        let mut parts = Vec::new();
        let (mut begin, mut sum) = (0, 0.0);
        for (i, command) in self.commands.iter().enumerate() {
            let Command::Dispatch(stage) = command else { continue };
            let expected = expected_ns(stage).unwrap_or(most_ns);
            if sum > 0.0 && sum + expected > most_ns {
                parts.push(begin..i);
                (begin, sum) = (i, 0.0);
            }
            sum += expected;
        }
        parts.push(begin..self.commands.len());
        parts
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
    /// From the submission, or the end of the work before, to the fence.
    pub wall: Duration,
}

impl Run {
    /// Adds what came after it.
    pub fn add(&mut self, later: Self) {
        self.launches.extend(later.launches);
        self.wall += later.wall;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders;

    fn recording(launches: &[u32]) -> Recording {
        let mut recording = Recording::new();
        for &threads in launches {
            recording.fill(BufferId::Radii2, 0);
            recording.dispatch(StageDesc::new(&shaders::RADII, threads));
        }
        recording.read_back(BufferId::Status, 4);
        recording
    }

    /// Threads of each part's launches, where a launch takes as many nanoseconds.
    fn parts(launches: &[u32], is_known: impl Fn(u32) -> bool) -> Vec<Vec<u32>> {
        let recording = recording(launches);
        let expected = |stage: &StageDesc| is_known(stage.threads).then(|| f64::from(stage.threads));
        let parts = recording.parts(100.0, expected);
        let mut end = 0;
        for part in &parts {
            assert_eq!(part.start, end, "the parts have each command once, in order");
            end = part.end;
        }
        assert_eq!(end, recording.commands().len());
        let threads = |command: &Command| match command {
            Command::Dispatch(stage) => Some(stage.threads),
            _ => None,
        };
        let of = |part: Range<usize>| recording.commands()[part].iter().filter_map(threads).collect();
        parts.into_iter().map(of).collect()
    }

    #[test]
    fn work_is_parted_where_it_would_take_too_long() {
        assert_eq!(parts(&[], |_| true), [vec![0u32; 0]]);
        assert_eq!(parts(&[40, 60], |_| true), [vec![40, 60]]);
        assert_eq!(
            parts(&[40, 60, 1, 250, 10, 80, 20], |_| true),
            [vec![40, 60], vec![1], vec![250], vec![10, 80], vec![20]]
        );
    }

    #[test]
    fn a_launch_that_was_never_timed_is_alone() {
        assert_eq!(
            parts(&[10, 20, 7, 30, 7, 7], |threads| threads != 7),
            [vec![10, 20], vec![7], vec![30], vec![7], vec![7]]
        );
    }
}
