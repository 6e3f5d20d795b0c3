//! Lights: those that are points or directions (`KHR_lights_punctual`), and objects whose material emits.

use std::f64::consts::PI;

use glam::Vec3;

use super::{Object, Scene};

/// The kind of a punctual light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// In all directions.
    Point,
    /// Around an axis, all of it up to the inner angle, then less, and nothing past the outer angle.
    Spot {
        /// Unit vector along the axis.
        direction: Vec3,
        /// 1 − cos of the inner angle.
        inner: f64,
        /// 1 − cos of the outer angle, larger than `inner`.
        outer: f64,
    },
    /// Along parallel rays, from infinitely far.
    Directional {
        /// Unit vector along the rays.
        direction: Vec3,
    },
}

/// A light that is no surface, in render space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PunctualLight {
    /// Point, spot or directional.
    pub kind: LightKind,
    /// Where it is; of no meaning where its rays are parallel.
    pub position: Vec3,
    /// Point, spot: radiant intensity along the axis. Directional: irradiance across the rays. Linear RGB. Never black.
    pub intensity: Vec3,
    /// How large it is: the radius of a point or spot, in render units, which is seen as a ball of it; half of the angle that a
    /// directional one takes up, in radians. 0 where it has no extent.
    pub extent: f64,
    /// Point, spot: the distance that it reaches, in render units; `None` where it reaches any.
    pub range: Option<f64>,
}

impl PunctualLight {
    /// Emitted power: mean of the RGB intensity times the solid angle that would have it all over, or times the area across
    /// the rays, here of a disc, that meets the scene.
    pub fn power(&self, disc_area: f64) -> f64 {
        let intensity = self.intensity.as_dvec3().element_sum() / 3.0;
        intensity
            * match self.kind {
                LightKind::Point => 4.0 * PI,
                // The falloff is the square of a ramp, whose integral is a third of its width.
                LightKind::Spot { inner, outer, .. } => 2.0 * PI * (inner + (outer - inner) / 3.0),
                LightKind::Directional { .. } => disc_area,
            }
    }
}

impl Scene {
    /// Objects that emit light, with the exitance of their sides together, mean of RGB, as if there were no textures.
    pub(crate) fn emitting_objects(&self) -> impl Iterator<Item = (&Object, f64)> {
        self.objects.iter().filter_map(|object| {
            let material = &self.materials[object.material as usize];
            let radiance = material.emission.as_dvec3().element_sum() / 3.0;
            let sides = if material.back_emits { 2.0 } else { 1.0 };
            (radiance > 0.0 && !material.unlit).then_some((object, radiance * PI * sides))
        })
    }

    /// Whether anything in it emits light.
    pub(crate) fn has_emissive_triangles(&self) -> bool {
        self.emitting_objects().next().is_some()
    }
}
