//! Barriers of recorded commands, checked independently and without a device: between two commands that touch the same buffer,
//! and at least one of which writes it, there must be a barrier.

use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::layout::VISIBLE_LOBES;
use ppm_vk::internals::packing::SceneFeatures;
use ppm_vk::internals::pipeline::Stages;
use ppm_vk::internals::random::CameraTurn;
use ppm_vk::internals::record::{Command, Recording};
use ppm_vk::internals::shaders;
use ppm_vk::internals::sizes::{Limits, Sizes};
use ppm_vk::internals::stage::{BufferId, StageDesc};

/// Pairs of commands (by index) that conflict without a barrier between them.
fn unprotected(commands: &[Command]) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (first, earlier) in commands.iter().enumerate() {
        for (second, later) in commands.iter().enumerate().skip(first + 1) {
            if matches!(later, Command::Barrier) {
                break;
            }
            let conflict = earlier.touches().iter().any(|(buffer, writes)| {
                later
                    .touches()
                    .iter()
                    .any(|(other, other_writes)| buffer == other && (*writes || *other_writes))
            });
            if conflict {
                pairs.push((first, second));
            }
        }
    }
    pairs
}

fn iterations(photons: u32, storage_buffer_bytes: u64) -> Vec<(String, Recording)> {
    let mut recordings = Vec::new();
    let methods = METHODS
        .iter()
        .enumerate()
        .filter(|(_, method)| method.stages().is_some());
    // With one photon map, and with two.
    for ((index, method), specular) in methods.flat_map(|method| [(method, false), (method, true)]) {
        let config = RenderConfig {
            resolution: [320, 280],
            gather: Some(index),
            photons,
            ..RenderConfig::default()
        };
        let limits = Limits {
            specular,
            storage_buffer_bytes,
            loop_limit: u32::MAX,
            clustered_run: 8,
            lanes: 4096,
            splitting: true,
            lobes: [true; VISIBLE_LOBES.len()],
            meshes: 9,
            object_cells: 9 * 1024,
        };
        let sizes = Sizes::new(&config, limits);
        let stages = Stages {
            config: &config,
            sizes: &sizes,
            features: SceneFeatures::ALL,
        };
        recordings.push((format!("{}, specular: {specular}", method.name), stages.iteration(1)));
    }
    recordings
}

#[test]
fn no_command_of_an_iteration_races_with_another() {
    for (method, recording) in iterations(100_000, 128 << 20) {
        let pairs = unprotected(recording.commands());
        assert!(
            pairs.is_empty(),
            "{method}: commands {pairs:?} touch one buffer without a barrier between them"
        );
    }
}

#[test]
fn no_command_races_where_an_iteration_is_done_in_batches() {
    for (method, recording) in iterations(3_000_000, 16 << 20) {
        let pairs = unprotected(recording.commands());
        assert!(
            pairs.is_empty(),
            "{method}: commands {pairs:?} touch one buffer without a barrier between them"
        );
    }
}

#[test]
fn a_missing_barrier_is_found() {
    let (_, recording) = iterations(100_000, 128 << 20).pop().expect("a method");
    let barriers = recording
        .commands()
        .iter()
        .filter(|command| matches!(command, Command::Barrier))
        .count();
    assert!(barriers > 5, "{barriers} barriers in an iteration");
    let without: Vec<Command> = recording
        .commands()
        .iter()
        .filter(|command| !matches!(command, Command::Barrier))
        .cloned()
        .collect();
    assert!(
        !unprotected(&without).is_empty(),
        "the check passes without any barrier: it checks nothing"
    );
}

#[test]
fn stages_that_share_no_written_buffer_run_without_a_barrier() {
    let mut recording = Recording::new();
    recording.fill(BufferId::Status, 0);
    recording.fill(BufferId::DirectSums, 0);
    assert_eq!(recording.commands().len(), 2);
    recording.dispatch(
        StageDesc::new(&shaders::DIRECT, 64)
            .push(shaders::CameraTurnPush::from(CameraTurn::FIRST))
            .bind(vec![(BufferId::SequenceSums, BufferId::Sequence0Sums)]),
    );
    assert_eq!(recording.commands().len(), 4, "a write before a read needs one barrier");
}
