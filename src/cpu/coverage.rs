//! Which points of the disc around a visible point can have photons, and whether anything is around it.

use glam::DVec3;

use super::intersect::{Progress, Ray, nearest_hit, nearest_hit_from};
use super::sampling::{basis, cosine_direction, disc_point};
use super::surface::{Surface, surface_of};
use super::texture::share_there;
use super::{FAR, Inputs};
use crate::layout::{BACKED, COINCIDENT, COVERAGE_CROSSINGS, DIELECTRIC, MATTE, SEE_THROUGH};

/// A visible point as coverage is asked for there.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Where rays leave it along [`Self::normal`].
    pub origin: DVec3,
    /// Geometric, on the side that is seen.
    pub normal: DVec3,
    /// Photons count on this object alone.
    pub object: u32,
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

/// Whether the point of a disc that `u` chooses can have photons: not past the edge of the object, nor inside an opaque one that
/// stands on it.
pub fn can_have_photons(inputs: &Inputs<'_>, place: Place, radius: f64, u: [f64; 2]) -> bool {
    let Place { origin, normal, object } = place;
    let along = basis(normal) * (radius * disc_point(u[0], u[1])).extend(0.0);
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
    if entered.is_some_and(|entered| leaves(along, entered) && leaves(normal, entered)) {
        return false;
    }
    // Then down: it may bend, but it must be there, under glass that lies on it and other faces in its place too.
    let down = Ray {
        origin: origin + along,
        direction: -radius * normal,
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
        if !(lies_on || (inputs.scene.features.coincident_interfaces && there.material.surface == DIELECTRIC)) {
            return false;
        }
        progress = Progress::past(hit);
    }
    false
}

/// Whether a ray meets something, past glass, that may scatter light or mirror it.
pub fn is_surrounded(inputs: &Inputs<'_>, place: Place, u: [f64; 2]) -> bool {
    let direction = cosine_direction(place.normal, u[0], u[1]);
    let ray = Ray {
        origin: place.origin,
        direction,
    };
    let mut progress = Progress::AT_ORIGIN;
    for _ in 0..=COVERAGE_CROSSINGS {
        let Some(hit) = nearest_hit_from(inputs, ray, progress, FAR, None) else {
            return false;
        };
        let surface = surface_of(inputs.scene, hit);
        let passes = surface.material.surface == DIELECTRIC || surface.flags & SEE_THROUGH != 0;
        if !passes {
            return surface.material.surface != MATTE || surface.material.base_color[..3] != [0.0; 3];
        }
        progress = Progress::past(hit);
    }
    false
}
