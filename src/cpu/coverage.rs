//! How much of the discs around visible points can have photons.

use glam::DVec3;
use rayon::prelude::*;

use super::intersect::{Ray, nearest_hit};
use super::random::{PathKind, Random};
use super::sampling::{basis, decode_direction, disc_point};
use super::surface::{DIELECTRIC, Surface, offset_origin, reach_of, surface_of};
use super::texture::share_there;
use super::vector::{word, xyz};
use super::{FAR, Inputs};
use crate::layout::{Coverage, NO_OBJECT, SEE_THROUGH, Statistics, VisiblePoint};

/// What an iteration counts for, whatever its points.
const WHOLE: u32 = 16;
/// Surfaces that are crossed on the way at the most.
const MOST_CROSSINGS: u32 = 4;

/// Asks points of the disc of radius R around each visible point: past the edge of the object, or inside an opaque one that
/// stands on it, there are no photons.
pub fn coverage(
    inputs: &Inputs<'_>,
    iteration: u32,
    visible_points: &[VisiblePoint],
    statistics: &[Statistics],
    coverage: &mut [Coverage],
) {
    let points = inputs.config.coverage_points(iteration);
    let slots = coverage.par_iter_mut().zip(visible_points).zip(statistics).enumerate();
    slots.for_each(|(slot, ((coverage, point), statistics))| {
        if word(point.position_object) == NO_OBJECT {
            return;
        }
        let random = Random::of_pixel(inputs, PathKind::Coverage, slot as u32, iteration);
        let radius = f64::from(statistics.radius2_high).sqrt();
        let covered = (0..points).filter(|&number| {
            let [u, v, ..] = random.sample_of(number, points).next4();
            can_have_photons(inputs, point, radius, u, v)
        });
        coverage.covered += covered.count() as u32 * (WHOLE / points);
        coverage.asked += WHOLE;
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

fn can_have_photons(inputs: &Inputs<'_>, point: &VisiblePoint, radius: f64, u: f64, v: f64) -> bool {
    let object = word(point.position_object);
    let n = decode_direction(word(point.weight_normal));
    let origin = offset_origin(xyz(point.position_object), n, reach_of(inputs.scene, object));
    let along = basis(n) * (radius * disc_point(u, v)).extend(0.0);
    // Along the surface, into other objects and out of them again.
    let (mut entered, mut ignored, mut done) = (None, None, 0.0);
    for _ in 0..MOST_CROSSINGS {
        let ray = Ray {
            origin: origin + done * along,
            direction: (1.0 - done) * along,
        };
        let Some(hit) = nearest_hit(inputs, ray, 1.0, ignored) else {
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
        done += hit.t * (1.0 - done);
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
    // Then down: it may bend, but it must be there, under glass that lies on it too.
    let down = Ray {
        origin: origin + along,
        direction: -radius * n,
    };
    let mut below = nearest_hit(inputs, down, 1.0, None);
    if let Some(hit) = below
        && inputs.scene.features.contact
        && let met = surface_of(inputs.scene, hit)
        && met.object != object
        && met.material.surface == DIELECTRIC
    {
        below = nearest_hit(inputs, down, 1.0, Some(hit.at));
    }
    below.is_some_and(|hit| {
        let there = surface_of(inputs.scene, hit);
        there.object == object && share_there(inputs.scene, &there) > 0.0
    })
}
