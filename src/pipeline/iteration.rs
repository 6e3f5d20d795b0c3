//! Running an iteration: batch by batch, and again where something didn't fit.

use super::{Renderer, Stages};
use crate::config::Totals;
use crate::error::{Error, Result};
use crate::layout::{GATHERS_TOO_LONG, LANES_TOO_LONG, PHOTONS_DID_NOT_FIT, StatusCounters};
use crate::random::CameraTurn;
use crate::record::{Recording, Run};
use crate::stage::BufferId;

/// How often an iteration is done at the most: every other time halves what its loops have to do.
const REPEATS: u32 = 24;

impl Renderer {
    /// Runs what `record` says; where photons don't fit or loops are cut, makes room and does it again. Returns what all
    /// of it took, and what the last run reported.
    pub(super) fn run_until_it_fits(
        &mut self,
        record: impl Fn(Stages<'_>) -> Recording,
    ) -> Result<(Run, StatusCounters)> {
        self.do_until_it_fits(|renderer, all| {
            all.add(renderer.run(&record(renderer.stages()))?);
            renderer.status()
        })
    }

    /// The same of what is more than one recording: `work` adds what it took and returns the status.
    pub(super) fn do_until_it_fits(
        &mut self,
        mut work: impl FnMut(&mut Self, &mut Run) -> Result<StatusCounters>,
    ) -> Result<(Run, StatusCounters)> {
        let mut all = Run::default();
        for _ in 0..REPEATS {
            let status = work(self, &mut all)?;
            if status.again == 0 {
                let [of_lane, of_batch] = self.photon_need;
                self.photon_need = [of_lane.max(status.lane_need), of_batch.max(status.batch_need)];
                return Ok((all, status));
            }
            self.counters.repeated_iterations += 1;
            self.make_room(&status)?;
        }
        Err(Error::Device(format!(
            "device {} cuts loops however small their parts; use another --device or --backend cpu",
            self.device.summary().name
        )))
    }

    /// After an iteration that has to be done again: sizes that it needs, and what it gathered forgotten.
    fn make_room(&mut self, status: &StatusCounters) -> Result<()> {
        // Dealt anew, the lanes' photons are estimated anew.
        if status.again & LANES_TOO_LONG != 0 {
            self.sizes.set_lanes(self.sizes.photon_lanes.saturating_mul(2));
        } else if status.again & PHOTONS_DID_NOT_FIT != 0 {
            self.sizes.grow(status.lane_need, status.batch_need);
        }
        if status.again & (LANES_TOO_LONG | PHOTONS_DID_NOT_FIT) != 0 {
            self.sizes.shrink_batch(&self.limits);
            self.upload_settings()?;
        }
        if status.again & GATHERS_TOO_LONG != 0 {
            self.sizes.gather_parts = self.sizes.gather_parts.saturating_mul(2);
        }
        self.forget_gathered()
    }

    pub(super) fn forget_gathered(&mut self) -> Result<()> {
        let mut recording = Recording::new();
        recording.fill(BufferId::GatheredOf, 0);
        self.run(&recording).map(|_| ())
    }

    /// Once photons have been traced, makes their buffers as large as those need. Their content is lost.
    pub(super) fn fit_photon_buffers(&mut self) -> Result<()> {
        let [lane_need, batch_need] = self.photon_need;
        if self.fitted || batch_need == 0 {
            return Ok(());
        }
        self.fitted = true;
        self.sizes.fit(lane_need, batch_need);
        self.upload_settings()
    }

    /// Runs an iteration, each batch of photons by itself: a device that is given minutes of work at once is taken for dead,
    /// and nothing could stop it. Returns the last status, and what counts: nothing where the iteration was cut short and is left
    /// out.
    pub(super) fn batches(
        &mut self,
        iteration: u32,
        stop: &dyn Fn() -> bool,
        all: &mut Run,
    ) -> Result<(StatusCounters, Totals)> {
        let photons = self.config.photons;
        let batches = self.sizes.batches(photons);
        let mut turn = CameraTurn::that_gathers(&self.config, iteration);
        let mut recording = self.stages().begin(iteration);
        let mut paths = photons;
        for batch in 0..batches {
            self.stages().batch(iteration, batch, &mut recording);
            if batch + 1 == batches {
                break;
            }
            all.add(self.run(&recording)?);
            recording = Recording::new();
            let status = self.status()?;
            if status.again != 0 {
                return Ok((status, Totals::default()));
            }
            if stop() {
                if iteration > 0 {
                    return Ok((status, Totals::default()));
                }
                paths = (batch + 1) * self.sizes.batch_paths;
                // More camera paths could take longer than what was cut.
                turn.paths = 1;
                break;
            }
        }
        self.stages().end(turn, paths, &mut recording);
        all.add(self.run(&recording)?);
        let added = Totals {
            iterations: 1,
            emitted: paths.into(),
            camera_paths: turn.paths,
        };
        Ok((self.status()?, added))
    }
}
