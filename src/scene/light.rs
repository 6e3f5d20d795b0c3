//! Area lights: the triangles whose material emits.

use std::f64::consts::PI;

use super::shine::Shine;
use super::{Object, Scene};

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
    /// Objects that emit light, with the exitance of their sides together, mean of RGB, as if there were no textures.
    fn emitting_objects(&self) -> impl Iterator<Item = (&Object, f64)> {
        self.objects.iter().filter_map(|object| {
            let material = &self.materials[object.material as usize];
            let radiance = material.emission.as_dvec3().element_sum() / 3.0;
            let sides = if material.back_emits { 2.0 } else { 1.0 };
            (radiance > 0.0 && !material.unlit).then_some((object, radiance * PI * sides))
        })
    }

    /// Whether anything in it emits light.
    pub(super) fn has_emissive_triangles(&self) -> bool {
        self.emitting_objects().next().is_some()
    }

    /// How many triangles emit light.
    pub fn emissive_triangle_count(&self) -> usize {
        self.emitting_objects().map(|(object, _)| object.triangles.len()).sum()
    }

    /// The triangles that emit light, in the order of [`Scene::triangles`].
    ///
    /// Photons are emitted, and lights sampled, nearly in proportion to their powers.
    pub fn emissive_triangles(&self) -> Vec<EmissiveTriangle> {
        self.shining_triangles()
            .0
            .into_iter()
            .map(|(emissive, _)| emissive)
            .collect()
    }

    /// Each with the way it shines over its area, and whether some would have to be known more finely than they are.
    pub(super) fn shining_triangles(&self) -> (Vec<(EmissiveTriangle, Shine)>, bool) {
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
        let (shines, is_coarse) = Shine::of_all(self, &even);
        let shining = |(even, shine): (EmissiveTriangle, Shine)| {
            let power = even.power * shine.mean;
            (EmissiveTriangle { power, ..even }, shine)
        };
        (even.into_iter().zip(shines).map(shining).collect(), is_coarse)
    }
}
