//! What pixels and their visible points keep from iteration to iteration.

use bytemuck::Zeroable;
use glam::{DVec3, DVec4};

use super::bsdf::Width;
use super::camera::{CameraPath, VisiblePoint};
use super::gather::{Receiver, Receivers};
use super::statistics::Statistics;
use super::vector::mean;
use crate::config::{SEQUENCES, Totals};
use crate::layout::BehindGlass;

/// What a visible point gathers into; one for each that a pixel can have.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Slot {
    pub statistics: Statistics,
    /// R² of this iteration's disc.
    pub disc: f64,
    /// Iterations in which it was asked what part of the disc can have photons, and the sum of those parts.
    pub asked: u32,
    pub covered: f64,
}

impl Slot {
    /// The part of the disc that can have photons; 1 where nothing is known of it.
    pub fn share(&self) -> f64 {
        if self.covered > 0.0 {
            self.covered / f64::from(self.asked)
        } else {
            1.0
        }
    }
}

/// What a pixel has seen.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pixel {
    /// Sum over the iterations of what was seen directly.
    pub direct: DVec3,
    /// RGB and curvature of the iterations of each sequence.
    pub sequences: [DVec4; SEQUENCES as usize],
    /// Sum of the light behind glass, and how often that was asked for.
    pub unbent: f64,
    pub asked: u32,
    /// Camera paths that met a surface.
    pub met: u32,
    /// Whether photons may be expected.
    pub surrounded: bool,
}

impl Pixel {
    /// Radiance, and what tells of light behind glass, from its visible points and their slots.
    pub fn resolve(&self, points: &[VisiblePoint], slots: &[Slot], totals: Totals) -> (DVec3, BehindGlass) {
        let of_slot = |slot: &Slot| slot.statistics.radiance(slot.share(), totals.emitted);
        let by_photons: DVec3 = slots.iter().map(of_slot).sum();
        let mut glass = BehindGlass::zeroed();
        glass.arrived = mean(by_photons) as f32;
        if self.unbent > 0.0 {
            glass.unbent = (self.unbent / f64::from(self.asked)) as f32;
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

/// The visible points with the discs of this iteration.
pub(super) struct Discs<'a> {
    pub paths: &'a [CameraPath],
    pub slots: &'a [Slot],
    pub room: usize,
}

impl Discs<'_> {
    fn point(&self, index: usize) -> Option<&VisiblePoint> {
        self.paths[index / self.room].points.get(index % self.room)
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

    /// Photons have the cosine to the shading normal in their flux.
    fn response(&self, index: usize, l: DVec3) -> DVec3 {
        self.point(index).map_or(DVec3::ZERO, |point| {
            let cosine = l.dot(point.bsdf.normals().shading);
            let scattered = point.bsdf.evaluate(Width::Wide, point.viewer, l);
            if cosine > 0.0 { scattered / cosine } else { DVec3::ZERO }
        })
    }
}
