//! State of pixels and slots between iterations.

use bytemuck::Zeroable;
use glam::{DVec3, DVec4};
use serde::{Deserialize, Serialize};

use super::bsdf::Width;
use super::camera::{CameraPath, VisiblePoint};
use super::gather::{Receiver, Receivers};
use super::statistics::Statistics;
use super::vector::mean;
use crate::config::{SEQUENCES, Totals};
use crate::layout::BehindGlass;

/// Statistics of a visible point; a pixel has one slot for each visible point that its path can have.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Slot {
    pub statistics: Statistics,
    /// R² of this iteration's disc.
    pub disc: f64,
    /// Iterations in which the disc's coverage was sampled, and the sum of the covered fractions.
    pub coverage_iterations: u32,
    pub covered: f64,
}

impl Slot {
    /// The fraction of the disc that can receive photons; 1 if unknown.
    pub fn covered_fraction(&self) -> f64 {
        if self.covered > 0.0 {
            self.covered / f64::from(self.coverage_iterations)
        } else {
            1.0
        }
    }
}

/// State of a pixel.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Pixel {
    /// Emission and direct light, summed over the iterations.
    pub direct: DVec3,
    /// RGB and curvature, summed over the iterations of each sequence.
    pub sequences: [DVec4; SEQUENCES as usize],
    /// Unrefracted light behind glass, and the iterations in which it was sampled.
    pub unbent: f64,
    pub unbent_iterations: u32,
    /// Camera paths that hit a surface.
    pub met: u32,
    /// Whether a surface surrounds the point, so that photons may still arrive.
    pub surrounded: bool,
}

impl Pixel {
    /// Radiance, and the statistics of light behind glass, from the pixel's visible points and slots.
    pub fn resolve(&self, points: &[VisiblePoint], slots: &[Slot], totals: Totals) -> (DVec3, BehindGlass) {
        let of_slot = |slot: &Slot| slot.statistics.radiance(slot.covered_fraction(), totals.emitted);
        let by_photons: DVec3 = slots.iter().map(of_slot).sum();
        let mut glass = BehindGlass::zeroed();
        glass.arrived = mean(by_photons) as f32;
        if self.unbent > 0.0 {
            glass.unbent = (self.unbent / f64::from(self.unbent_iterations)) as f32;
            for (slot, point) in slots.iter().zip(points) {
                let radius2 = slot.statistics.radius2;
                glass.photons = glass.photons.max(slot.statistics.accepted as f32);
                glass.radius = glass.radius.max((radius2.sqrt() / point.footprint) as f32);
                glass.radius2 = glass.radius2.max(radius2 as f32);
            }
        }
        (self.direct / f64::from(totals.iterations) + by_photons, glass)
    }
}

/// The visible points with this iteration's discs.
pub(super) struct Discs<'a> {
    pub paths: &'a [CameraPath],
    pub slots: &'a [Slot],
    pub pixel_slots: usize,
}

impl Discs<'_> {
    fn point(&self, index: usize) -> Option<&VisiblePoint> {
        self.paths[index / self.pixel_slots]
            .points
            .get(index % self.pixel_slots)
    }
}

impl Receivers for Discs<'_> {
    fn count(&self) -> usize {
        self.slots.len()
    }

    fn receiver(&self, index: usize) -> Option<Receiver> {
        self.point(index).map(|point| Receiver {
            position: point.surface.position.as_vec3().to_array(),
            radius2: self.slots[index].disc as f32,
            object: point.surface.object,
            normal: point.bsdf.normals().geometric,
        })
    }

    /// The photons' flux includes the cosine to the shading normal.
    fn response(&self, index: usize, l: DVec3) -> DVec3 {
        self.point(index).map_or(DVec3::ZERO, |point| {
            let cosine = l.dot(point.bsdf.normals().shading);
            let scattered = point.bsdf.evaluate(Width::Wide, point.viewer, l);
            if cosine > 0.0 { scattered / cosine } else { DVec3::ZERO }
        })
    }
}
