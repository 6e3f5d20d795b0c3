//! Lamps that a file contains twice in the same place: a ray hits one of them, so only one is a light.

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::EmissiveTriangle;
use super::emission_distribution::EmissionDistribution;
use crate::scene::Scene;

/// A triangle's corners in a canonical order, its material, and the side that it faces if that matters.
type Place = ([[u32; 3]; 3], u32, bool);

fn place_of(scene: &Scene, triangle: u32) -> Place {
    let object = &scene.objects[scene.triangles[triangle as usize].object as usize];
    // −0 and 0 are equal.
    let corners = scene
        .corners_of(triangle)
        .map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
    let mut sorted = corners;
    sorted.sort_unstable();
    // An even permutation keeps the side that it faces.
    let place = |corner: &[u32; 3]| sorted.iter().position(|other| other == corner);
    let [a, b, c] = [0, 1, 2].map(|i| place(&corners[i]));
    let inversions = [a > b, a > c, b > c].into_iter().filter(|inverted| *inverted).count();
    let two_sided = scene.materials[object.material as usize].back_emits;
    (sorted, object.material, !two_sided && inversions % 2 == 1)
}

/// Removes triangles that coincide with another one of the same material that emits evenly to the same sides. Returns pairs of
/// the removed triangle and the one that stays: that of the last object, which rays hit.
pub(crate) fn remove_duplicates(
    scene: &Scene,
    emissive: &mut Vec<(EmissiveTriangle, EmissionDistribution)>,
) -> Vec<[u32; 2]> {
    let mut stay: HashMap<Place, u32> = HashMap::new();
    let even = emissive
        .iter()
        .rev()
        .filter(|(_, distribution)| distribution.columns == 1);
    let with_those_that_stay = even.map(|(light, _)| {
        let stays = stay.entry(place_of(scene, light.triangle)).or_insert(light.triangle);
        [light.triangle, *stays]
    });
    let doubles: Vec<[u32; 2]> = with_those_that_stay.filter(|[light, stays]| light != stays).collect();
    let gone: HashSet<u32> = doubles.iter().map(|[light, _]| *light).collect();
    emissive.retain(|(light, _)| !gone.contains(&light.triangle));
    doubles
}
