//! Lights: punctual lights (`KHR_lights_punctual`), and objects whose material emits.

use std::f64::consts::PI;

use glam::Vec3;

use super::{Object, Scene};

/// The kind of a punctual light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// In all directions.
    Point,
    /// Around an axis: at full intensity up to the inner angle, then less, and 0 beyond the outer angle.
    Spot {
        /// Unit vector along the axis.
        direction: Vec3,
        /// 1 − cos of the inner angle.
        inner: f64,
        /// 1 − cos of the outer angle, larger than `inner`.
        outer: f64,
        /// Whether the falloff is a smoothstep, as in Blender, instead of the square of a ramp, as in glTF.
        smooth: bool,
    },
    /// Along parallel rays, from infinitely far.
    Directional {
        /// Unit vector along the rays.
        direction: Vec3,
    },
}

/// A punctual light, in render space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PunctualLight {
    /// Point, spot or directional.
    pub kind: LightKind,
    /// Position; without meaning if its rays are parallel.
    pub position: Vec3,
    /// Point, spot: radiant intensity along the axis. Directional: irradiance across the rays. Linear RGB. Never black.
    pub intensity: Vec3,
    /// Extent: the radius of a point or spot, in render units, which looks like a ball of that radius; half of the angle that a
    /// directional light subtends, in radians. 0 for a delta light.
    pub extent: f64,
    /// Point, spot: the range, in render units; `None` if it is unlimited.
    pub range: Option<f64>,
}

impl PunctualLight {
    /// Emitted power: mean of the RGB intensity, times the solid angle that gives the same flux at full intensity, or times the
    /// area across the rays, here of a disc, that covers the scene.
    pub fn power(&self, disc_area: f64) -> f64 {
        let intensity = self.intensity.as_dvec3().element_sum() / 3.0;
        intensity
            * match self.kind {
                LightKind::Point => 4.0 * PI,
                // The integral of a squared ramp is a third of its width, that of a smoothstep a half.
                LightKind::Spot {
                    inner, outer, smooth, ..
                } => 2.0 * PI * (inner + (outer - inner) / if smooth { 2.0 } else { 3.0 }),
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

    /// Whether any object emits light.
    pub(crate) fn has_emissive_triangles(&self) -> bool {
        self.emitting_objects().next().is_some()
    }
}
