//! Aiming photon paths in a scene that moves.

use super::strata::is_distant;
use super::targets::{around, corners_of};
use crate::layout::{Light, TRIANGLE_LIGHT};
use crate::packing::{PackedScene, Sphere};

/// Whether an emission table of one scene has all paths of the same scene at another time. Its lights must not have moved: which
/// targets their paths can hit is known of where they were. Nor may anything leave the sphere around the scene, beyond which no
/// path is aimed. Everything else may move: targets are places, whatever is in them.
pub fn aims_alike(first: &PackedScene, scene: &PackedScene) -> bool {
    let is_alike = |(one, other): (&Light, &Light)| places(first, one) == places(scene, other);
    first.sources == scene.sources
        && first.lights.len() == scene.lights.len()
        && first.lights.iter().zip(&scene.lights).all(is_alike)
        && around(scene).radius <= around(first).radius * Sphere::MARGIN
}

/// What of a light decides where its paths can go.
fn places(scene: &PackedScene, light: &Light) -> [[f32; 3]; 5] {
    let is_shining = if light.probability > 0.0 { 1.0 } else { 0.0 };
    let corners = if light.kind == TRIANGLE_LIGHT {
        corners_of(&scene.shading_triangles[light.triangle as usize]).map(|corner| corner.as_vec3().to_array())
    } else {
        [[light.extent, light.inner, light.outer], light.direction, [0.0; 3]]
    };
    let position = if is_distant(light) { [0.0; 3] } else { light.position };
    let [a, b, c] = corners;
    [[light.kind as f32, is_shining, 0.0], position, a, b, c]
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;

    #[test]
    fn what_is_no_light_may_move_within_the_scene() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-spheres.gltf");
        let scene = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
        let packed = PackedScene::new(&scene).unwrap_or_else(|error| panic!("{error}"));
        let moved = |name: &str, by: f32| {
            let mut scene = scene.clone();
            let object = scene.objects.iter().find(|object| object.name == name);
            let triangles = object.unwrap_or_else(|| panic!("{name}")).triangles.clone();
            let mut vertices: Vec<u32> = triangles
                .flat_map(|triangle| scene.triangles[triangle as usize].vertices)
                .collect();
            vertices.sort_unstable();
            vertices.dedup();
            for vertex in vertices {
                scene.positions[vertex as usize].x += by;
            }
            packed.moved(&scene).unwrap_or_else(|error| panic!("{error}"))
        };
        assert!(aims_alike(&packed, &moved("glass-sphere", 0.1)));
        assert!(!aims_alike(&packed, &moved("light", 0.1)), "a light");
        assert!(!aims_alike(&packed, &moved("glass-sphere", 9.0)), "out of the scene");
    }
}
