//! Automatic initial radii, in footprints of the pixels.

use crate::config::pixel_of;
use crate::kd_tree::KdTree;
use crate::layout::{CAUSTIC, NO_OBJECT, Photon, Statistics, VisiblePoint};

/// Candidates for the number of photons that a visible point accepts in the first iteration. The blur of the others is measured
/// relative to the first.
const OF_GLOBAL: [&[usize]; 1] = [&[8, 12, 16, 24, 32, 48, 64]];
/// The same for caustic photons, which have edges: if the first of a list is best, the next list is tried.
const OF_CAUSTICS: [&[usize]; 2] = [&[8, 12, 16], &[4, 6, 8]];
/// The iteration whose photons determine the radius; no render gets that far.
pub const PILOT: u32 = u32::MAX;
/// Rounds of shrinking the radius where photons are denser than wanted.
pub const FITS: u32 = 2;
/// Clamp of the ratio of densities: a larger ratio means a dark region.
const MOST_BLUR: f64 = 4.0;
/// Number of visible points that are sampled.
const PROBES: usize = 2048;
/// Maximum R of global and of caustic photons, in footprints: a larger disc would blur visible detail. Caustics have finer
/// detail.
pub const MOST_FOOTPRINTS: [f32; 2] = [32.0, 8.0];
/// R of the discs for pilot photons, in footprints: large enough to cover everything visible, small enough not to cover the room
/// behind a wall.
pub const PILOT_FOOTPRINTS: f32 = 4.0;
/// Minimum initial R, in footprints: a smaller disc would show no more detail.
pub const LEAST_FOOTPRINTS: f32 = 0.5;

/// Initial discs of a photon map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct First {
    /// R, in footprints.
    pub footprints: f32,
    /// Maximum number of photons that a visible point should accept in the first iteration; the median point finds that many
    /// within R, unless R is clamped.
    pub photons: usize,
}

/// Initial discs of each photon map, from pilot photons. `footprints` are those of the visible points, `share` is the pilot's
/// share of an iteration's photon paths.
pub fn first(visible_points: &[VisiblePoint], footprints: &[f32], photons: &[Photon], share: f32) -> [First; 2] {
    let in_map = |photon: &&Photon| photon.object & CAUSTIC != 0;
    let (caustic, global): (Vec<&Photon>, Vec<&Photon>) = photons.iter().partition(in_map);
    [(0, global), (1, caustic)].map(|(map, photons)| {
        let most = MOST_FOOTPRINTS[map];
        let lists: &[&[usize]] = if map == 1 { &OF_CAUSTICS } else { &OF_GLOBAL };
        let Automatic { footprints, photons } = automatic(visible_points, footprints, &photons, lists);
        First {
            footprints: (footprints * share.sqrt()).clamp(LEAST_FOOTPRINTS, most),
            photons,
        }
    })
}

/// Maximum growth of R from a pixel to its neighbour, in pixels.
const SLOPE: f32 = 0.2;

/// Limits caustic discs relative to those of the surrounding pixels: caustics have edges, and a disc that reaches across one
/// would blur it. `statistics`: of all slots, one a pixel.
pub fn sharpen(resolution: [u32; 2], footprints: &[f32], statistics: &mut [Statistics]) {
    let [width, height] = resolution.map(|side| side as usize);
    let mut radii = vec![f32::INFINITY; width * height];
    let slots = || (0..footprints.len()).filter_map(|slot| Some((slot, pixel_of(resolution, slot as u32)?)));
    let place = |[x, y]: [u32; 2]| y as usize * width + x as usize;
    for (slot, pixel) in slots() {
        let radius2 = statistics[slot].radius2_high;
        if radius2 > 0.0 {
            radii[place(pixel)] = radius2.sqrt() / footprints[slot];
        }
    }
    // A distance transform in two passes: Borgefors, «Distance transformations in digital images», 1986.
    let diagonal = SLOPE * std::f32::consts::SQRT_2;
    let steps = [(-1, 0, SLOPE), (-1, -1, diagonal), (0, -1, SLOPE), (1, -1, diagonal)];
    let mut pass = |number: usize, sign: isize| {
        let (x, y) = ((number % width) as isize, (number / width) as isize);
        for (dx, dy, growth) in steps {
            let (x, y) = (x + sign * dx, y + sign * dy);
            if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                radii[number] = radii[number].min(radii[y as usize * width + x as usize] + growth);
            }
        }
    };
    (0..width * height).for_each(|number| pass(number, 1));
    (0..width * height).rev().for_each(|number| pass(number, -1));
    for (slot, pixel) in slots() {
        let radius2 = (radii[place(pixel)] * footprints[slot]).powi(2);
        if radius2 < statistics[slot].radius2_high {
            statistics[slot].radius2_high = radius2;
        }
    }
}

/// Whether photons that no visible point can accept are dropped: aiming needs the demand anyway; otherwise the look-up costs more
/// than it saves if nearly all photons are wanted.
pub fn is_dropping_worth_it(landed: u64, kept: u64, aims: bool) -> bool {
    aims || kept < landed - landed / 4
}

/// Mean flux of photons, mean of the channels; `None` without photons.
pub fn mean_flux(photons: &[Photon]) -> Option<f64> {
    let flux = |photon: &Photon| photon.flux.iter().map(|&channel| f64::from(channel)).sum::<f64>() / 3.0;
    let sum: f64 = photons.iter().map(flux).sum();
    (sum > 0.0).then(|| sum / photons.len() as f64)
}

/// The median of the initial radii of the slots that have one; 0 if none has.
pub fn median(statistics: &[Statistics]) -> f32 {
    let mut radii2: Vec<f32> = statistics
        .iter()
        .map(|statistics| statistics.radius2_high)
        .filter(|&radius2| radius2 > 0.0)
        .collect();
    if radii2.is_empty() {
        return 0.0;
    }
    middle(&mut radii2).sqrt()
}

/// The median of at least one number.
fn middle(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[derive(Debug, Clone, Copy)]
struct Automatic {
    footprints: f32,
    photons: usize,
}

/// A probe's footprint, and squared distances of the nearest photons on its object.
struct Near {
    footprint: f32,
    distances2: Vec<f32>,
}

/// Chooses the number of photons that visible points should accept, so that noise and blur together are minimal, and R such that
/// the median point does. With α = 2/3 the squares of both decrease at the same rate, so the choice holds for any number of
/// iterations.
fn automatic(
    visible_points: &[VisiblePoint],
    footprints: &[f32],
    photons: &[&Photon],
    lists: &[&[usize]],
) -> Automatic {
    let mut automatic = Automatic {
        footprints: f32::INFINITY,
        photons: lists.first().map_or(1, |candidates| candidates[0]),
    };
    for candidates in lists {
        let probes = nearest(visible_points, footprints, photons, candidates);
        let errors2 = candidates
            .iter()
            .filter_map(|&count| Some((error2(&probes, candidates[0], count)?, count)));
        let Some((_, photons)) = errors2.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        let mut ratios: Vec<f32> = probes
            .iter()
            .filter_map(|near| Some(near.distances2.get(photons - 1)?.sqrt() / near.footprint))
            .collect();
        automatic = Automatic {
            footprints: middle(&mut ratios),
            photons,
        };
        if photons > candidates[0] {
            break;
        }
    }
    automatic
}

/// Squared relative error of densities from the nearest `count` photons: 1/count by noise, and the difference to the densities of
/// the nearest `fewest` by blur. `None` if no probe has that many photons.
fn error2(probes: &[Near], fewest: usize, count: usize) -> Option<f64> {
    let ratios: Vec<f64> = probes
        .iter()
        .map(|near| &near.distances2)
        .filter_map(|near| Some((near[fewest - 1], *near.get(count - 1)?)))
        .map(|(few, all)| count as f64 * f64::from(few) / (fewest as f64 * f64::from(all)))
        .collect();
    if ratios.is_empty() {
        return None;
    }
    // For a uniform density, few/all is Beta(fewest, count − fewest) distributed.
    let (few, all) = (fewest as f64, count as f64);
    let by_chance = (all - few) / (few * (all + 1.0));
    let squares: f64 = ratios.iter().map(|ratio| (ratio.min(MOST_BLUR) - 1.0).powi(2)).sum();
    Some(1.0 / all + (squares / ratios.len() as f64 - by_chance).max(0.0))
}

/// The nearest photons on the objects of sampled visible points, if there are as many as the first candidate.
fn nearest(
    visible_points: &[VisiblePoint],
    footprints: &[f32],
    photons: &[&Photon],
    candidates: &[usize],
) -> Vec<Near> {
    let [fewest, .., most] = *candidates else {
        return Vec::new();
    };
    let object_of = |photon: &Photon| photon.object & !CAUSTIC;
    let positions: Vec<[f32; 3]> = photons.iter().map(|photon| photon.position).collect();
    let seen: Vec<_> = visible_points
        .iter()
        .zip(footprints)
        .filter(|(point, _)| point.object != NO_OBJECT)
        .collect();
    let tree = KdTree::new(&positions);
    let step = seen.len().div_ceil(PROBES).max(1);
    let probes = seen.iter().step_by(step).map(|&(point, &footprint)| {
        let position = point.position;
        let object = point.object;
        let found = tree.nearest(position, 4 * most).into_iter();
        let on_object = found.filter(|&(_, photon)| object_of(photons[photon]) == object);
        Near {
            footprint,
            distances2: on_object.map(|(distance2, _)| distance2).take(most).collect(),
        }
    });
    // A photon exactly at the point gives no density.
    let enough = |near: &Near| {
        let least = near.distances2.get(fewest - 1);
        least.is_some_and(|&distance2| distance2 > 0.0)
    };
    probes.filter(enough).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::pcg4d;
    use bytemuck::Zeroable;

    /// Numbers in [0, 1), the same in every run.
    fn random(index: u32) -> [f32; 4] {
        pcg4d([index, 1, 2, 3]).map(|word| (word >> 8) as f32 / (1 << 24) as f32)
    }

    const FOOTPRINT: f32 = 2e-3;

    /// On the unit square: visible points evenly, photons where `place` puts two random numbers.
    fn choose(caustic: bool, place: impl Fn(f32, f32) -> [f32; 2]) -> First {
        let points: Vec<VisiblePoint> = (0..2000)
            .map(|i| {
                let [x, y, ..] = random(1_000_000 + i);
                VisiblePoint {
                    position: [0.1 + 0.8 * x, 0.1 + 0.8 * y, 0.0],
                    ..VisiblePoint::zeroed()
                }
            })
            .collect();
        let photons: Vec<Photon> = (0..20_000)
            .map(|i| {
                let [u, v, ..] = random(i);
                let [x, y] = place(u, v);
                Photon {
                    position: [x, y, 0.0],
                    object: if caustic { CAUSTIC } else { 0 },
                    ..Photon::zeroed()
                }
            })
            .collect();
        first(&points, &[FOOTPRINT; 2000], &photons, 1.0)[usize::from(caustic)]
    }

    #[test]
    fn even_photons_get_a_large_radius_and_it_holds_as_many() {
        let First { footprints, photons } = choose(false, |x, y| [x, y]);
        let radius2 = (footprints * FOOTPRINT).powi(2);
        assert!(photons >= 48, "{photons} photons");
        let held = 20_000.0 * std::f32::consts::PI * radius2;
        assert!(
            (held / photons as f32 - 1.0).abs() < 0.1,
            "R² {radius2} holds {held} photons"
        );
    }

    #[test]
    fn photons_in_fine_lines_get_a_small_one() {
        let lines = choose(false, |x, y| {
            [((10.0 * x).floor() + (10.0 * x).fract() * 0.1) / 10.0, y]
        });
        assert!(lines.photons <= 16, "{lines:?}");
    }

    #[test]
    fn caustics_get_small_ones_and_those_of_sharp_edges_the_smallest() {
        let even = choose(true, |x, y| [x, y]);
        let edges = choose(true, |x, y| [0.45 + 0.1 * x, 0.45 + 0.1 * y]);
        assert_eq!(even.photons, 16, "{even:?}");
        assert!(edges.photons < 8, "{edges:?}");
    }

    #[test]
    fn without_photons_the_footprints_bound_holds() {
        let first = first(&[], &[], &[], 1.0).map(|first| first.footprints);
        assert_eq!(first, MOST_FOOTPRINTS);
    }
}
