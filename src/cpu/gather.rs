//! Gathering photons within the radius of each visible point: by testing all of them, or with a k-d tree (the paper's CPU
//! version).

use glam::DVec3;
use rayon::prelude::*;

use super::reflector::Reflector;
use super::sampling::decode_direction;
use super::vector::{mean, xyz};
use crate::kd_tree::KdTree;
use crate::layout::{CAUSTIC, NO_OBJECT, PackedBsdf, Photon, VisiblePoint};

/// The k-d tree's search radius relative to R². Its rounding of the squared distance differs from that of the exact test.
const MARGIN: f32 = 1.0 + 1e-5;

/// Photons that a visible point accepted. Thousands of f32 of similar size are summed in f64 without rounding, so the order of
/// the photons does not matter.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gathered {
    /// Σ flux; with a glossy BSDF, the part that is scattered towards the viewer.
    pub flux: DVec3,
    /// M.
    pub count: u32,
    /// Σ flux · distance², with the mean of the flux's channels.
    pub moment: f64,
}

impl Gathered {
    /// Adds another batch of the iteration's photons.
    pub fn add(&mut self, other: &Self) {
        self.flux += other.flux;
        self.count += other.count;
        self.moment += other.moment;
    }

    /// Σ flux · (1 − 2 distance²/R²), with the mean of the channels: 0 on average where the photon density is uniform.
    pub fn curvature(&self, radius2: f64) -> f64 {
        mean(self.flux) - 2.0 * self.moment / radius2
    }
}

/// A disc that accepts photons.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// In the same precision as the photons' positions.
    pub position: [f32; 3],
    /// R².
    pub radius2: f32,
    /// Object, with [`CAUSTIC`] for the map of caustic photons.
    pub object: u32,
    /// On the visible side.
    pub normal: DVec3,
}

impl Receiver {
    /// The squared distance of a photon within R on the same object that arrives on the visible side. It is rounded to f32 at
    /// each step like in the kernels, so that both accept the same photons.
    fn accepts(&self, photon: &Photon, arriving: DVec3) -> Option<f32> {
        let here = position(photon);
        let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| here[axis] - self.position[axis]);
        let distance2 = x * x + y * y + z * z;
        let is_within = distance2 <= self.radius2 && photon.object == self.object;
        (is_within && arriving.dot(self.normal) < 0.0).then_some(distance2)
    }
}

/// All receivers of an image.
pub trait Receivers: Sync {
    /// Number of slots.
    fn count(&self) -> usize;
    /// The receiver in a slot; `None` where a path has no visible point.
    fn receiver(&self, index: usize) -> Option<Receiver>;
    /// Factor of the flux of a photon that arrives from `l`.
    fn response(&self, index: usize, l: DVec3) -> DVec3;
}

/// Visible points made by the kernels; R² of all slots of the first photon map, then of the next.
#[derive(Debug, Clone, Copy)]
pub struct DeviceReceivers<'a> {
    /// Visible points.
    pub points: &'a [VisiblePoint],
    /// Their BSDFs; empty if the scene has no glossy surfaces.
    pub bsdfs: &'a [PackedBsdf],
    /// R².
    pub radii2: &'a [f32],
}

impl Receivers for DeviceReceivers<'_> {
    fn count(&self) -> usize {
        self.radii2.len()
    }

    fn receiver(&self, index: usize) -> Option<Receiver> {
        let (map, slot) = (index / self.points.len(), index % self.points.len());
        let point = &self.points[slot];
        let object = point.object;
        (object != NO_OBJECT).then(|| Receiver {
            position: point.position,
            radius2: self.radii2[index],
            object: if map == 1 { object | CAUSTIC } else { object },
            normal: decode_direction(point.geometric_normal),
        })
    }

    fn response(&self, index: usize, l: DVec3) -> DVec3 {
        let slot = index % self.points.len();
        self.bsdfs.get(slot).map_or(DVec3::ONE, |packed| {
            let (reflector, viewer, coated) = Reflector::of_packed(packed);
            let normal = decode_direction(self.points[slot].shading_normal);
            // Flux on coated objects is per area across the ray, because each layer has its own normal.
            let cosine = if coated { l.dot(normal).max(0.0) } else { 1.0 };
            reflector.brdf(normal, viewer, l) * cosine
        })
    }
}

fn position(photon: &Photon) -> [f32; 3] {
    photon.position
}

/// Sums the photons that `find` returns for each receiver.
fn gather<R: Receivers>(
    receivers: &R,
    photons: &[Photon],
    find: impl Fn(&Receiver, &mut dyn FnMut(usize)) + Sync,
) -> Vec<Gathered> {
    let of_receiver = |index: usize| {
        let mut gathered = Gathered::default();
        if let Some(receiver) = receivers.receiver(index) {
            find(&receiver, &mut |found| {
                let photon = &photons[found];
                let arriving = decode_direction(photon.direction);
                if let Some(distance2) = receiver.accepts(photon, arriving) {
                    let flux = xyz(photon.flux) * receivers.response(index, -arriving);
                    gathered.flux += flux;
                    gathered.count += 1;
                    gathered.moment += mean(flux) * f64::from(distance2);
                }
            });
        }
        gathered
    };
    (0..receivers.count()).into_par_iter().map(of_receiver).collect()
}

/// Tests every photon for each receiver.
pub fn gather_naive<R: Receivers>(receivers: &R, photons: &[Photon]) -> Vec<Gathered> {
    gather(receivers, photons, |_, visit| (0..photons.len()).for_each(visit))
}

/// Tests the photons that a k-d tree finds: the paper's CPU version.
pub fn gather_kd_tree<R: Receivers>(receivers: &R, photons: &[Photon]) -> Vec<Gathered> {
    let positions: Vec<[f32; 3]> = photons.iter().map(position).collect();
    let tree = KdTree::new(&positions);
    gather(receivers, photons, |receiver, visit| {
        tree.within(receiver.position, receiver.radius2 * MARGIN, visit);
    })
}
