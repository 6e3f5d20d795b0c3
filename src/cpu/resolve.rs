//! The paper's image synthesis.

use std::f64::consts::PI;

use glam::DVec4;

use super::tiles::{pixel_of, pixel_slots};
use super::vector::{from_two_float, from_two_floats};
use crate::layout::{DirectSum, Settings, Statistics};

/// The picture, RGB and curvature, row by row from the top left: eq. 4 for each slot of a pixel, and the mean over the
/// iterations of what was seen directly. `emitted` are the photon paths of all iterations.
pub fn resolve(
    settings: &Settings,
    statistics: &[Statistics],
    direct_sums: &[DirectSum],
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
        for slot in pixel_slot * slots_per_pixel..(pixel_slot + 1) * slots_per_pixel {
            let (statistics, direct) = (&statistics[slot], &direct_sums[slot]);
            let radius2 = from_two_float(statistics.radius2_high, statistics.radius2_low);
            let tau = from_two_floats(statistics.flux_high, statistics.flux_low);
            radiance += from_two_floats(direct.high, direct.low) / f64::from(iterations);
            if radius2 > 0.0 {
                radiance += tau / (PI * radius2 * emitted as f64);
            }
        }
        film[y as usize * width + x as usize] = radiance.as_vec4().to_array();
    }
    film
}
