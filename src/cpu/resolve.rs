//! The paper's image synthesis.

use std::f64::consts::PI;

use glam::DVec4;

use super::tiles::{pixel_of, pixel_slots};
use super::vector::{from_two_float, from_two_floats};
use crate::layout::{Coverage, DirectSum, Settings, Statistics};

/// The part of the discs that can have photons; 1 where nothing is known of it.
fn share_of(coverage: &Coverage) -> f64 {
    if coverage.covered > 0 {
        f64::from(coverage.covered) / f64::from(coverage.asked)
    } else {
        1.0
    }
}

/// The picture, RGB and curvature (infinite where no photon has come to a surface), row by row from the top left: eq. 4 for each slot of a pixel, and the mean over the
/// iterations of what was seen directly. `emitted` are the photon paths of all iterations.
pub fn resolve(
    settings: &Settings,
    statistics: &[Statistics],
    direct_sums: &[DirectSum],
    coverage: &[Coverage],
    iterations: u32,
    emitted: u64,
) -> Vec<[f32; 4]> {
    let [width, height] = settings.resolution.map(|side| side as usize);
    let slots_per_pixel = settings.slots_per_pixel as usize;
    let mut film = vec![[0.0; 4]; width * height];
    for pixel_slot in 0..pixel_slots(settings) {
        let Some([x, y]) = pixel_of(settings.resolution, pixel_slot as u32) else {
            continue;
        };
        let mut radiance = DVec4::ZERO;
        let (mut has_surface, mut has_photons) = (false, false);
        for slot in pixel_slot * slots_per_pixel..(pixel_slot + 1) * slots_per_pixel {
            let (statistics, direct) = (&statistics[slot], &direct_sums[slot]);
            has_surface |= coverage[slot].asked > 0;
            has_photons |= (statistics.accepted_low | statistics.accepted_high) != 0;
            let radius2 = from_two_float(statistics.radius2_high, statistics.radius2_low);
            let tau = from_two_floats(statistics.flux_high, statistics.flux_low);
            radiance += from_two_floats(direct.high, direct.low) / f64::from(iterations);
            if radius2 > 0.0 {
                radiance += tau / (PI * radius2 * share_of(&coverage[slot]) * emitted as f64);
            }
        }
        if has_surface && !has_photons {
            radiance.w = f64::INFINITY;
        }
        film[y as usize * width + x as usize] = radiance.as_vec4().to_array();
    }
    film
}
