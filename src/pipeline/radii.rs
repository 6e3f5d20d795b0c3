//! Preparation of the first iteration: visible points, aiming of photon paths, radii.

use super::Renderer;
use super::saved::sums;
use super::stages::reporting;
use crate::backend::Counters;
use crate::error::Result;
use crate::layout::{Photon, Statistics, StatusCounters, VisiblePoint};
use crate::packing::PackedScene;
use crate::random::CameraTurn;
use crate::record::Recording;
use crate::stage::{BufferId, StageDesc};
use crate::{radius, shaders};

impl Renderer {
    /// Finds the first visible points, aims photon paths at the demand of the guides' pilot discs, and finds the radii: the user's, or
    /// initial radii from the density of pilot photons, first for the median visible point, then smaller ones where photons are
    /// denser. Resets the statistics.
    pub(super) fn prepare(&mut self, scene: &PackedScene) -> Result<()> {
        self.reset()?;
        self.run_until_it_fits(|stages| {
            let mut recording = reporting();
            stages.camera(CameraTurn::FIRST, &mut recording);
            let (order, _) = stages.method();
            order(stages.sizes, &mut recording);
            stages.radii(&mut recording);
            stages.demand_of_guides(&mut recording);
            recording
        })?;
        self.choose_aim(scene)?;
        if self.config.radius.is_none() {
            let mut status = self.trace_pilot_photons()?;
            let photons = self.first_radii()?;
            if self.sizes.guides.slots() > 0 {
                // Those that guides want have told what all share; each pixel's own radius needs those that it wants.
                self.reset()?;
                self.run_until_it_fits(|stages| {
                    let mut recording = reporting();
                    stages.radii(&mut recording);
                    stages.demand(0, &mut recording);
                    recording
                })?;
                status = self.trace_pilot_photons()?;
            }
            let (landed, kept) = (status.photons_landed(), status.photons_stored());
            self.config.drop_unwanted &= radius::is_dropping_worth_it(landed, kept, self.aim.is_some());
            self.reset()?;
            self.fit_radii(photons)?;
            self.scale_radii()?;
        }
        let statistics: Vec<Statistics> = self
            .device
            .download(BufferId::StatisticsOf, Some(self.sizes.slots() as usize))?;
        self.figures.radius = radius::median(&statistics[self.sizes.guide_slots()]);
        self.figures.counters = Counters::default();
        Ok(())
    }

    fn trace_pilot_photons(&mut self) -> Result<StatusCounters> {
        let (_, status) = self.run_until_it_fits(|stages| {
            let mut recording = reporting();
            stages.photons(radius::PILOT, 0, &mut recording);
            recording
        })?;
        Ok(status)
    }

    /// Finds the first radii in footprints from the current pilot photons. Returns the number of photons of each map that a
    /// visible point should accept of a pilot's.
    fn first_radii(&mut self) -> Result<[f32; 2]> {
        let visible_points: Vec<VisiblePoint> = self.device.download(BufferId::VisiblePoints, None)?;
        let footprints: Vec<f32> = self.device.download(BufferId::Footprints, None)?;
        let count: Vec<u32> = self.device.download(BufferId::PhotonCount, Some(1))?;
        let photons: Vec<Photon> = self.device.download(BufferId::Photons, Some(count[0] as usize))?;
        // The pilot is a batch; the densities of the whole iteration's photons are higher.
        let share = self.sizes.batch_paths as f32 / self.config.photons as f32;
        self.figures.photon_flux = radius::mean_flux(&photons);
        let guides = self.sizes.guide_slots();
        let points = &visible_points[guides.clone()];
        let first = radius::first(points, &footprints[guides], &photons, share);
        self.settings.first_footprints = first.map(|first| first.footprints);
        self.upload_settings()?;
        Ok(first.map(|first| first.photons as f32 * share))
    }

    /// Shrinks the first radii where the current pilot photons are denser than `wanted`, a number of photons for each map.
    fn fit_radii(&mut self, wanted: [f32; 2]) -> Result<()> {
        for _ in 0..radius::FITS {
            self.run_until_it_fits(|stages| {
                let mut recording = reporting();
                stages.radii(&mut recording);
                let (_, gather) = stages.method();
                gather(stages.sizes, &mut recording);
                recording
            })?;
            let push = shaders::FitRadiusPush {
                wanted,
                least: radius::LEAST_FOOTPRINTS,
            };
            let mut recording = Recording::new();
            recording.dispatch(StageDesc::new(&shaders::FIT_RADIUS, self.sizes.receivers()).push(push));
            self.run(&recording)?;
        }
        if self.sizes.photon_maps == 2 {
            let mut statistics: Vec<Statistics> = self.device.download(BufferId::StatisticsOf, None)?;
            let footprints: Vec<f32> = self.device.download(BufferId::Footprints, None)?;
            let caustic = &mut statistics[footprints.len()..];
            radius::sharpen(self.sizes.region.size, &footprints, caustic);
            self.device.upload(BufferId::StatisticsOf, &statistics)?;
        }
        // A launch count from radii that were too large does not apply to later gathers.
        self.sizes.gather_parts = 1;
        Ok(())
    }

    /// Automatic radii of a part of several are smaller.
    fn scale_radii(&mut self) -> Result<()> {
        let factor = self.config.part.radius2_factor(self.config.alpha);
        if factor == 1.0 {
            return Ok(());
        }
        self.settings.first_footprints = self.settings.first_footprints.map(|first| first * factor.sqrt());
        self.upload_settings()?;
        let mut statistics: Vec<Statistics> = self.device.download(BufferId::StatisticsOf, None)?;
        for of_slot in &mut statistics {
            of_slot.radius2_high *= factor;
            of_slot.radius2_low *= factor;
        }
        self.device.upload(BufferId::StatisticsOf, &statistics)
    }

    fn reset(&mut self) -> Result<()> {
        let mut recording = reporting();
        for sums in sums(self.config.layers) {
            recording.fill(sums, 0);
        }
        recording.dispatch(StageDesc::new(&shaders::RESET, self.sizes.receivers()));
        self.run(&recording).map(|_| ())
    }
}
