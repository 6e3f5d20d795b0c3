//! The statistics of the visible points.

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::Counts;
use super::vector::{from_two_float, from_two_floats, mean, to_two_float, to_two_floats, word, xyz};
use crate::layout::{Gathered, NO_OBJECT, RadiusSum, Statistics, VisiblePoint};

/// R² where it stops shrinking, and τ with it: far below what positions resolve, far above the smallest f32.
const SMALLEST_RADIUS2: f64 = 1e-24;

/// Statistics before the first photon, with R² in square render units.
pub fn reset(initial_radius2: f32) -> Statistics {
    Statistics {
        radius2_high: initial_radius2,
        ..Statistics::zeroed()
    }
}

/// Σ flux · (1 − 2 distance²/R²), flux as the mean of its channels: 0 on average where photons lie evenly.
fn curvature(gathered: &Gathered, radius2: f64) -> f64 {
    mean(xyz(gathered.flux_count)) - 2.0 * f64::from(gathered.moment) / radius2
}

/// Where a gather of pilot photons found more than `wanted`, shrinks the radius until it would hold as many; clears what
/// was gathered.
pub fn fit_radius(wanted: f32, gathered: &mut [Gathered], statistics: &mut [Statistics]) {
    statistics
        .par_iter_mut()
        .zip(gathered)
        .for_each(|(statistics, gathered)| {
            let share = f64::from(wanted) / f64::from(word(gathered.flux_count));
            if share < 1.0 {
                statistics.radius2_high = (f64::from(statistics.radius2_high) * share) as f32;
            }
            *gathered = Gathered::zeroed();
        });
}

/// Takes an iteration's photons into each slot's statistics (equations 2 and 3) and clears them for the next one.
pub fn update(
    visible_points: &[VisiblePoint],
    alpha: f32,
    counts: &Counts,
    gathered: &mut [Gathered],
    statistics: &mut [Statistics],
) {
    statistics
        .par_iter_mut()
        .zip(gathered)
        .zip(visible_points)
        .for_each(|((statistics, gathered), point)| {
            if word(point.position_object) == NO_OBJECT {
                return;
            }
            let weight = xyz(point.weight_normal);
            let curvature = mean(weight) * curvature(gathered, f64::from(statistics.radius2_high));
            let flux = (weight * xyz(gathered.flux_count)).extend(curvature);
            let new_photons = word(gathered.flux_count);
            *gathered = Gathered::zeroed();
            if !flux.is_finite() {
                counts.add_non_finite(1);
            } else if new_photons > 0 {
                let alpha = f64::from(alpha);
                let accepted = u64::from(statistics.accepted_low) | u64::from(statistics.accepted_high) << 32;
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

/// Sums over the radii of every `step`-th visible point in `groups` shares, from which the device chooses the next grid:
/// points are dealt to shares in turn, `size` at a time.
pub fn radius_sums(
    visible_points: &[VisiblePoint],
    statistics: &[Statistics],
    [groups, size, step]: [usize; 3],
) -> Vec<RadiusSum> {
    let mut sums = vec![(0.0f64, 0.0f64, 0u32); groups];
    for (slot, (point, statistics)) in visible_points.iter().zip(statistics).step_by(step).enumerate() {
        if word(point.position_object) != NO_OBJECT {
            let (radius2, inverse2, count) = &mut sums[slot / size % groups];
            *radius2 += f64::from(statistics.radius2_high);
            *inverse2 += 1.0 / f64::from(statistics.radius2_high);
            *count += 1;
        }
    }
    let to_sum = |(radius2, inverse2, count)| RadiusSum {
        radius2: radius2 as f32,
        inverse2: inverse2 as f32,
        count,
        padding: 0,
    };
    sums.into_iter().map(to_sum).collect()
}
