//! Coverage: which part of the disc around a visible point can receive photons, and whether any surface surrounds the point.

use glam::DVec3;

use super::intersect::{Progress, Ray, nearest_hit, nearest_hit_from};
use super::sampling::{basis, cosine_direction, disc_point};
use super::surface::{Surface, surface_of};
use super::texture::opacity;
use super::{FAR, Inputs};
use crate::layout::{BACKED, COINCIDENT, COVERAGE_CROSSINGS, DIELECTRIC, MATTE, SEE_THROUGH};

/// A visible point whose coverage is sampled.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Ray origin on the side of [`Self::normal`].
    pub origin: DVec3,
    /// Geometric normal on the visible side.
    pub normal: DVec3,
    /// Only photons on this object count.
    pub object: u32,
}

/// The side of an object that a ray hits.
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

/// Whether the point of the disc chosen by `u` can receive photons. It cannot beyond the edge of the object, or inside an opaque
/// object that stands on it.
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
        // Light passes glass and partly transparent surfaces.
        if surface.material.surface != DIELECTRIC && surface.flags & SEE_THROUGH == 0 {
            let side = Side::of(&surface, along);
            entered = if entered.is_none() { Some(side) } else { None };
        }
        progress = Progress::past(hit);
        ignored = Some(hit.at);
    }
    // An open surface has been crossed, but it encloses nothing.
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
    // Then down: the surface may bend, but it must exist, also below glass that lies on it and coincident faces.
    let down = Ray {
        origin: origin + along,
        direction: -radius * normal,
    };
    let mut progress = Progress::AT_ORIGIN;
    for _ in 0..COVERAGE_CROSSINGS {
        let Some(hit) = nearest_hit_from(inputs, down, progress, 1.0, None) else {
            return false;
        };
        let below = surface_of(inputs.scene, hit);
        if below.object == object {
            return opacity(inputs.scene, &below) > 0.0;
        }
        let lies_on = below.flags & (COINCIDENT | BACKED) != 0;
        if !(lies_on || (inputs.scene.features.coincident_interfaces && below.material.surface == DIELECTRIC)) {
            return false;
        }
        progress = Progress::past(hit);
    }
    false
}

/// Whether a ray hits a surface, possibly behind glass, that can scatter or reflect light.
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
