//! Area lights: the triangles whose material emits.

use std::f64::consts::PI;

use super::Scene;

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
    /// The triangles that emit light, in the order of [`Scene::triangles`].
    ///
    /// Photons are emitted, and lights sampled, nearly in proportion to their powers.
    pub fn emissive_triangles(&self) -> Vec<EmissiveTriangle> {
        let emitting = self.objects.iter().filter_map(|object| {
            let material = &self.materials[object.material as usize];
            let radiance = material.emission.as_dvec3().element_sum() / 3.0;
            let sides = if material.double_sided { 2.0 } else { 1.0 };
            (radiance > 0.0).then_some((object, radiance * PI * sides))
        });
        emitting
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
            .collect()
    }
}
