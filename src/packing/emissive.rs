//! Area lights: the triangles whose material emits.

use super::emission_distribution::EmissionDistribution;
use crate::scene::Scene;

/// A triangle that emits light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmissiveTriangle {
    /// Index into [`Scene::triangles`].
    pub triangle: u32,
    /// Its area, in square render units.
    pub area: f64,
    /// Emitted power: mean of the RGB radiance × π × area, twice that if both sides emit. Always positive.
    pub power: f64,
}

impl Scene {
    /// Number of triangles that emit light.
    pub fn emissive_triangle_count(&self) -> usize {
        self.emitting_objects().map(|(object, _)| object.triangles.len()).sum()
    }

    /// The triangles that emit light, in the order of [`Scene::triangles`].
    ///
    /// Photons are emitted, and lights sampled, nearly in proportion to their powers.
    pub fn emissive_triangles(&self) -> Vec<EmissiveTriangle> {
        self.emission_distributions()
            .0
            .into_iter()
            .map(|(emissive, _)| emissive)
            .collect()
    }

    /// Each with its emission distribution, and whether some distributions would need a finer resolution.
    pub(crate) fn emission_distributions(&self) -> (Vec<(EmissiveTriangle, EmissionDistribution)>, bool) {
        let even: Vec<EmissiveTriangle> = self
            .emitting_objects()
            .flat_map(|(object, exitance)| {
                object.triangles.clone().map(move |triangle| {
                    let area = self.triangle_area(triangle);
                    EmissiveTriangle {
                        triangle,
                        area,
                        power: exitance * area,
                    }
                })
            })
            .collect();
        let (distributions, is_coarse) = EmissionDistribution::of_all(self, &even);
        let emissive = |(even, distribution): (EmissiveTriangle, EmissionDistribution)| {
            let power = even.power * distribution.mean;
            (EmissiveTriangle { power, ..even }, distribution)
        };
        (even.into_iter().zip(distributions).map(emissive).collect(), is_coarse)
    }
}
