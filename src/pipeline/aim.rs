//! Aiming photon paths on a device: see [`crate::emission`].

use super::Renderer;
use super::stages::reporting;
use crate::backend::demand_floor2;
use crate::config::EmissionChoice;
use crate::emission::{Aim, Table, counted_paths};
use crate::error::Result;
use crate::film::Image;
use crate::layout::VisiblePoint;
use crate::packing::PackedScene;
use crate::sizes::Sizes;
use crate::stage::BufferId;

impl Renderer {
    /// The state of aimed photon paths; `None` if paths are not aimed.
    pub fn aim(&self) -> Option<&Aim> {
        self.aim.as_ref()
    }

    /// Aims photon paths by pilot rounds, if configured, at the demand of the current visible points.
    pub(super) fn choose_aim(&mut self, scene: &PackedScene) -> Result<()> {
        if self.config.emission != EmissionChoice::Aimed {
            return Ok(());
        }
        let visible_points: Vec<VisiblePoint> = self.device.download(BufferId::VisiblePoints, None)?;
        let config = self.config.clone();
        let guides = &visible_points[self.sizes.guide_slots()];
        let aim = Aim::by_pilots(&config, scene, guides, |table, iteration| {
            self.upload_table(table)?;
            self.run_until_it_fits(|stages| {
                let mut recording = reporting();
                let paths = stages.sizes.pilot_paths(stages.config.photons);
                stages.trace_paths(iteration, 0..paths, &mut recording);
                recording
            })?;
            self.path_values(iteration, self.sizes.pilot_paths(config.photons))
        })?;
        self.sizes.aimed = aim.is_some();
        if let Some(aim) = &aim {
            self.upload_table(aim.table())?;
        }
        self.aim = aim;
        Ok(())
    }

    /// The emission table changes only when sequences restart, so that learning changes no sequence.
    pub(super) fn begin_block(&mut self, iteration: u32) -> Result<()> {
        if self.aim.is_none() || !self.config.begins_sequences(iteration) {
            return Ok(());
        }
        if iteration > 0 {
            let recording = self.stages().film(self.figures.totals);
            self.run(&recording)?;
            let film: Vec<[f32; 4]> = self.device.download(BufferId::Film, None)?;
            self.settings.demand_floor2 = demand_floor2(&self.seen_by_guides(&film));
            self.upload_settings()?;
        }
        let Some(mut aim) = self.aim.take() else { return Ok(()) };
        aim.update();
        self.upload_table(aim.table())?;
        self.aim = Some(aim);
        Ok(())
    }

    /// The picture of the guides alone.
    fn seen_by_guides(&self, film: &[[f32; 4]]) -> Image {
        let Sizes { region, guides, .. } = self.sizes;
        if guides.slots() == 0 {
            return Image::from_film(region.size, film);
        }
        let of_guides = (0..).zip(&film[region.pixels() as usize..]);
        let seen: Vec<[f32; 4]> = of_guides
            .filter_map(|(slot, &pixel)| guides.has(slot).then_some(pixel))
            .collect();
        Image::from_film([seen.len() as u32, 1], &seen)
    }

    /// Learns from the values of an iteration's first paths.
    pub(super) fn learn(&mut self, iteration: u32, values: &[u32]) {
        if let Some(aim) = &mut self.aim
            && !values.is_empty()
        {
            aim.learn(&self.config, iteration, 0, values);
        }
    }

    /// The values of an iteration's first paths; the first batch has this number of them.
    fn path_values(&mut self, iteration: u32, paths: u32) -> Result<Vec<u32>> {
        let count = paths.min(counted_paths(iteration)) as usize;
        self.device.download(BufferId::PathValues, Some(count))
    }

    pub(super) fn upload_table(&mut self, table: &Table) -> Result<()> {
        let mut texels = table.texels();
        // With its maximum size.
        let bytes = self.sizes.bytes(BufferId::EmissionTable).unwrap_or_default();
        assert!(
            texels.len() * size_of::<[u32; 4]>() <= bytes as usize,
            "more cells than sources and targets can have"
        );
        texels.resize(bytes as usize / size_of::<[u32; 4]>(), [0; 4]);
        self.device.upload(BufferId::EmissionTable, &texels)
    }
}
