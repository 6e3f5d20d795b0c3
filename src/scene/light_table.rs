//! The lights of a scene in the layout of the device, with the probabilities by which they are chosen.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use super::punctual::{Emission, PunctualLight};
use super::{EmissiveTriangle, Scene};
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, POINT_LIGHT, SPOT_LIGHT, TRIANGLE_LIGHT};

/// The part of all choices of a light that goes to each object that emits, each punctual light and the environment alike
/// instead of by flux. A light that is a million million times dimmer than another one would hardly have its turn, and
/// where it shines alone nothing would be seen.
const ALIKE: f64 = 0.1;

/// Distant lights' discs are so much larger than what they cover.
const MARGIN: f64 = 1.0 + 1e-5;

/// A light and what its probability depends on.
struct Candidate {
    light: Light,
    power: f64,
    /// Part of its object's flux; 1 for what is no triangle.
    share: f64,
}

/// All lights: triangles in leaf order, punctual ones, the environment; with the alias table. And what they emit together,
/// mean of RGB.
pub(super) fn lights(scene: &Scene, order: &[u32]) -> (Vec<Light>, f64) {
    let mut candidates = emissive_triangles(scene, order);
    let others = scene
        .lights
        .iter()
        .map(|light| punctual(scene, light))
        .chain(environment(scene));
    candidates.extend(others.map(|(light, power)| Candidate {
        light,
        power,
        share: 1.0,
    }));
    let power: f64 = candidates.iter().map(|candidate| candidate.power).sum();
    let shares: f64 = candidates.iter().map(|candidate| candidate.share).sum();
    let probabilities: Vec<f64> = candidates
        .iter()
        .map(|candidate| (1.0 - ALIKE) * candidate.power / power + ALIKE * candidate.share / shares)
        .collect();
    let mut lights: Vec<Light> = candidates.into_iter().map(|candidate| candidate.light).collect();
    set_alias_table(&mut lights, &probabilities);
    (lights, power)
}

/// Gives lights the probabilities, whose sum is 1, by which they are to be chosen: Vose, «A Linear Algorithm For Generating
/// Random Numbers With a Given Distribution», IEEE Transactions on Software Engineering 17(9), 1991.
pub(crate) fn set_alias_table(lights: &mut [Light], probabilities: &[f64]) {
    let count = probabilities.len() as f64;
    // How much of each light is left to be put into cells, whose width is 1.
    let mut left: Vec<f64> = probabilities.iter().map(|probability| probability * count).collect();
    for (i, (light, &probability)) in lights.iter_mut().zip(probabilities).enumerate() {
        light.probability = probability as f32;
        light.accept = 1.0;
        light.alias = i as u32;
    }
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..left.len()).partition(|&i| left[i] < 1.0);
    // What rounding leaves over fills its own cell.
    while let (Some(&donor), Some(cell)) = (large.last(), small.pop()) {
        lights[cell].accept = left[cell] as f32;
        lights[cell].alias = donor as u32;
        left[donor] -= 1.0 - left[cell];
        if left[donor] < 1.0 {
            large.pop();
            small.push(donor);
        }
    }
}

fn emissive_triangles(scene: &Scene, order: &[u32]) -> Vec<Candidate> {
    let mut place = vec![0; scene.triangles.len()];
    for (packed, &index) in order.iter().enumerate() {
        place[index as usize] = packed as u32;
    }
    let mut emissive = scene.emissive_triangles();
    emissive.sort_by_key(|light| place[light.triangle as usize]);
    let object_of = |light: &EmissiveTriangle| scene.triangles[light.triangle as usize].object as usize;
    let mut power_of_objects = vec![0.0; scene.objects.len()];
    for light in &emissive {
        power_of_objects[object_of(light)] += light.power;
    }
    emissive
        .iter()
        .map(|emissive| Candidate {
            light: Light {
                kind: TRIANGLE_LIGHT,
                triangle: place[emissive.triangle as usize],
                area: emissive.area as f32,
                ..Light::zeroed()
            },
            power: emissive.power,
            share: emissive.power / power_of_objects[object_of(emissive)],
        })
        .collect()
}

/// A light, and its power.
fn punctual(scene: &Scene, light: &PunctualLight) -> (Light, f64) {
    let common = Light {
        intensity: light.intensity.to_array(),
        position: light.position.to_array(),
        inverse_range: light.range.map_or(0.0, |range| (1.0 / range) as f32),
        ..Light::zeroed()
    };
    let mut disc_area = 0.0;
    let packed = match light.emission {
        Emission::Point => Light {
            kind: POINT_LIGHT,
            ..common
        },
        Emission::Spot {
            direction,
            inner,
            outer,
        } => Light {
            kind: SPOT_LIGHT,
            direction: direction.to_array(),
            inner: inner as f32,
            outer: outer as f32,
            ..common
        },
        Emission::Directional { direction } => {
            let (centre, area) = disc_across(scene, direction.as_dvec3());
            disc_area = area;
            Light {
                kind: DIRECTIONAL_LIGHT,
                direction: direction.to_array(),
                position: centre.as_vec3().to_array(),
                area: area as f32,
                ..common
            }
        }
    };
    (packed, light.power(disc_area))
}

/// Centre and area of a disc before the scene from which parallel rays meet all of it.
fn disc_across(scene: &Scene, direction: DVec3) -> (DVec3, f64) {
    let (mut before, mut radius2): (f64, f64) = (0.0, 0.0);
    for position in scene.corners().map(Vec3::as_dvec3) {
        let along = position.dot(direction);
        before = before.max(-along);
        radius2 = radius2.max((position - along * direction).length_squared());
    }
    // A flat scene across the light would have the disc in its plane.
    let apart = 1e-3 * radius2.sqrt();
    (-direction * (before + apart), PI * radius2 * MARGIN)
}

/// Radius of a sphere around the origin that holds the scene.
fn bounding_radius(scene: &Scene) -> f64 {
    let radius2 = scene.corners().map(Vec3::length_squared);
    f64::from(radius2.fold(0.0, f32::max)).sqrt() * MARGIN
}

/// The environment as a light, and its power: what comes in through a sphere around the scene.
fn environment(scene: &Scene) -> Option<(Light, f64)> {
    let environment = scene.environment.as_ref()?;
    let area = PI * bounding_radius(scene).powi(2);
    let light = Light {
        kind: ENVIRONMENT_LIGHT,
        area: area as f32,
        ..Light::zeroed()
    };
    Some((light, environment.total() * area))
}
