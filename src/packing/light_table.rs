//! The lights of a scene in the layout of the device, with the probabilities by which they are chosen.

use std::f64::consts::PI;
use std::ops::Range;

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use super::duplicate_lights::remove_duplicates;
use super::emission_distribution::EmissionDistribution;
use super::{EmissiveTriangle, Part, light_sources};
use crate::alias::alias_table;
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, POINT_LIGHT, SPOT_LIGHT, TRIANGLE_LIGHT};
use crate::scene::{LightKind, PunctualLight, Scene};

/// The share of choices of a light that is equal for each emissive object, each punctual light and the environment, instead of by
/// flux. Otherwise a light that is 10¹² times dimmer than another one would hardly be sampled, and the region that it lights
/// alone would stay black.
const ALIKE: f64 = 0.1;

/// Factor by which the discs of distant lights are larger than the scene that they cover.
const MARGIN: f64 = 1.0 + 1e-5;

/// A light and the data for its probability.
struct Candidate {
    light: Light,
    power: f64,
    /// Share of its object's flux; 1 if it is not a triangle.
    share: f64,
    /// Share of its triangle's flux; 1 if it is not a triangle.
    of_triangle: f64,
}

/// All lights of a scene.
pub(crate) struct Lights {
    /// Triangles by object and in leaf order, each with its parts; punctual ones, the environment. With the alias table.
    pub lights: Vec<Light>,
    /// Power of each light, mean of RGB; 0 if it is surely dark.
    pub powers: Vec<f64>,
    /// Ranges of lights.
    pub sources: Vec<Range<u32>>,
    /// Power of all lights, mean of RGB.
    pub power: f64,
    /// Pairs of a duplicate and the emissive triangle that it coincides with; in leaf order.
    pub doubles: Vec<[u32; 2]>,
    /// Whether some triangle would need more parts.
    pub is_coarse: bool,
}

/// The lights, for triangles in this order.
pub(crate) fn lights(scene: &Scene, order: &[u32]) -> Lights {
    let (mut emissive, is_coarse) = scene.emission_distributions();
    let mut place = vec![0; scene.triangles.len()];
    for (packed, &index) in order.iter().enumerate() {
        place[index as usize] = packed as u32;
    }
    let doubles = remove_duplicates(scene, &mut emissive);
    let doubles = doubles.iter().map(|pair| pair.map(|index| place[index as usize]));
    let doubles = doubles.collect();
    let (mut candidates, mut sources) = emissive_triangles(scene, &place, emissive);
    let triangles = candidates.len() as u32;
    let punctual_lights = scene.lights.iter().map(|light| punctual(scene, light));
    let mut others: Vec<(Light, f64)> = punctual_lights.chain(environment(scene)).collect();
    // Lights of a kind are consecutive, so that they can be joined. The environment stays last.
    others.sort_by_key(|(light, _)| light.kind);
    candidates.extend(others.into_iter().map(|(light, power)| Candidate {
        light,
        power,
        share: 1.0,
        of_triangle: 1.0,
    }));
    sources.extend((triangles..candidates.len() as u32).map(|light| light..light + 1));
    let power: f64 = candidates.iter().map(|candidate| candidate.power).sum();
    let shares: f64 = candidates.iter().map(|candidate| candidate.share).sum();
    let probabilities: Vec<f64> = candidates
        .iter()
        .map(|candidate| (1.0 - ALIKE) * candidate.power / power + ALIKE * candidate.share / shares)
        .collect();
    let powers: Vec<f64> = candidates.iter().map(|candidate| candidate.power).collect();
    let of_triangles: Vec<f64> = candidates.iter().map(|candidate| candidate.of_triangle).collect();
    let mut lights: Vec<Light> = candidates.into_iter().map(|candidate| candidate.light).collect();
    set_alias_table(&mut lights, &probabilities);
    let sources = light_sources::bundled(&lights, sources);
    for source in &sources {
        let within = source.start as usize..source.end as usize;
        light_sources::set_cumulative(
            &mut lights[within.clone()],
            &powers[within.clone()],
            &of_triangles[within],
        );
    }
    Lights {
        lights,
        powers,
        sources,
        power,
        doubles,
        is_coarse,
    }
}

/// Sets the probabilities of lights, whose sum is 1.
pub(crate) fn set_alias_table(lights: &mut [Light], probabilities: &[f64]) {
    for ((light, &probability), cell) in lights.iter_mut().zip(probabilities).zip(alias_table(probabilities)) {
        light.probability = probability as f32;
        light.accept = cell.accept;
        light.alias = cell.alias;
    }
}

/// Lights of triangles, and the range of each object's. `place`: of each triangle in leaf order.
fn emissive_triangles(
    scene: &Scene,
    place: &[u32],
    mut emissive: Vec<(EmissiveTriangle, EmissionDistribution)>,
) -> (Vec<Candidate>, Vec<Range<u32>>) {
    let object_of = |light: &EmissiveTriangle| scene.triangles[light.triangle as usize].object as usize;
    emissive.sort_by_key(|(light, _)| (object_of(light), place[light.triangle as usize]));
    for of_object in emissive.chunk_by_mut(|(a, _), (b, _)| object_of(a) == object_of(b)) {
        if of_object.iter().all(|(_, distribution)| distribution.is_dark()) {
            of_object
                .iter_mut()
                .for_each(|(_, distribution)| distribution.not_dark());
        }
    }
    let mut power_of_objects = vec![0.0; scene.objects.len()];
    for (light, _) in &emissive {
        power_of_objects[object_of(light)] += light.power;
    }
    let mut sources = Vec::new();
    for lights in emissive.chunk_by(|(a, _), (b, _)| object_of(a) == object_of(b)) {
        let first = sources.last().map_or(0, |source: &Range<u32>| source.end);
        let count: u32 = lights.iter().map(|(_, distribution)| distribution.columns.pow(2)).sum();
        sources.push(first..first + count);
    }
    let parts = emissive.iter().flat_map(|(light, distribution)| {
        let parts = distribution.columns.pow(2);
        (0..parts).map(move |number| {
            (
                light,
                distribution.share(number),
                Part::numbered(number, distribution.columns),
                parts,
            )
        })
    });
    let candidates = parts
        .map(|(emissive, of_triangle, part, parts)| Candidate {
            light: Light {
                kind: TRIANGLE_LIGHT,
                triangle: place[emissive.triangle as usize],
                area: (emissive.area / f64::from(parts)) as f32,
                position: part.packed(),
                ..Light::zeroed()
            },
            power: emissive.power * of_triangle,
            share: emissive.power * of_triangle / power_of_objects[object_of(emissive)],
            of_triangle,
        })
        .collect();
    (candidates, sources)
}

/// A light, and its power.
fn punctual(scene: &Scene, light: &PunctualLight) -> (Light, f64) {
    // Irradiance across each direction, such that the sum across the middle direction is that of the light.
    let spread = match light.kind {
        LightKind::Directional { .. } => (0.5 * light.extent).cos().powi(2),
        LightKind::Point | LightKind::Spot { .. } => 1.0,
    };
    let common = Light {
        intensity: (light.intensity.as_dvec3() / spread).as_vec3().to_array(),
        position: light.position.to_array(),
        extent: match light.kind {
            LightKind::Directional { .. } => 2.0 * (0.5 * light.extent).sin().powi(2),
            LightKind::Point | LightKind::Spot { .. } => light.extent,
        } as f32,
        inverse_range: light.range.map_or(0.0, |range| (1.0 / range) as f32),
        ..Light::zeroed()
    };
    let mut disc_area = 0.0;
    let packed = match light.kind {
        LightKind::Point => Light {
            kind: POINT_LIGHT,
            ..common
        },
        LightKind::Spot {
            direction,
            inner,
            outer,
            smooth,
        } => Light {
            kind: SPOT_LIGHT,
            direction: direction.to_array(),
            inner: inner as f32,
            outer: outer as f32,
            area: if smooth { 1.0 } else { 0.0 },
            ..common
        },
        LightKind::Directional { direction } => {
            let (centre, area) = if light.extent > 0.0 {
                // Rays of many directions enter through a sphere around the scene, like those of an environment.
                (DVec3::ZERO, PI * bounding_radius(scene).powi(2))
            } else {
                disc_across(scene, direction.as_dvec3())
            };
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

/// Centre and area of a disc in front of the scene from which parallel rays reach all of it.
fn disc_across(scene: &Scene, direction: DVec3) -> (DVec3, f64) {
    let (mut before, mut radius2): (f64, f64) = (0.0, 0.0);
    for position in scene.corners().map(Vec3::as_dvec3) {
        let along = position.dot(direction);
        before = before.max(-along);
        radius2 = radius2.max((position - along * direction).length_squared());
    }
    // A flat scene across the light would lie in the plane of the disc.
    let apart = 1e-3 * radius2.sqrt();
    (-direction * (before + apart), PI * radius2 * MARGIN)
}

/// Radius of a sphere around the origin that contains the scene.
fn bounding_radius(scene: &Scene) -> f64 {
    let radius2 = scene.corners().map(Vec3::length_squared);
    f64::from(radius2.fold(0.0, f32::max)).sqrt() * MARGIN
}

/// The environment as a light, and its power: the flux into a sphere around the scene.
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
