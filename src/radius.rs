//! The initial radius, where the user gives none.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::layout::{NO_OBJECT, Photon, VisiblePoint};

/// Photons that a visible point should accept in the first iteration, at the most.
pub const PHOTONS_WANTED: usize = 15;
/// The iteration whose photons the radius is found from; no render gets that far.
pub const PILOT: u32 = u32::MAX;
/// Rounds of shrinking the radius where photons are denser than wanted.
pub const FITS: u32 = 2;
/// Visible points that are asked.
const PROBES: usize = 2048;
/// What is used where no visible point sees a photon, render units (the scene is 2 long).
const WITHOUT_PHOTONS: f64 = 0.02;

/// The radius, in render units, within which the median visible point finds [`PHOTONS_WANTED`] photons of its object.
pub fn automatic(visible_points: &[VisiblePoint], photons: &[Photon]) -> f64 {
    let positions: Vec<[f32; 3]> = photons
        .iter()
        .map(|photon| [0, 1, 2].map(|axis| photon.position_object[axis]))
        .collect();
    let seen: Vec<&VisiblePoint> = visible_points
        .iter()
        .filter(|point| point.position_object[3].to_bits() != NO_OBJECT)
        .collect();
    if positions.len() < PHOTONS_WANTED || seen.is_empty() {
        return WITHOUT_PHOTONS;
    }
    let Ok(tree) = ImmutableKdTree::new_from_slice(&positions) else {
        return WITHOUT_PHOTONS;
    };
    let Some(wanted) = NonZero::new(4 * PHOTONS_WANTED) else {
        return WITHOUT_PHOTONS;
    };
    let step = seen.len().div_ceil(PROBES);
    let mut distances: Vec<f32> = seen
        .iter()
        .step_by(step)
        .filter_map(|point| {
            let position = [0, 1, 2].map(|axis| point.position_object[axis]);
            let object = point.position_object[3].to_bits();
            let nearest = tree
                .query(&position)
                .nearest_n::<SquaredEuclidean<f32>>(wanted)
                .execute();
            let on_object = nearest
                .iter()
                .filter(|near| photons[near.item as usize].position_object[3].to_bits() == object);
            on_object.map(|near| near.distance).nth(PHOTONS_WANTED - 1)
        })
        .collect();
    if distances.is_empty() {
        return WITHOUT_PHOTONS;
    }
    let middle = distances.len() / 2;
    let (_, median, _) = distances.select_nth_unstable_by(middle, f32::total_cmp);
    f64::from(*median).sqrt()
}
