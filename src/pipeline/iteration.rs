//! Running an iteration: batch by batch, with retries if something did not fit.

use bytemuck::Zeroable;

use super::stages::reporting;
use super::{Renderer, Stages};
use crate::backend::Counters;
use crate::config::Totals;
use crate::emission::{counted_paths, is_learned_from};
use crate::error::{Error, Remedy, Result};
use crate::gpu::{Done, Ticket};
use crate::layout::{GATHERS_TOO_LONG, LANES_TOO_LONG, PHOTONS_DID_NOT_FIT, StatusCounters};
use crate::random::CameraTurn;
use crate::record::{Recording, Run};
use crate::stage::BufferId;

/// Maximum number of attempts at an iteration: every second one halves the length of its loops.
const REPEATS: u32 = 24;
/// Maximum duration of an iteration, in nanoseconds, for which the next one is submitted ahead: for longer ones the host's gap is
/// negligible, and a request to stop would wait for both.
const MOST_AHEAD_NS: f64 = 100e6;

/// A submitted iteration of one batch.
pub(super) struct Begun {
    ticket: Ticket,
    added: Totals,
}

/// The result of an iteration, or of its first batches.
pub(super) struct Ended {
    status: StatusCounters,
    /// Totals to add: zero if the iteration was interrupted and is left out.
    added: Totals,
    /// Values of the first paths, if they are learned from.
    values: Vec<u32>,
}

/// Adds the change of the status since `before` to the counters.
fn count(counters: &mut Counters, before: &StatusCounters, now: &StatusCounters) {
    let since = |of: fn(&StatusCounters) -> u32| u64::from(of(now).wrapping_sub(of(before)));
    counters.photons_stored += now.photons_stored() - before.photons_stored();
    counters.photons_landed += now.photons_landed() - before.photons_landed();
    counters.truncated_paths += since(|status| status.truncated_paths);
    counters.cut_paths += since(|status| status.cut_paths);
    counters.non_finite += since(|status| status.non_finite);
    counters.lost_photons += since(|status| status.lost_photons);
    counters.full_cells += since(|status| status.full_cells);
}

fn status_of(done: &Done) -> Result<StatusCounters> {
    let status = done.read(BufferId::Status).first().copied();
    status.ok_or_else(|| Error::Device("the status buffer is empty".to_owned()))
}

impl Renderer {
    /// Runs the recording of `record`; if photons do not fit or loops are cut, enlarges buffers and repeats it. Returns the time
    /// of all attempts, and the status of the last one.
    pub(super) fn run_until_it_fits(
        &mut self,
        record: impl Fn(Stages<'_>) -> Recording,
    ) -> Result<(Run, StatusCounters)> {
        self.retry_until_it_fits(|renderer, all| {
            let (run, status) = renderer.run_reporting(record(renderer.stages()))?;
            all.add(run);
            Ok(status)
        })
    }

    /// Runs a recording that began with [`reporting`]; also returns its status.
    pub(super) fn run_reporting(&mut self, mut recording: Recording) -> Result<(Run, StatusCounters)> {
        self.reported = None;
        let ticket = self.submit(&mut recording)?;
        let done = self.device.finish(ticket)?;
        let status = status_of(&done)?;
        Ok((done.run, status))
    }

    /// Submits a recording that reads its status back.
    fn submit(&mut self, recording: &mut Recording) -> Result<Ticket> {
        recording.read_back(BufferId::Status, u64::MAX);
        self.make_buffers(recording)?;
        self.device.begin(recording)
    }

    /// The same for several recordings: `work` adds their time and returns the status.
    fn retry_until_it_fits(
        &mut self,
        mut work: impl FnMut(&mut Self, &mut Run) -> Result<StatusCounters>,
    ) -> Result<(Run, StatusCounters)> {
        let mut all = Run::default();
        for _ in 0..REPEATS {
            let status = work(self, &mut all)?;
            if status.retry == 0 {
                let [of_lane, of_batch] = self.photon_need;
                self.photon_need = [of_lane.max(status.lane_need), of_batch.max(status.batch_need)];
                return Ok((all, status));
            }
            self.figures.counters.repeated_iterations += 1;
            // The iteration submitted ahead has stopped as well.
            if let Some(begun) = self.ahead.take() {
                all.add(self.device.finish(begun.ticket)?.run);
            }
            self.prepare_retry(&status)?;
        }
        Err(Error::unfit(
            format!("device {} cuts even short loops", self.device.summary().name),
            Remedy::AnotherDevice,
        ))
    }

    /// Before an iteration is repeated: sets the sizes that it needs and clears what it gathered.
    fn prepare_retry(&mut self, status: &StatusCounters) -> Result<()> {
        // With more lanes, the number of photons per lane is estimated again.
        if status.retry & LANES_TOO_LONG != 0 {
            self.sizes.set_lanes(self.sizes.photon_lanes.saturating_mul(2));
        } else if status.retry & PHOTONS_DID_NOT_FIT != 0 {
            self.sizes.grow(status.lane_need, status.batch_need);
        }
        if status.retry & (LANES_TOO_LONG | PHOTONS_DID_NOT_FIT) != 0 {
            self.sizes.shrink_batch(&self.limits);
            self.upload_settings()?;
        }
        if status.retry & GATHERS_TOO_LONG != 0 {
            self.sizes.gather_parts = self.sizes.gather_parts.saturating_mul(2);
        }
        self.clear_gathered()
    }

    pub(super) fn clear_gathered(&mut self) -> Result<()> {
        let mut recording = Recording::new();
        recording.fill(BufferId::GatheredOf, 0);
        self.run(&recording).map(|_| ())
    }

    /// After the first photons, fits their buffers to the required size. Their content is lost.
    pub(super) fn fit_photon_buffers(&mut self) -> Result<()> {
        let [lane_need, batch_need] = self.photon_need;
        if self.fitted || batch_need == 0 {
            return Ok(());
        }
        self.fitted = true;
        self.sizes.fit(lane_need, batch_need);
        self.upload_settings()
    }

    /// Runs an iteration, unless `stop` interrupts it. With `another`, the caller runs another iteration before it requests a
    /// picture, so that one may be submitted ahead.
    pub(super) fn do_iteration(&mut self, stop: &dyn Fn() -> bool, another: bool) -> Result<Option<Run>> {
        let iteration = self.figures.totals.iterations;
        if self.ahead.is_none() {
            self.fit_photon_buffers()?;
            self.begin_block(iteration)?;
        }
        let (mut added, mut values) = (Totals::default(), Vec::new());
        let (run, status) = self.retry_until_it_fits(|renderer, all| {
            let ended = renderer.attempt(iteration, stop, another, all)?;
            (added, values) = (ended.added, ended.values);
            Ok(ended.status)
        })?;
        self.iteration_ns = run.launches.iter().map(|launch| launch.duration_ns).sum();
        if added.emitted == 0 {
            return self.clear_gathered().map(|()| None);
        }
        self.count_iteration(iteration, &status, &values, added);
        Ok(Some(run))
    }

    /// Adds a completed iteration to the totals.
    fn count_iteration(&mut self, iteration: u32, status: &StatusCounters, values: &[u32], added: Totals) {
        let before = self.reported.replace(*status).unwrap_or_else(StatusCounters::zeroed);
        count(&mut self.figures.counters, &before, status);
        self.learn(iteration, values);
        self.figures.totals.add(added);
    }

    /// Completes the iteration that was submitted ahead, before anything else uses the device.
    pub(super) fn complete_ahead(&mut self) -> Result<()> {
        let Some(begun) = self.ahead.take() else { return Ok(()) };
        let iteration = self.figures.totals.iterations;
        let ended = self.end_of(begun, &mut Run::default())?;
        if ended.status.retry == 0 {
            self.count_iteration(iteration, &ended.status, &ended.values, ended.added);
            return Ok(());
        }
        self.clear_gathered()
    }

    /// Attempts an iteration, which may have been submitted ahead.
    fn attempt(&mut self, iteration: u32, stop: &dyn Fn() -> bool, another: bool, all: &mut Run) -> Result<Ended> {
        let begun = match self.ahead.take() {
            Some(begun) => begun,
            None if self.sizes.batches(self.config.photons) == 1 => {
                let recording = self.beginning();
                self.begin_iteration(iteration, recording)?
            }
            None => return self.batches(iteration, stop, all),
        };
        if another && self.may_begin(iteration + 1) {
            // Its stages add to the status of this iteration, and do nothing if this iteration has to be repeated.
            self.ahead = Some(self.begin_iteration(iteration + 1, Recording::new())?);
        }
        self.end_of(begun, all)
    }

    /// Whether an iteration is independent of the host's work after the previous one.
    fn may_begin(&self, iteration: u32) -> bool {
        let aims_anew = self.aim.is_some() && self.config.begins_sequences(iteration);
        self.iteration_ns <= MOST_AHEAD_NS && self.fitted && !aims_anew
    }

    /// An empty recording, whose stages add to the status of the last iteration, or start a new one.
    fn beginning(&self) -> Recording {
        match self.reported {
            Some(_) => Recording::new(),
            None => reporting(),
        }
    }

    /// Submits an iteration of one batch.
    fn begin_iteration(&mut self, iteration: u32, mut recording: Recording) -> Result<Begun> {
        let turn = CameraTurn::that_gathers(&self.config, iteration);
        let stages = self.stages();
        stages.begin(iteration, &mut recording);
        stages.batch(iteration, 0, &mut recording);
        let (ticket, added) = self.submit_end(turn, self.config.photons, recording)?;
        Ok(Begun { ticket, added })
    }

    /// Submits an iteration's last commands, after those in the recording.
    fn submit_end(&mut self, turn: CameraTurn, paths: u32, mut recording: Recording) -> Result<(Ticket, Totals)> {
        self.stages().end(turn, paths, &mut recording);
        if self.aim.is_some() && is_learned_from(&self.config, turn.iteration) {
            let counted = self.sizes.batch_paths.min(counted_paths(turn.iteration));
            recording.read_back(BufferId::PathValues, 4 * u64::from(counted));
        }
        let ticket = self.submit(&mut recording)?;
        let added = Totals {
            iterations: 1,
            emitted: paths.into(),
            camera_paths: turn.paths,
        };
        Ok((ticket, added))
    }

    fn end_of(&mut self, Begun { ticket, added }: Begun, all: &mut Run) -> Result<Ended> {
        let done = self.device.finish(ticket)?;
        let ended = Ended {
            status: status_of(&done)?,
            added,
            values: done.read(BufferId::PathValues),
        };
        all.add(done.run);
        Ok(ended)
    }

    /// Runs an iteration, each batch of photons as a separate submission: drivers reset a device with minutes of work in one
    /// submission, and nothing could interrupt it.
    fn batches(&mut self, iteration: u32, stop: &dyn Fn() -> bool, all: &mut Run) -> Result<Ended> {
        let photons = self.config.photons;
        let batches = self.sizes.batches(photons);
        let mut turn = CameraTurn::that_gathers(&self.config, iteration);
        let mut recording = self.beginning();
        self.stages().begin(iteration, &mut recording);
        let mut paths = photons;
        for batch in 0..batches {
            self.stages().batch(iteration, batch, &mut recording);
            if batch + 1 == batches {
                break;
            }
            let ticket = self.submit(&mut recording)?;
            let ended = self.end_of(
                Begun {
                    ticket,
                    added: Totals::default(),
                },
                all,
            )?;
            recording = Recording::new();
            if ended.status.retry != 0 {
                return Ok(ended);
            }
            if stop() {
                if iteration > 0 {
                    return Ok(ended);
                }
                paths = (batch + 1) * self.sizes.batch_paths;
                // More camera paths could take longer than the interrupted rest.
                turn.paths = 1;
                break;
            }
        }
        let (ticket, added) = self.submit_end(turn, paths, recording)?;
        self.end_of(Begun { ticket, added }, all)
    }
}

#[cfg(test)]
mod tests;
