//! The statistics of the visible points.

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::vector::{from_two_float, from_two_floats, mean, to_two_float, to_two_floats, word, xyz};
use super::{Counts, Seen};
use crate::layout::{Gathered, NO_OBJECT, Settings, Statistics, VisiblePoint};

/// R² where it stops shrinking, and τ with it: far below what positions resolve, far above the smallest f32.
const SMALLEST_RADIUS2: f64 = 1e-24;

/// Statistics before the first photon, with R² in square render units; 0 where the first visible point sets it.
pub fn reset(radius2: f32) -> Statistics {
    Statistics {
        radius2_high: radius2,
        ..Statistics::zeroed()
    }
}

/// R² that each slot gathers within in this iteration, for each photon map: all slots of one map, then those of the next.
/// The first visible point of a slot sets its R; no disc is larger than a multiple of the pixel's footprint.
pub fn radii(settings: &Settings, seen: &Seen, statistics: &mut [Statistics]) -> Vec<f32> {
    let slots = seen.points.len();
    let receivers = statistics.par_iter_mut().enumerate();
    let radius2 = |(index, statistics): (usize, &mut Statistics)| {
        let (map, slot) = (index / slots, index % slots);
        if word(seen.points[slot].position_object) == NO_OBJECT {
            return statistics.radius2_high;
        }
        let footprint = seen.footprints[slot];
        if statistics.radius2_high == 0.0 {
            statistics.radius2_high = if settings.initial_radius2 > 0.0 {
                settings.initial_radius2
            } else {
                (settings.first_footprints[map] * footprint).powi(2).max(1e-24)
            };
        }
        let most = settings.most_footprints[map] * footprint;
        if most > 0.0 {
            statistics.radius2_high.min((most * most).max(1e-24))
        } else {
            statistics.radius2_high
        }
    };
    receivers.map(radius2).collect()
}

/// Σ flux · (1 − 2 distance²/R²), flux as the mean of its channels: 0 on average where photons lie evenly.
fn curvature(gathered: &Gathered, radius2: f64) -> f64 {
    mean(xyz(gathered.flux_count)) - 2.0 * f64::from(gathered.moment) / radius2
}

/// Where a gather of pilot photons found more than are `wanted` of its map, shrinks the radius until it would hold as many,
/// but not below `least` footprints; clears what was gathered.
pub fn fit_radius(
    wanted: [f32; 2],
    least: f32,
    footprints: &[f32],
    gathered: &mut [Gathered],
    statistics: &mut [Statistics],
) {
    let slots = footprints.len();
    let receivers = statistics.par_iter_mut().zip(gathered).enumerate();
    receivers.for_each(|(index, (statistics, gathered))| {
        let found = word(gathered.flux_count) as f32;
        let wanted = wanted[index / slots];
        if found > wanted {
            let least2 = f64::from(least * footprints[index % slots]).powi(2);
            let radius2 = f64::from(statistics.radius2_high);
            let fitted = radius2 * f64::from(wanted) / f64::from(found);
            statistics.radius2_high = fitted.max(radius2.min(least2)) as f32;
        }
        *gathered = Gathered::zeroed();
    });
}

/// Takes an iteration's photons, gathered within `radii2`, into the statistics of each slot for each photon map (equations 2
/// and 3) and clears them for the next one.
pub fn update(
    visible_points: &[VisiblePoint],
    radii2: &[f32],
    alpha: f32,
    counts: &Counts,
    gathered: &mut [Gathered],
    statistics: &mut [Statistics],
) {
    let receivers = statistics.par_iter_mut().zip(gathered).zip(radii2).enumerate();
    receivers.for_each(|(index, ((statistics, gathered), &radius2_here))| {
        let point = &visible_points[index % visible_points.len()];
        if word(point.position_object) == NO_OBJECT {
            return;
        }
        let weight = xyz(point.weight_normal);
        let curvature = mean(weight) * curvature(gathered, f64::from(radius2_here));
        // τ is that of a disc of R. A smaller one has been gathered from where that has a bound.
        let larger = f64::from(statistics.radius2_high) / f64::from(radius2_here);
        let flux = (weight * xyz(gathered.flux_count)).extend(curvature) * larger;
        let new_photons = word(gathered.flux_count);
        *gathered = Gathered::zeroed();
        if !flux.is_finite() {
            counts.add_non_finite(1);
        } else if new_photons > 0 {
            let alpha = f64::from(alpha);
            let accepted = statistics.accepted();
            let (n, m) = (alpha * accepted as f64, f64::from(new_photons));
            let radius2 = from_two_float(statistics.radius2_high, statistics.radius2_low);
            let ratio = (n + alpha * m) / (n + m);
            let ratio = if radius2 * ratio < SMALLEST_RADIUS2 { 1.0 } else { ratio };
            let radius2 = radius2 * ratio;
            let tau = (from_two_floats(statistics.flux_high, statistics.flux_low) + flux) * ratio;
            let accepted = accepted + u64::from(new_photons);
            (statistics.radius2_high, statistics.radius2_low) = to_two_float(radius2);
            (statistics.flux_high, statistics.flux_low) = to_two_floats(tau);
            (statistics.accepted_low, statistics.accepted_high) = (accepted as u32, (accepted >> 32) as u32);
        }
    });
}
