//! Area lights: the triangles whose material emits.

use std::f64::consts::PI;

use super::{Object, Scene, Triangle};

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
    /// Mean factor of a triangle's emission by its texture, about: never 0, since the texture may shine between the places
    /// that are asked.
    fn textured_emission(&self, triangle: u32) -> f64 {
        const ALONG: u32 = 6;
        const LEAST: f64 = 1e-3;
        let Triangle { vertices, object } = self.triangles[triangle as usize];
        let material = &self.materials[self.objects[object as usize].material as usize];
        let Some(texture) = material.textures.emission else {
            return 1.0;
        };
        let of_vertex = |vertex: u32| self.texcoords.get(vertex as usize).copied().unwrap_or_default();
        let corners = vertices.map(of_vertex);
        let mut sum = 0.0;
        for i in 0..ALONG * ALONG {
            let at = |place: u32| (f64::from(place) + 0.5) / f64::from(ALONG);
            let (root, v) = (at(i / ALONG).sqrt(), at(i % ALONG));
            let weights = [1.0 - root, root * (1.0 - v), root * v];
            let set = |set: usize| {
                let parts = corners.iter().zip(weights);
                parts.map(|(corner, weight)| corner[set].as_dvec2() * weight).sum()
            };
            sum += self.textures.value(texture, [set(0), set(1)]).truncate().element_sum() / 3.0;
        }
        (sum / f64::from(ALONG * ALONG)).max(LEAST)
    }

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

    /// The triangles that emit light, in the order of [`Scene::triangles`].
    ///
    /// Photons are emitted, and lights sampled, nearly in proportion to their powers.
    pub fn emissive_triangles(&self) -> Vec<EmissiveTriangle> {
        self.emitting_objects()
            .flat_map(|(object, exitance)| {
                object.triangles.clone().map(move |triangle| {
                    let area = self.triangle_area(triangle);
                    let exitance = exitance * self.textured_emission(triangle);
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
