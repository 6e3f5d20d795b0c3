//! The paper's image synthesis.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::{DVec3, DVec4, Vec3};

use super::tiles::{pixel_of, pixel_slots};
use super::vector::{from_two_float, from_two_floats, word, xyz};
use crate::config::{SEQUENCES, Totals, iterations_of};
use crate::layout::{BehindGlass, Coverage, DirectSum, NO_OBJECT, Settings, Statistics, VisiblePoint};

/// The part of the discs that can have photons; 1 where nothing is known of it.
pub(super) fn share_of(coverage: &Coverage) -> f64 {
    if coverage.covered > 0 {
        f64::from(coverage.covered) / f64::from(coverage.asked)
    } else {
        1.0
    }
}

/// The pictures of each sequence alone, row by row, one after another, as the slots' `sums` of the sequences have them.
pub fn resolve_sequences(settings: &Settings, sums: &[[f32; 4]], iterations: u32) -> Vec<[f32; 4]> {
    let [width, height] = settings.resolution.map(|side| side as usize);
    let slots_per_pixel = settings.slots_per_pixel as usize;
    let mut film = vec![[0.0; 4]; SEQUENCES as usize * width * height];
    let pictures = film.chunks_mut(width * height);
    let sequences = sums.chunks(pixel_slots(settings) * slots_per_pixel);
    for (sequence, (picture, sums)) in (0..).zip(pictures.zip(sequences)) {
        let iterations = f64::from(iterations_of(sequence, iterations));
        for (pixel_slot, slots) in (0..).zip(sums.chunks(slots_per_pixel)) {
            if let Some([x, y]) = pixel_of(settings.resolution, pixel_slot) {
                let sum: DVec4 = slots.iter().map(|sum| DVec4::from(sum.map(f64::from))).sum();
                let mean = sum / iterations.max(1.0);
                let mean = mean.as_vec4();
                if mean.is_finite() {
                    picture[y as usize * width + x as usize] = mean.to_array();
                }
            }
        }
    }
    film
}

/// Photons that a visible point has accepted, as far as 32 bits hold. What may have brought light behind glass are those of
/// the last photon map: the caustic ones, or all where nothing tells them apart.
pub(super) fn photons_of(statistics: &Statistics) -> u32 {
    if statistics.accepted_high == 0 {
        statistics.accepted_low
    } else {
        u32::MAX
    }
}

/// How wide a pixel is at a visible point that is seen directly.
fn pixel_width(settings: &Settings, position: DVec3) -> f64 {
    let distance = if settings.camera_up[3] == 0.0 {
        (position - xyz(settings.camera_position)).length()
    } else {
        1.0
    };
    f64::from(settings.pixel_spread) * distance
}

/// Counts the camera paths that met a surface, one of each pixel's.
pub fn count_met(points: &[VisiblePoint], coverage: &mut [Coverage]) {
    for (point, coverage) in points.iter().zip(coverage) {
        let met = word(point.position_object) != NO_OBJECT || word(point.weight_normal) != 0;
        coverage.met += u32::from(met);
    }
}

/// The picture, RGB and alpha, the share of the camera paths that met a surface (negative where no photon has come to one that
/// isn't in the open), row by row from the top left: eq. 4 for each slot of a pixel and photon map, and the mean over the
/// iterations of what was seen directly. What tells how much light behind glass no photon has brought yet. The number of pixels
/// whose radiance isn't finite, and which are black.
pub fn resolve(
    settings: &Settings,
    points: &[VisiblePoint],
    statistics: &[Statistics],
    direct_sums: &[DirectSum],
    coverage: &[Coverage],
    totals: Totals,
) -> (Vec<[f32; 4]>, Vec<BehindGlass>, u64) {
    let [width, height] = settings.resolution.map(|side| side as usize);
    let slots_per_pixel = settings.slots_per_pixel as usize;
    let mut film = vec![[0.0; 4]; width * height];
    let mut non_finite = 0;
    let mut glass_film = vec![BehindGlass::zeroed(); width * height];
    for pixel_slot in 0..pixel_slots(settings) {
        let Some([x, y]) = pixel_of(settings.resolution, pixel_slot as u32) else {
            continue;
        };
        let mut radiance = DVec3::ZERO;
        let mut met = 0;
        let (mut unbent, mut arrived) = (0.0, 0.0);
        let mut glass = BehindGlass::zeroed();
        let (mut has_surface, mut has_photons) = (false, false);
        for slot in pixel_slot * slots_per_pixel..(pixel_slot + 1) * slots_per_pixel {
            let direct = &direct_sums[slot];
            has_surface |= coverage[slot].surrounded > 0;
            // Slots of a pixel share its paths.
            met = met.max(coverage[slot].met);
            let seen = from_two_floats(direct.high, direct.low) / f64::from(totals.iterations);
            radiance += seen.truncate();
            let unbent_here = if direct.low[3] > 0.0 {
                f64::from(direct.high[3]) / f64::from(direct.low[3])
            } else {
                0.0
            };
            unbent += unbent_here;
            let receivers = (slot..statistics.len()).step_by(direct_sums.len());
            let through_glass = receivers.clone().next_back();
            for receiver in receivers {
                let statistics = &statistics[receiver];
                has_photons |= (statistics.accepted_low | statistics.accepted_high) != 0;
                let radius2 = from_two_float(statistics.radius2_high, statistics.radius2_low);
                let tau = from_two_floats(statistics.flux_high, statistics.flux_low);
                if radius2 > 0.0 {
                    let by_photons =
                        tau.truncate() / (PI * radius2 * share_of(&coverage[receiver]) * totals.emitted as f64);
                    radiance += by_photons;
                    if through_glass == Some(receiver) {
                        arrived += by_photons.element_sum() / 3.0;
                    }
                }
                let is_seen = word(points[slot].position_object) != NO_OBJECT;
                if unbent_here > 0.0 && is_seen && through_glass == Some(receiver) {
                    // Of several slots, what the one with the most photons has.
                    glass.photons = glass.photons.max(photons_of(statistics) as f32);
                    let radius = radius2.sqrt() / pixel_width(settings, xyz(points[slot].position_object));
                    glass.radius = glass.radius.max(radius as f32);
                    glass.radius2 = glass.radius2.max(radius2 as f32);
                }
            }
        }
        (glass.unbent, glass.arrived) = (unbent as f32, arrived as f32);
        let mut radiance = radiance.as_vec3();
        if !radiance.is_finite() {
            non_finite += 1;
            radiance = Vec3::ZERO;
        }
        let alpha = (f64::from(met) / f64::from(totals.camera_paths)) as f32;
        let alpha = if has_surface && !has_photons { -alpha } else { alpha };
        let pixel = y as usize * width + x as usize;
        film[pixel] = radiance.extend(alpha).to_array();
        glass_film[pixel] = glass;
    }
    (film, glass_film, non_finite)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_f32_cannot_hold_is_black_and_counted_as_on_a_device() {
        let settings = Settings {
            resolution: [2, 1],
            slots_per_pixel: 1,
            ..Settings::zeroed()
        };
        let slots = pixel_slots(&settings);
        let mut statistics = vec![Statistics::zeroed(); slots];
        for (statistics, radius2) in statistics.iter_mut().zip([1e-20, 1.0]) {
            (statistics.radius2_high, statistics.flux_high) = (radius2, [1e30, 1.0, 1.0, 0.0]);
        }
        let (film, _, non_finite) = resolve(
            &settings,
            &vec![VisiblePoint::zeroed(); slots],
            &statistics,
            &vec![DirectSum::zeroed(); slots],
            &vec![Coverage::zeroed(); slots],
            Totals::default().at_least_one(),
        );
        assert_eq!((film[0], non_finite), ([0.0; 4], 1));
        assert!(film[1][0] > 1e29, "{:?}", film[1]);
        let mut sums = vec![[1e38; 4]; SEQUENCES as usize * slots];
        sums[0][0] = f32::INFINITY;
        let film = resolve_sequences(&settings, &sums, 4);
        assert_eq!((film[0], film[1]), ([0.0; 4], [1e38; 4]));
    }
}
