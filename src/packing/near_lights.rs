//! Regions near a light: the squared distance to its points varies without bound there, and BSDF samples are the better strategy.
//! Elsewhere points of the light alone are better, because no ray misses.

use std::ops::Range;

use glam::Vec3;

use super::part::Part;
use super::sphere::Sphere;
use crate::layout::{ENVIRONMENT_LIGHT, Light, TRIANGLE_LIGHT};
use crate::scene::Environment;

/// Radius of the near region, in radii of the light: outside, no point of the light is more than three times as far as another
/// one.
const REACH: f64 = 2.0;
/// Minimum and maximum probability of a BSDF sample near a light.
const SAMPLING: [f64; 2] = [0.05, 0.5];

/// The data for the near regions of lights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NearLights<'a> {
    pub lights: &'a [Light],
    /// Power of each light; 0 if it is surely dark.
    pub powers: &'a [f64],
    /// Ranges of lights.
    pub sources: &'a [Range<u32>],
    /// Corners of all triangles, in the order of the BVH's leaves.
    pub corners: &'a [[Vec3; 3]],
    pub environment: Option<&'a Environment>,
}

impl NearLights<'_> {
    /// A sphere around each source that rays can hit: its centre, and the squared radius of the near region. An environment is
    /// near everywhere.
    pub fn spheres(&self) -> Vec<[f32; 4]> {
        if self.environment.is_some() {
            return vec![[0.0, 0.0, 0.0, f32::INFINITY]];
        }
        let sphere = |source: &Range<u32>| match self.lights[source.start as usize].kind {
            TRIANGLE_LIGHT => self.around(source),
            _ => None,
        };
        self.sources.iter().filter_map(sphere).collect()
    }

    /// The lights of a range that have power.
    fn with_power(&self, range: Range<usize>) -> impl Iterator<Item = &Light> + Clone {
        let with_powers = self.lights[range.clone()].iter().zip(&self.powers[range]);
        with_powers.filter(|(_, power)| **power > 0.0).map(|(light, _)| light)
    }

    fn around(&self, source: &Range<u32>) -> Option<[f32; 4]> {
        let of_light =
            |light: &Light| Part::of(light).corners(self.corners[light.triangle as usize].map(Vec3::as_dvec3));
        let lights = self.with_power(source.start as usize..source.end as usize);
        let sphere = Sphere::around(lights.flat_map(of_light))?;
        let radius2 = (REACH * sphere.radius).powi(2);
        Some(sphere.centre.as_vec3().extend(radius2 as f32).to_array())
    }

    /// Probability of a BSDF sample near a light: approximately the probability that it hits one. That is the emissive share of
    /// the scene's area, or the share of directions that the environment's light comes from, half of which lie below a surface.
    pub fn bsdf_sampling(&self, area_of_all: f64) -> f32 {
        let environments = self.lights.iter().filter(|light| light.kind == ENVIRONMENT_LIGHT);
        let from_afar: f64 = environments
            .zip(self.environment)
            .map(|(light, environment)| f64::from(light.probability) * environment.spread())
            .sum();
        let triangles = self
            .with_power(0..self.lights.len())
            .filter(|light| light.kind == TRIANGLE_LIGHT);
        let emissive: f64 = triangles.map(|light| f64::from(light.area)).sum();
        (emissive / area_of_all + 0.5 * from_afar).clamp(SAMPLING[0], SAMPLING[1]) as f32
    }
}
