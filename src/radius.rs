//! The initial radius, where the user gives none.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::layout::{NO_OBJECT, Photon, VisiblePoint};

/// How many photons a visible point may be wanted to accept in the first iteration. The first is what the others' blur is
/// measured against.
const CANDIDATES: [usize; 7] = [8, 12, 16, 24, 32, 48, 64];
/// The iteration whose photons the radius is found from; no render gets that far.
pub const PILOT: u32 = u32::MAX;
/// Rounds of shrinking the radius where photons are denser than wanted.
pub const FITS: u32 = 2;
/// A density that is more times too high counts as so many times too high: it is in the dark.
const MOST_BLUR: f64 = 4.0;
/// Visible points that are asked.
const PROBES: usize = 2048;
/// R² where no visible point sees enough photons, square render units (the scene is 2 long).
const WITHOUT_PHOTONS: f32 = 4e-4;

/// The automatic initial radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Automatic {
    /// R², square render units.
    pub radius2: f32,
    /// Photons that a visible point should accept in the first iteration, at the most; the median one finds as many
    /// within R.
    pub photons: usize,
}

/// Chooses how many photons visible points should accept, so that noise and blur together are least, and R² such that the
/// median one does. With α = 2/3 the squares of both fall alike, so that the choice holds for any number of iterations.
pub fn automatic(visible_points: &[VisiblePoint], photons: &[Photon]) -> Automatic {
    let distances2 = nearest(visible_points, photons);
    let choice = CANDIDATES
        .into_iter()
        .filter_map(|count| Some((error2(&distances2, count)?, count)))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, photons)) = choice else {
        return Automatic {
            radius2: WITHOUT_PHOTONS,
            photons: CANDIDATES[0],
        };
    };
    let mut radii2: Vec<f32> = distances2
        .iter()
        .filter_map(|near| near.get(photons - 1))
        .copied()
        .collect();
    let middle = radii2.len() / 2;
    let (_, radius2, _) = radii2.select_nth_unstable_by(middle, f32::total_cmp);
    Automatic {
        radius2: *radius2,
        photons,
    }
}

/// Squared relative error of densities from the nearest `count` photons: 1/count of noise, and of blur what they differ
/// from those of the first candidate. `None` if no probe has so many photons.
fn error2(distances2: &[Vec<f32>], count: usize) -> Option<f64> {
    let fewest = CANDIDATES[0];
    let ratios: Vec<f64> = distances2
        .iter()
        .filter_map(|near| Some((near[fewest - 1], *near.get(count - 1)?)))
        .map(|(few, all)| count as f64 * f64::from(few) / (fewest as f64 * f64::from(all)))
        .collect();
    if ratios.is_empty() {
        return None;
    }
    // Of photons that lie evenly, few/all is Beta(fewest, count − fewest) distributed.
    let (few, all) = (fewest as f64, count as f64);
    let by_chance = (all - few) / (few * (all + 1.0));
    let squares: f64 = ratios.iter().map(|ratio| (ratio.min(MOST_BLUR) - 1.0).powi(2)).sum();
    Some(1.0 / all + (squares / ratios.len() as f64 - by_chance).max(0.0))
}

/// Of some visible points, the squared distances of the nearest photons on their object, if there are as many as the first
/// candidate.
fn nearest(visible_points: &[VisiblePoint], photons: &[Photon]) -> Vec<Vec<f32>> {
    let most = CANDIDATES[CANDIDATES.len() - 1];
    let positions: Vec<[f32; 3]> = photons
        .iter()
        .map(|photon| [0, 1, 2].map(|axis| photon.position_object[axis]))
        .collect();
    let seen: Vec<&VisiblePoint> = visible_points
        .iter()
        .filter(|point| point.position_object[3].to_bits() != NO_OBJECT)
        .collect();
    if positions.is_empty() {
        return Vec::new();
    }
    let (Ok(tree), Some(asked)) = (ImmutableKdTree::new_from_slice(&positions), NonZero::new(4 * most)) else {
        return Vec::new();
    };
    let step = seen.len().div_ceil(PROBES).max(1);
    let probes = seen.iter().step_by(step).map(|point| {
        let position = [0, 1, 2].map(|axis| point.position_object[axis]);
        let object = point.position_object[3].to_bits();
        let found = tree
            .query(&position)
            .nearest_n::<SquaredEuclidean<f32>>(asked)
            .execute();
        let on_object = found
            .iter()
            .filter(|near| photons[near.item as usize].position_object[3].to_bits() == object);
        on_object.map(|near| near.distance).take(most).collect::<Vec<f32>>()
    });
    // A photon at the very point says nothing of densities.
    let enough = |near: &Vec<f32>| near.get(CANDIDATES[0] - 1).is_some_and(|&distance2| distance2 > 0.0);
    probes.filter(enough).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::pcg4d;

    /// Numbers in [0, 1), the same in every run.
    fn random(index: u32) -> [f32; 4] {
        pcg4d([index, 1, 2, 3]).map(|word| (word >> 8) as f32 / (1 << 24) as f32)
    }

    /// On the unit square: visible points evenly, photons where `place` puts two random numbers.
    fn choose(place: impl Fn(f32, f32) -> [f32; 2]) -> Automatic {
        let points: Vec<VisiblePoint> = (0..2000)
            .map(|i| {
                let [x, y, ..] = random(1_000_000 + i);
                VisiblePoint {
                    position_object: [0.1 + 0.8 * x, 0.1 + 0.8 * y, 0.0, f32::from_bits(0)],
                    weight_normal: [0.0; 4],
                    emitted_normal: [0.0; 4],
                }
            })
            .collect();
        let photons: Vec<Photon> = (0..20_000)
            .map(|i| {
                let [u, v, ..] = random(i);
                let [x, y] = place(u, v);
                Photon {
                    position_object: [x, y, 0.0, f32::from_bits(0)],
                    flux_direction: [0.0; 4],
                }
            })
            .collect();
        automatic(&points, &photons)
    }

    #[test]
    fn even_photons_get_a_large_radius_and_it_holds_as_many() {
        let Automatic { radius2, photons } = choose(|x, y| [x, y]);
        assert!(photons >= 48, "{photons} photons");
        let held = 20_000.0 * std::f32::consts::PI * radius2;
        assert!(
            (held / photons as f32 - 1.0).abs() < 0.1,
            "R² {radius2} holds {held} photons"
        );
    }

    #[test]
    fn photons_in_fine_lines_get_a_small_one() {
        let lines = choose(|x, y| [((10.0 * x).floor() + (10.0 * x).fract() * 0.1) / 10.0, y]);
        assert!(lines.photons <= 16, "{lines:?}");
    }

    #[test]
    fn without_photons_there_is_a_radius_all_the_same() {
        assert_eq!(automatic(&[], &[]).radius2, WITHOUT_PHOTONS);
    }
}
