//! Initial radii, and the discs of visible points.

use bytemuck::Zeroable;

use super::{BATCH, Renderer};
use crate::error::Result;
use crate::layout::{self, SMALLEST_RADIUS2};
use crate::radius::{self, LEAST_FOOTPRINTS};
use crate::random::CameraTurn;

impl Renderer {
    /// The user's radius, or initial radii from the density of pilot photons: one for the median visible point, then smaller ones
    /// where photons are denser.
    pub(super) fn choose_radii(&mut self) -> Result<()> {
        self.paths = self.trace_camera_paths(CameraTurn::FIRST);
        if self.config.radius.is_none() {
            let batch = self.config.photons.min(BATCH);
            // The pilot is one batch; a whole iteration has a higher density.
            let share = batch as f32 / self.config.photons as f32;
            let (photons, _) = self.trace_photon_paths(radius::PILOT, 0..batch);
            self.figures.photon_flux = radius::mean_flux(&photons);
            let seen = self.paths.iter().flat_map(|path| &path.points);
            let as_on_device = seen.map(|point| {
                let packed = layout::VisiblePoint {
                    position: point.surface.position.as_vec3().into(),
                    object: point.surface.object,
                    ..layout::VisiblePoint::zeroed()
                };
                (packed, point.footprint as f32)
            });
            let (points, footprints): (Vec<_>, Vec<_>) = as_on_device.unzip();
            let [first, _] = radius::first(&points, &footprints, &photons, share);
            self.settings.first_footprints[0] = first.footprints;
            let wanted = f64::from(first.photons as f32 * share);
            for _ in 0..radius::FITS {
                self.find_discs();
                let gathered = self.gather(&photons);
                for (index, gathered) in gathered.iter().enumerate() {
                    let found = f64::from(gathered.count);
                    if found > wanted {
                        let point = &self.paths[index / self.pixel_slots].points[index % self.pixel_slots];
                        let radius2 = &mut self.slots[index].statistics.radius2;
                        let least2 = (f64::from(LEAST_FOOTPRINTS) * point.footprint).powi(2);
                        *radius2 = (*radius2 * wanted / found).max(radius2.min(least2));
                    }
                }
            }
        }
        let factor = self.config.part.radius2_factor(self.config.alpha);
        if self.config.radius.is_none() && factor != 1.0 {
            self.settings.first_footprints[0] *= factor.sqrt();
            let slots = self.slots.iter_mut();
            slots.for_each(|slot| slot.statistics.radius2 *= f64::from(factor));
        }
        self.find_discs();
        let mut radii2: Vec<f64> = self
            .statistics()
            .map(|s| s.radius2)
            .filter(|&radius2| radius2 > 0.0)
            .collect();
        radii2.sort_unstable_by(f64::total_cmp);
        self.figures.radius = radii2
            .get(radii2.len() / 2)
            .map_or(0.0, |radius2| radius2.sqrt() as f32);
        Ok(())
    }

    /// Sets the discs of the visible points. A slot's first visible point sets its R; a disc is at most a multiple of the
    /// footprint.
    pub(super) fn find_discs(&mut self) {
        let settings = &self.settings;
        for (path, slots) in self.paths.iter().zip(self.slots.chunks_mut(self.pixel_slots)) {
            for (point, slot) in path.points.iter().zip(slots) {
                let radius2 = &mut slot.statistics.radius2;
                if *radius2 == 0.0 {
                    let first = f64::from(settings.first_footprints[0]) * point.footprint;
                    *radius2 = match settings.initial_radius2 {
                        0.0 => first.powi(2).max(SMALLEST_RADIUS2),
                        given => given.into(),
                    };
                }
                let most = f64::from(settings.most_footprints[0]) * point.footprint;
                slot.disc = if most > 0.0 {
                    radius2.min((most * most).max(SMALLEST_RADIUS2))
                } else {
                    *radius2
                };
            }
        }
    }
}
