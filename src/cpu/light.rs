//! Emissive triangles: `glsl/shared/light.glsl`.

use crate::layout::{Light, Material};

/// A light, and the part of [0, 1) that chooses it.
pub(super) struct Choice<'a> {
    pub light: &'a Light,
    pub before: f64,
    pub width: f64,
}

/// The light at `u` in [0, 1): the first whose cumulative probability is above.
pub(super) fn choose_light(lights: &[Light], u: f64) -> Choice<'_> {
    let index = lights
        .partition_point(|light| f64::from(light.cumulative) <= u)
        .min(lights.len() - 1);
    let before = if index == 0 {
        0.0
    } else {
        lights[index - 1].cumulative.into()
    };
    Choice {
        light: &lights[index],
        before,
        width: f64::from(lights[index].cumulative) - before,
    }
}

/// Whether light leaves on the triangle's front, or on its back.
pub(super) fn emits(material: &Material, front: bool) -> bool {
    front || material.double_sided != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_is_chosen_between_the_cumulative_probabilities() {
        let light = |triangle, cumulative| Light {
            triangle,
            cumulative,
            probability: 0.0,
            area: 0.0,
        };
        // The last one's may be rounded to less than 1.
        let lights = [light(0, 0.25), light(1, 0.25), light(2, 0.75), light(3, 0.999)];
        let chosen = |u: f64| choose_light(&lights, u).light.triangle;
        assert_eq!(
            [0.0, 0.2499, 0.25, 0.7499, 0.75, 0.9999].map(chosen),
            [0, 0, 2, 2, 3, 3]
        );
    }
}
