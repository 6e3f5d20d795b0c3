//! Emissive triangles: `glsl/shared/light.glsl`.

use crate::layout::{Light, Material};

/// The light at `u` in [0, 1): the first whose cumulative probability is above.
pub(super) fn choose_light(lights: &[Light], u: f64) -> &Light {
    let index = lights.partition_point(|light| f64::from(light.cumulative) <= u);
    &lights[index.min(lights.len() - 1)]
}

/// Whether light leaves on the triangle's front, or on its back.
pub(super) fn emits(material: &Material, front: bool) -> bool {
    front || material.double_sided != 0
}
