//! Records stages as commands, with a barrier before each command that uses data that an earlier one wrote, or writes data that
//! an earlier one read. Independent of Vulkan, so that the hazards of a whole iteration are tested without a device.

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
    /// Reads a buffer's first bytes back to the host, up to a maximum.
    ReadBack(BufferId, u64),
    /// Makes every write so far visible to every later command, and keeps those from starting before.
    Barrier,
}

impl Command {
    /// The buffers that the command uses, and whether it writes them.
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

/// A command, or one of the pieces that a long launch is divided into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// The command's place in [`Recording::commands`].
    pub index: usize,
    /// Index of the piece.
    pub place: u32,
    /// Number of pieces.
    pub count: u32,
}

/// Commands in order, barriers included.
#[derive(Debug, Default)]
pub struct Recording {
    commands: Vec<Command>,
    /// Buffers used since the last barrier, and whether they were written.
    pending: HashMap<BufferId, bool>,
}

impl Recording {
    /// An empty recording.
    pub fn new() -> Self {
        Self::default()
    }

    /// Launches a stage; one without invocations is left out.
    pub fn dispatch(&mut self, stage: StageDesc) {
        let expected = stage.shader.push_constants.map_or(0, |block| block.size());
        assert_eq!(
            stage.push.len(),
            expected,
            "bytes of push constants of {}",
            stage.shader.name
        );
        if stage.threads > 0 {
            self.push(Command::Dispatch(stage));
        }
    }

    /// Sets every word of `buffer` to `word`.
    pub fn fill(&mut self, buffer: BufferId, word: u32) {
        self.push(Command::Fill(buffer, word));
    }

    /// Reads the first bytes of `buffer`, up to a maximum, back to the host together with the times of the launches.
    pub fn read_back(&mut self, buffer: BufferId, bytes: u64) {
        self.push(Command::ReadBack(buffer, bytes));
    }

    /// Splits the commands into parts of at most about `most_ns` each; a longer launch is divided among several parts.
    /// `expected_ns` is the expected time of a launch: a launch of unknown time is a separate part.
    pub fn parts(&self, most_ns: f64, expected_ns: impl Fn(&StageDesc) -> Option<f64>) -> Vec<Vec<Piece>> {
        let mut parts = vec![Vec::new()];
        let mut sum = 0.0;
        for (index, command) in self.commands.iter().enumerate() {
            let (expected, count) = match command {
                Command::Dispatch(stage) => {
                    let all = expected_ns(stage).unwrap_or(most_ns);
                    let count = (all / most_ns).ceil().clamp(1.0, f64::from(stage.groups()));
                    (all / count, count as u32)
                }
                _ => (0.0, 1),
            };
            for place in 0..count {
                if sum > 0.0 && sum + expected > most_ns * (1.0 + 1e-9) && expected > 0.0 {
                    parts.push(Vec::new());
                    sum = 0.0;
                }
                sum += expected;
                if let Some(part) = parts.last_mut() {
                    part.push(Piece { index, place, count });
                }
            }
        }
        parts
    }

    /// The commands.
    pub fn commands(&self) -> &[Command] {
        &self.commands
    }

    /// The buffers that the commands use, each once.
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
        // One global barrier is as good as one per buffer: drivers flush caches as a whole.
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

/// The time of a launch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Launch {
    /// The stage.
    pub stage: &'static str,
    /// Begin, in nanoseconds of the device's clock.
    pub begin_ns: f64,
    /// Duration in nanoseconds.
    pub duration_ns: f64,
}

/// Times of a run of a recording.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Its launches in order.
    pub launches: Vec<Launch>,
    /// From the submission, or the end of the work before, to the fence.
    pub wall: Duration,
}

impl Run {
    /// Adds the times of a later run.
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

    /// Threads of each part's launches, where a launch takes as many nanoseconds, over how many pieces they are divided into.
    fn parts(launches: &[u32], is_known: impl Fn(u32) -> bool) -> Vec<Vec<(u32, u32)>> {
        let recording = recording(launches);
        let expected = |stage: &StageDesc| is_known(stage.threads).then(|| f64::from(stage.threads));
        let parts = recording.parts(1000.0, expected);
        let mut next = (0, 0);
        for piece in parts.iter().flatten() {
            assert_eq!(
                (piece.index, piece.place),
                next,
                "each piece of each command comes once, in order"
            );
            let is_last = piece.place + 1 == piece.count;
            next = if is_last {
                (piece.index + 1, 0)
            } else {
                (piece.index, piece.place + 1)
            };
        }
        assert_eq!(next, (recording.commands().len(), 0));
        let launch = |piece: &Piece| match &recording.commands()[piece.index] {
            Command::Dispatch(stage) => Some((stage.threads, piece.count)),
            _ => None,
        };
        parts
            .iter()
            .map(|part| part.iter().filter_map(launch).collect())
            .collect()
    }

    #[test]
    fn work_is_parted_where_it_would_take_too_long() {
        assert_eq!(parts(&[], |_| true), [vec![]]);
        assert_eq!(parts(&[400, 600], |_| true), [vec![(400, 1), (600, 1)]]);
        assert_eq!(
            parts(&[400, 600, 10, 100, 800, 200], |_| true),
            [
                vec![(400, 1), (600, 1)],
                vec![(10, 1), (100, 1), (800, 1)],
                vec![(200, 1)]
            ]
        );
    }

    #[test]
    fn a_launch_that_would_take_too_long_is_divided() {
        assert_eq!(
            parts(&[10, 2500, 100], |_| true),
            [vec![(10, 1), (2500, 3)], vec![(2500, 3)], vec![(2500, 3), (100, 1)]]
        );
    }

    #[test]
    fn no_launch_is_divided_into_more_pieces_than_it_has_workgroups() {
        let recording = recording(&[100]);
        let parts = recording.parts(1.0, |_| Some(1e9));
        let pieces = parts.iter().flatten().filter(|piece| piece.count > 1).count();
        assert_eq!(
            pieces,
            2,
            "100 invocations are two workgroups of {}",
            shaders::RADII.workgroup
        );
    }

    #[test]
    fn a_launch_that_was_never_timed_is_alone() {
        assert_eq!(
            parts(&[10, 20, 7, 30, 7, 7], |threads| threads != 7),
            [
                vec![(10, 1), (20, 1)],
                vec![(7, 1)],
                vec![(30, 1)],
                vec![(7, 1)],
                vec![(7, 1)]
            ]
        );
    }
}
