//! How much of the discs around visible points can have photons.

use glam::DVec3;
use rayon::prelude::*;

use super::intersect::{Progress, Ray, nearest_hit, nearest_hit_from};
use super::sampling::{basis, cosine_direction, decode_direction, disc_point};
use super::surface::{Surface, offset_origin, reach_of, surface_of};
use super::texture::share_there;
use super::vector::{word, xyz};
use super::{FAR, Inputs};
use crate::layout::{
    BACKED, COINCIDENT, COVERAGE_CROSSINGS, COVERAGE_TRUSTED, COVERAGE_WHOLE, Coverage, DIELECTRIC, Gathered, MATTE,
    NO_OBJECT, SEE_THROUGH, Statistics, VisiblePoint,
};
use crate::random::Random;

/// Asks points of the disc of radius R around each visible point, for each photon map: past the edge of the object, or inside
/// an opaque one that stands on it, there are no photons. As long as a point has had no photon, a ray into its hemisphere says
/// whether it lies in the open, where none has to come.
pub fn coverage(
    inputs: &Inputs<'_>,
    iteration: u32,
    visible_points: &[VisiblePoint],
    radii2: &[f32],
    (statistics, gathered): (&[Statistics], &[Gathered]),
    coverage: &mut [Coverage],
) {
    let points = inputs.config.coverage_points(iteration);
    let has_caustic_photons = |slot: usize| {
        let caustic = statistics.get(visible_points.len() + slot);
        caustic.is_some_and(|statistics| (statistics.accepted_low | statistics.accepted_high) != 0)
    };
    let receivers = coverage.par_iter_mut().zip(radii2).zip(statistics).zip(gathered);
    receivers
        .enumerate()
        .for_each(|(index, (((coverage, &radius2), statistics), gathered))| {
            let slot = index % visible_points.len();
            let point = &visible_points[slot];
            if word(point.position_object) == NO_OBJECT {
                return;
            }
            // Without photons there is nothing to correct.
            let photons = statistics.accepted_low | statistics.accepted_high | gathered.count;
            let trusted = coverage.covered == coverage.asked && coverage.asked >= COVERAGE_TRUSTED * COVERAGE_WHOLE;
            let random = Random::of_disc(inputs.config, slot as u32, iteration, points);
            if photons == 0 && index < visible_points.len() && coverage.surrounded == 0 && !has_caustic_photons(slot) {
                let mut behind = random;
                behind.skip_to(COVERAGE_WHOLE); // those of the disc
                let [u, v, ..] = behind.next4();
                coverage.surrounded = u32::from(is_surrounded(inputs, point, u, v));
            }
            if photons == 0 || (trusted && !(iteration as usize + slot / 64).is_multiple_of(8)) {
                return;
            }
            let radius = f64::from(radius2).sqrt();
            let covered = (0..points).filter(|&number| {
                let [u, v, ..] = random.sample_of(number, points).next4();
                can_have_photons(inputs, point, radius, [u, v])
            });
            coverage.covered += covered.count() as u32 * (COVERAGE_WHOLE / points);
            coverage.asked += COVERAGE_WHOLE;
        });
}

/// The side of an object that a ray meets.
#[derive(Clone, Copy)]
struct Side {
    object: u32,
    front: bool,
}

impl Side {
    fn of(surface: &Surface, direction: DVec3) -> Self {
        Self {
            object: surface.object,
            front: surface.geometric_normal.dot(direction) < 0.0,
        }
    }
}

fn can_have_photons(inputs: &Inputs<'_>, point: &VisiblePoint, radius: f64, [u, v]: [f64; 2]) -> bool {
    let object = word(point.position_object);
    let n = decode_direction(word(point.weight_normal));
    let origin = offset_origin(xyz(point.position_object), n, reach_of(inputs.scene, object));
    let along = basis(n) * (radius * disc_point(u, v)).extend(0.0);
    // Along the surface, into other objects and out of them again.
    let (mut entered, mut ignored, mut progress) = (None, None, Progress::AT_ORIGIN);
    let ray = Ray {
        origin,
        direction: along,
    };
    for _ in 0..COVERAGE_CROSSINGS {
        let Some(hit) = nearest_hit_from(inputs, ray, progress, 1.0, None) else {
            break;
        };
        let surface = surface_of(inputs.scene, hit);
        if surface.object == object {
            return true; // the surface bends up
        }
        // Light passes glass, and what isn't there everywhere.
        if surface.material.surface != DIELECTRIC && surface.flags & SEE_THROUGH == 0 {
            let side = Side::of(&surface, along);
            entered = if entered.is_none() { Some(side) } else { None };
        }
        progress = Progress::past(hit);
        ignored = Some(hit.at);
    }
    // An open sheet has been crossed, but encloses nothing.
    let leaves = |direction: DVec3, entered: Side| {
        let ray = Ray {
            origin: origin + along,
            direction,
        };
        nearest_hit(inputs, ray, FAR, ignored).is_some_and(|hit| {
            let left = Side::of(&surface_of(inputs.scene, hit), direction);
            left.object == entered.object && left.front != entered.front
        })
    };
    if entered.is_some_and(|entered| leaves(along, entered) && leaves(n, entered)) {
        return false;
    }
    // Then down: it may bend, but it must be there, under glass that lies on it and other faces in its place too.
    let down = Ray {
        origin: origin + along,
        direction: -radius * n,
    };
    let mut progress = Progress::AT_ORIGIN;
    for _ in 0..COVERAGE_CROSSINGS {
        let Some(hit) = nearest_hit_from(inputs, down, progress, 1.0, None) else {
            return false;
        };
        let there = surface_of(inputs.scene, hit);
        if there.object == object {
            return share_there(inputs.scene, &there) > 0.0;
        }
        let lies_on = there.flags & (COINCIDENT | BACKED) != 0;
        if !(lies_on || (inputs.scene.features.contact && there.material.surface == DIELECTRIC)) {
            return false;
        }
        progress = Progress::past(hit);
    }
    false
}

/// Whether a ray meets something, past glass, that may scatter light or mirror it.
fn is_surrounded(inputs: &Inputs<'_>, point: &VisiblePoint, u: f64, v: f64) -> bool {
    let n = decode_direction(word(point.weight_normal));
    let direction = cosine_direction(n, u, v);
    let mut origin = offset_origin(
        xyz(point.position_object),
        n,
        reach_of(inputs.scene, word(point.position_object)),
    );
    let mut ignored = None;
    for _ in 0..=COVERAGE_CROSSINGS {
        let Some(hit) = nearest_hit(inputs, Ray { origin, direction }, FAR, ignored) else {
            return false;
        };
        let surface = surface_of(inputs.scene, hit);
        let passes = surface.material.surface == DIELECTRIC || surface.flags & SEE_THROUGH != 0;
        if !passes {
            return surface.material.surface != MATTE || surface.material.base_color[..3] != [0.0; 3];
        }
        origin = surface.origin_towards(direction);
        ignored = Some(hit.at);
    }
    false
}
