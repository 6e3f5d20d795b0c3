//! The statistics of the visible points.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::DVec4;
use rayon::prelude::*;

use super::resolve::share_of;
use super::vector::{from_two_float, from_two_floats, mean, rgb, to_two_float, to_two_floats, word, xyz};
use super::{Counts, Seen};
use crate::layout::{Coverage, Gathered, NO_OBJECT, SMALLEST_RADIUS2, Settings, Statistics, VisiblePoint};

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
    mean(rgb(gathered.flux)) - 2.0 * f64::from(gathered.moment) / radius2
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
        let found = gathered.count as f32;
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

/// What the photons of an iteration have been gathered with.
#[derive(Debug, Clone, Copy)]
pub struct GatheredWith<'a> {
    /// R² of each slot for each photon map.
    pub radii2: &'a [f32],
    /// Likewise.
    pub coverage: &'a [Coverage],
    /// Paths of the iteration.
    pub photons: u32,
    /// Eq. 2's α.
    pub alpha: f32,
}

/// Takes an iteration's photons into the statistics of each slot for each photon map (equations 2 and 3) and clears them for
/// the next one; and what they add to the picture into the slots' `sums` of the iteration's sequence.
pub fn update(
    visible_points: &[VisiblePoint],
    with: GatheredWith<'_>,
    counts: &Counts,
    gathered: &mut [Gathered],
    statistics: &mut [Statistics],
    sums: &mut [[f32; 4]],
) {
    let slots = visible_points.len();
    let maps = statistics.chunks_mut(slots).zip(gathered.chunks_mut(slots));
    let maps = maps.zip(with.radii2.chunks(slots).zip(with.coverage.chunks(slots)));
    for ((statistics, gathered), (radii2, coverage)) in maps {
        let receivers = statistics.par_iter_mut().zip(gathered);
        let receivers = receivers.zip(radii2.par_iter().zip(coverage));
        let receivers = receivers.zip(visible_points.par_iter().zip(&mut *sums));
        receivers.for_each(|(((statistics, gathered), (&radius2, coverage)), (point, sum))| {
            if word(point.position_object) == NO_OBJECT {
                return;
            }
            let weight = xyz(point.weight_normal);
            let curvature = mean(weight) * curvature(gathered, f64::from(radius2));
            // τ is that of a disc of R. A smaller one has been gathered from where that has a bound.
            let larger = f64::from(statistics.radius2_high) / f64::from(radius2);
            let flux = (weight * rgb(gathered.flux)).extend(curvature) * larger;
            let new_photons = gathered.count;
            *gathered = Gathered::zeroed();
            if !flux.as_vec4().is_finite() {
                counts.add_non_finite(1);
            } else if new_photons > 0 {
                let area = PI * f64::from(statistics.radius2_high) * share_of(coverage);
                let radiance = flux / f64::from(with.photons) / area;
                *sum = (DVec4::from(sum.map(f64::from)) + radiance).as_vec4().to_array();
                take(flux, new_photons, f64::from(with.alpha), statistics);
            }
        });
    }
}

/// Equations 2 and 3.
fn take(flux: DVec4, new_photons: u32, alpha: f64, statistics: &mut Statistics) {
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
