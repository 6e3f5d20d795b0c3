//! The strata of photon paths: paths of a source that hit one target before any other, or none.

use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::targets::{Targets, corners_of};
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, POINT_LIGHT, SPOT_LIGHT};
use crate::packing::{PackedScene, Part, Sphere};

/// Minimum probability of a stratum, relative to its share of the power: no photon carries much more flux than by power.
const FLOOR: f64 = 0.2;
/// Maximum sum of the lower bounds, without the equal share.
const MOST_FLOOR: f64 = 0.4;
/// The share of paths that is equal for all strata.
const EXPLORED: f64 = 0.2;
/// Number of lights of a source from which the share of its paths that hit a target is estimated.
const PROBES: usize = 64;

/// Paths of a source that hit a target first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Stratum {
    /// Range in [`PackedScene::lights`].
    pub lights: Range<u32>,
    /// Index of the target, or the number of targets for paths that hit none.
    pub target: u32,
    /// Approximate share of its starts among paths by power, including rejected ones.
    pub share: f64,
    /// Its minimum probability.
    pub floor: f64,
    /// Its initial probability.
    pub initial: f64,
}

/// All strata that can have paths. Their initial probabilities sum up to 1.
pub(super) fn strata(scene: &PackedScene, targets: &Targets) -> Vec<Stratum> {
    let power_of =
        |source: &Range<u32>| -> f64 { lights_of(scene, source).iter().map(|l| f64::from(l.probability)).sum() };
    let total: f64 = scene.sources.iter().map(power_of).sum();
    let alike = 1.0 / scene.sources.len() as f64;
    let mut strata = Vec::new();
    for source in &scene.sources {
        let power = power_of(source) / total;
        let first = strata.len();
        for target in 0..=targets.spheres.len() {
            let sphere = targets.spheres.get(target).map(|target| target.sphere);
            strata.push(Stratum {
                lights: source.clone(),
                target: target as u32,
                share: power * sphere.map_or(1.0, |sphere| share(scene, source, &sphere)),
                floor: 0.0,
                initial: 0.0,
            });
            if sphere.is_some_and(|sphere| is_met_by_all(scene, source, targets, &sphere)) {
                break;
            }
        }
        share_out(&mut strata[first..], targets, 0.5 * (power + alike));
    }
    let shares: f64 = strata.iter().map(|stratum| stratum.share).sum();
    let explored = EXPLORED / strata.len() as f64;
    for stratum in &mut strata {
        stratum.floor = stratum.share * FLOOR.min(MOST_FLOOR / shares) + explored;
    }
    strata
}

fn lights_of<'a>(scene: &'a PackedScene, source: &Range<u32>) -> &'a [Light] {
    &scene.lights[source.start as usize..source.end as usize]
}

/// Excluding parts of triangles that are surely dark.
fn shining<'a>(scene: &'a PackedScene, source: &Range<u32>) -> impl Iterator<Item = &'a Light> {
    lights_of(scene, source).iter().filter(|light| light.probability > 0.0)
}

/// A source's initial probability: half of it for specular targets, if there are both specular and other targets.
fn share_out(strata: &mut [Stratum], targets: &Targets, probability: f64) {
    let is_specular = |stratum: &Stratum| {
        let target = targets.spheres.get(stratum.target as usize);
        target.is_some_and(|target| target.specular)
    };
    let specular = strata.iter().filter(|stratum| is_specular(stratum)).count();
    let others = strata.len() - specular;
    for stratum in strata {
        let alike = if is_specular(stratum) { specular } else { others };
        let kinds = if specular > 0 && others > 0 { 2 } else { 1 };
        stratum.initial = probability / (kinds * alike) as f64;
    }
}

/// Whether a light is distant.
pub(super) fn is_distant(light: &Light) -> bool {
    [DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT].contains(&light.kind)
}

/// Maximum distance of starts from a light's point.
pub(super) fn extent_of(light: &Light) -> f64 {
    if [POINT_LIGHT, SPOT_LIGHT].contains(&light.kind) {
        light.extent.into()
    } else {
        0.0
    }
}

/// Points of a light that has a position.
fn points_of(scene: &PackedScene, light: &Light) -> [DVec3; 3] {
    if [POINT_LIGHT, SPOT_LIGHT].contains(&light.kind) {
        return [Vec3::from_array(light.position).as_dvec3(); 3];
    }
    Part::of(light).corners(corners_of(&scene.shading_triangles[light.triangle as usize]))
}

/// Whether every path of a source that hits the scene hits the sphere.
fn is_met_by_all(scene: &PackedScene, source: &Range<u32>, targets: &Targets, sphere: &Sphere) -> bool {
    if sphere.contains(&targets.scene) || *sphere == targets.scene {
        return true;
    }
    let inside = |light: &Light, point: DVec3| {
        let point = Sphere {
            centre: point,
            // Ray origins are offset from surfaces.
            radius: extent_of(light) + 1e-4 * sphere.radius,
        };
        sphere.contains(&point)
    };
    let all_inside = |light: &Light| points_of(scene, light).into_iter().all(|point| inside(light, point));
    let mut lights = shining(scene, source);
    lights.all(|light| !is_distant(light) && all_inside(light))
}

/// Approximate share of a source's paths by power that the uniform density of paths towards a sphere covers.
fn share(scene: &PackedScene, source: &Range<u32>, sphere: &Sphere) -> f64 {
    let lights: Vec<&Light> = shining(scene, source).collect();
    let probes = lights.iter().step_by(lights.len().div_ceil(PROBES));
    let count = probes.len() as f64;
    let versine = |light: &Light, point: DVec3| {
        let wider = Sphere {
            radius: sphere.radius + extent_of(light),
            ..*sphere
        };
        wider.versine(point)
    };
    let shares = probes.map(|light| match light.kind {
        DIRECTIONAL_LIGHT | ENVIRONMENT_LIGHT => PI * sphere.radius.powi(2) / f64::from(light.area),
        POINT_LIGHT => versine(light, points_of(scene, light)[0]) / 2.0,
        SPOT_LIGHT => versine(light, points_of(scene, light)[0]) / light.full_versine(),
        _ => 2.0 * sphere.versine(points_of(scene, light).into_iter().sum::<DVec3>() / 3.0),
    });
    shares.map(|share| share.min(1.0)).sum::<f64>() / count
}
