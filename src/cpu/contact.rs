//! Dielectrics that lie on other objects: the counterpart of `glsl/shared/contact.glsl`.

use glam::DVec3;

use super::Inputs;
use super::intersect::{Hit, Ray, nearest_hit};
use super::surface::{DIELECTRIC, Facing, ROUNDINGS, Surface, surface_at};
use super::vector::rgb;
use crate::layout::TOUCHED;

/// Where a ray meets matter.
pub(super) struct Encounter<'a> {
    pub surface: Surface<'a>,
    pub facing: Facing,
    /// Index of a dielectric's inside over that of its outside.
    pub ior: f64,
    /// What light keeps that passes a dielectric boundary, of both sides.
    pub tint: DVec3,
}

impl<'a> Encounter<'a> {
    /// Which of two faces in one place comes first is chance: both are crossed at once. Glass on glass is one boundary between
    /// the two; on something opaque that is what the ray meets.
    pub fn new(inputs: &Inputs<'a>, hit: Hit, incoming: DVec3) -> Self {
        let at = |hit: Hit| surface_at(inputs.scene, hit.triangle, hit.u, hit.v);
        let surface = at(hit);
        let alone = |surface: Surface<'a>| Self {
            facing: Facing::new(&surface, incoming),
            ior: f64::from(surface.material.ior),
            tint: rgb(surface.material.base_color),
            surface,
        };
        if surface.flags & TOUCHED == 0 {
            return alone(surface);
        }
        let n = surface.geometric_normal;
        let step = ROUNDINGS * n.abs().dot(surface.reach);
        let probe = ROUNDINGS * surface.reach.element_sum() * n;
        let through = Ray {
            origin: surface.position + probe,
            direction: -2.0 * probe,
        };
        let touches = |other: &Surface<'_>| {
            other.object != surface.object && (other.position - surface.position).dot(n).abs() <= step
        };
        let other = nearest_hit(inputs, through, 1.0, Some(hit.triangle)).map(at);
        match other.filter(touches) {
            Some(other) if other.material.surface != DIELECTRIC => alone(other),
            Some(other) if other.geometric_normal.dot(n) < 0.0 => Self {
                ior: f64::from(surface.material.ior) / f64::from(other.material.ior),
                tint: rgb(surface.material.base_color) * rgb(other.material.base_color),
                ..alone(surface)
            },
            _ => alone(surface),
        }
    }
}
