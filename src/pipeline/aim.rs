//! Aiming photon paths on a device: see [`crate::emission`].

use super::Renderer;
use super::stages::reporting;
use crate::backend::demand_floor2;
use crate::config::EmissionChoice;
use crate::emission::{Aim, PILOT_ROUNDS, counted_paths, pilot_iteration};
use crate::error::Result;
use crate::layout::VisiblePoint;
use crate::scene::PackedScene;
use crate::stage::BufferId;

impl Renderer {
    /// Where photon paths start that are aimed; `None` for those that aren't.
    pub fn aim(&self) -> Option<&Aim> {
        self.aim.as_ref()
    }

    /// Aims photon paths by pilot rounds, if they are to be aimed, at what the visible points at hand want.
    pub(super) fn choose_aim(&mut self, scene: &PackedScene) -> Result<()> {
        if self.config.emission != EmissionChoice::Aimed {
            return Ok(());
        }
        let visible_points: Vec<VisiblePoint> = self.device.download(BufferId::VisiblePoints, None)?;
        self.aim = Some(Aim::new(scene, &visible_points));
        self.upload_table()?;
        for round in 0..PILOT_ROUNDS {
            let iteration = pilot_iteration(round);
            self.run_until_it_fits(|stages| {
                let mut recording = reporting();
                let paths = stages.sizes.pilot_paths(stages.config.photons);
                stages.trace_paths(iteration, 0..paths, &mut recording);
                recording
            })?;
            self.learn(iteration, self.sizes.pilot_paths(self.config.photons))?;
            if round + 1 < PILOT_ROUNDS {
                self.update_aim()?;
            }
        }
        if self.config.aims_anyway || self.aim.as_ref().is_some_and(Aim::is_worth_it) {
            self.update_aim()
        } else {
            self.aim = None;
            self.sizes.aimed = false;
            Ok(())
        }
    }

    /// Where sequences begin anew paths may be aimed anew: what an iteration learns changes no sequence.
    pub(super) fn begin_block(&mut self, iteration: u32) -> Result<()> {
        if self.aim.is_none() || !self.config.begins_sequences(iteration) {
            return Ok(());
        }
        if iteration > 0 {
            let (_, resolved) = self.picture()?;
            self.settings.demand_floor2 = demand_floor2(&resolved);
            self.upload_settings()?;
        }
        self.update_aim()
    }

    /// Learns from the first of an iteration's paths, of which the first batch has had so many.
    pub(super) fn learn(&mut self, iteration: u32, paths: u32) -> Result<()> {
        if let Some(aim) = &mut self.aim {
            let count = paths.min(counted_paths(iteration)) as usize;
            let values: Vec<u32> = self.device.download(BufferId::PathValues, Some(count))?;
            aim.learn(&self.config, iteration, 0, &values);
        }
        Ok(())
    }

    fn update_aim(&mut self) -> Result<()> {
        let Some(aim) = &mut self.aim else { return Ok(()) };
        aim.update();
        self.upload_table()
    }

    fn upload_table(&mut self) -> Result<()> {
        let Some(aim) = &self.aim else { return Ok(()) };
        let mut texels = aim.table().texels();
        // As large as it may become.
        let bytes = self.sizes.bytes(BufferId::EmissionTable).unwrap_or_default();
        assert!(
            texels.len() * size_of::<[u32; 4]>() <= bytes as usize,
            "more cells than sources and targets can have"
        );
        texels.resize(bytes as usize / size_of::<[u32; 4]>(), [0; 4]);
        self.device.upload(BufferId::EmissionTable, &texels)
    }
}
