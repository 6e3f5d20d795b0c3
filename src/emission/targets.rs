//! Targets of photon paths: specular objects, and the region that the camera sees.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use super::strata::extent_of;
use crate::layout::{
    DIELECTRIC, FOLLOWED_ALPHA, GLOSSY_SURFACE, Light, MIRROR, Material, NO_OBJECT, POINT_LIGHT, SPOT_LIGHT,
    ShadingTriangle, VisiblePoint,
};
use crate::packing::{PackedScene, Sphere};
use crate::scene::Placement;
use crate::sizes::MOST_TARGETS;

/// Maximum number of spheres around specular objects.
const MOST_SPECULAR: usize = 12;
/// Maximum number of spheres around the view, each twice as large as the previous one.
const MOST_NESTED: i32 = 14;
/// Maximum number of objects that are merged by comparing all pairs.
const MOST_COMPARED: usize = 256;
/// Fraction of the scene's radius beyond which aiming at an object is useless.
const LARGE: f64 = 0.5;

/// A sphere that paths are aimed at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Target {
    pub sphere: Sphere,
    /// Whether it contains specular objects.
    pub specular: bool,
}

/// The targets, smaller ones first.
#[derive(Debug, Clone)]
pub(super) struct Targets {
    pub spheres: Vec<Target>,
    /// Index of the target around most of the view.
    pub view: Option<u32>,
    /// The sphere around the scene.
    pub scene: Sphere,
}

/// Finds the targets of a scene, given some visible points.
pub(super) fn targets(scene: &PackedScene, points: &[VisiblePoint]) -> Targets {
    let whole = around(scene);
    let is_small = |sphere: &Sphere| sphere.radius < LARGE * whole.radius;
    let specular = clustered(specular_objects(scene)).into_iter().filter(is_small);
    let target = |specular| move |sphere| Target { sphere, specular };
    let mut spheres: Vec<Target> = specular.map(target(true)).collect();
    spheres.extend(nested(points, &whole).into_iter().map(target(false)));
    let is_outside = |light: &Light| {
        let position = Vec3::from_array(light.position).as_dvec3();
        [POINT_LIGHT, SPOT_LIGHT].contains(&light.kind) && position.length() + extent_of(light) > whole.radius
    };
    if scene.lights.iter().any(is_outside) {
        // Most of the emission of such a light hits nothing.
        spheres.push(target(false)(whole));
    }
    spheres.sort_by(|a, b| a.sphere.radius.total_cmp(&b.sphere.radius));
    debug_assert!(spheres.len() <= MOST_TARGETS as usize);
    // The innermost of the nested spheres has a quarter of the radius.
    let mut nested = (0..).zip(&spheres).filter(|(_, target)| !target.specular);
    let view = nested.nth(1).map(|(index, _)| index);
    Targets {
        spheres,
        view,
        scene: whole,
    }
}

/// The sphere around a scene, a little larger than that.
pub(super) fn around(scene: &PackedScene) -> Sphere {
    let own = own_triangles(scene).flat_map(corners_of);
    let placed = scene.instances.iter().flat_map(|instance| {
        let placement = Placement { rows: instance.rows };
        shared_triangles(scene, instance.first_triangle, instance.triangle_count)
            .flat_map(corners_of)
            .map(move |corner| placement.point(corner.as_vec3()).as_dvec3())
    });
    let radius2 = own.chain(placed).map(DVec3::length_squared).fold(0.0, f64::max);
    Sphere {
        centre: DVec3::ZERO,
        radius: radius2.sqrt() * Sphere::MARGIN,
    }
}

fn own_triangles(scene: &PackedScene) -> impl Iterator<Item = &ShadingTriangle> + Clone {
    scene.shading_triangles[..scene.own_triangles as usize].iter()
}

fn shared_triangles(scene: &PackedScene, first: u32, count: u32) -> impl Iterator<Item = &ShadingTriangle> + Clone {
    scene.shading_triangles[first as usize..(first + count) as usize].iter()
}

pub(super) fn corners_of(triangle: &ShadingTriangle) -> [DVec3; 3] {
    [triangle.p0, triangle.p1, triangle.p2].map(|corner| Vec3::from(corner).as_dvec3())
}

/// Whether camera paths follow its reflection or refraction.
fn is_specular(material: &Material) -> bool {
    let is_narrow = |roughness: f32| f64::from(roughness).powi(2) < FOLLOWED_ALPHA;
    [MIRROR, DIELECTRIC].contains(&material.surface)
        || (material.surface == GLOSSY_SURFACE && is_narrow(material.roughness))
        || (material.coat > 0.0 && is_narrow(material.coat_roughness))
}

/// Spheres around each object's specular triangles.
fn specular_objects(scene: &PackedScene) -> Vec<Sphere> {
    let is_specular = |triangle: &&ShadingTriangle| is_specular(&scene.materials[triangle.material as usize]);
    let mut of_objects: BTreeMap<u32, Vec<&ShadingTriangle>> = BTreeMap::new();
    for triangle in own_triangles(scene).filter(is_specular) {
        of_objects.entry(triangle.object).or_default().push(triangle);
    }
    let own = of_objects.values();
    let own = own.filter_map(|triangles| Sphere::around(triangles.iter().copied().flat_map(corners_of)));
    let mut spheres: Vec<Sphere> = own.collect();
    let mut of_meshes: BTreeMap<u32, Option<Sphere>> = BTreeMap::new();
    for instance in &scene.instances {
        let of_mesh = of_meshes.entry(instance.first_triangle).or_insert_with(|| {
            let triangles = shared_triangles(scene, instance.first_triangle, instance.triangle_count);
            Sphere::around(triangles.filter(is_specular).flat_map(corners_of))
        });
        let map = Placement { rows: instance.rows }.map();
        let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
        let stretch = columns.map(DVec3::length).into_iter().fold(0.0, f64::max);
        spheres.extend(of_mesh.map(|sphere| Sphere {
            centre: map.transform_point3(sphere.centre),
            radius: sphere.radius * stretch,
        }));
    }
    spheres
}

/// Merges the pairs whose common sphere grows least.
fn clustered(mut spheres: Vec<Sphere>) -> Vec<Sphere> {
    // Too many to compare: first merges neighbours along an axis.
    for axis in (0..3).cycle() {
        if spheres.len() <= MOST_COMPARED {
            break;
        }
        spheres.sort_by(|a, b| a.centre[axis].total_cmp(&b.centre[axis]));
        let joint = |pair: &[Sphere]| pair[1..].iter().fold(pair[0], |sum, sphere| sum.joint(sphere));
        spheres = spheres.chunks(2).map(joint).collect();
    }
    while spheres.len() > MOST_SPECULAR {
        let mut best = (f64::INFINITY, 0, 1);
        for (i, a) in spheres.iter().enumerate() {
            for (k, b) in spheres.iter().enumerate().skip(i + 1) {
                let growth = a.joint(b).radius - a.radius.max(b.radius);
                if growth < best.0 {
                    best = (growth, i, k);
                }
            }
        }
        let (_, i, k) = best;
        let removed = spheres.swap_remove(k);
        spheres[i] = spheres[i].joint(&removed);
    }
    // Paths that graze the sphere hit its content.
    for sphere in &mut spheres {
        sphere.radius *= Sphere::MARGIN;
    }
    spheres
}

/// Spheres around the centre of the view, until one would contain the whole scene.
fn nested(points: &[VisiblePoint], whole: &Sphere) -> Vec<Sphere> {
    let seen = points.iter().filter(|point| point.object != NO_OBJECT);
    let positions: Vec<DVec3> = seen.map(|point| Vec3::from(point.position).as_dvec3()).collect();
    if positions.is_empty() {
        return Vec::new();
    }
    let quantile = |mut values: Vec<f64>, part: usize| {
        let at = values.len() / part;
        *values.select_nth_unstable_by(at, f64::total_cmp).1
    };
    let median = |axis: usize| quantile(positions.iter().map(|position| position[axis]).collect(), 2);
    let centre = DVec3::new(median(0), median(1), median(2));
    let distances = positions.iter().map(|position| position.distance(centre)).collect();
    let least = whole.radius * 2f64.powi(1 - MOST_NESTED);
    let smallest = quantile(distances, 4).max(least);
    (0..MOST_NESTED)
        .map(|step| Sphere {
            centre,
            radius: smallest * 2f64.powi(step),
        })
        .take_while(|sphere| !sphere.contains(whole))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn ball(x: f64, y: f64, radius: f64) -> Sphere {
        Sphere {
            centre: DVec3::new(x, y, 0.0),
            radius,
        }
    }

    #[test]
    fn a_small_ball_far_from_others_stays_a_target_of_its_own() {
        // 5 cm in 200 m, and two rows of larger ones.
        let small = ball(0.9, 0.9, 2.5e-4);
        let mut balls: Vec<Sphere> = (0..400)
            .map(|i| ball(f64::from(i % 200) * 0.005 - 0.9, f64::from(i / 200) * 0.01, 0.004))
            .collect();
        balls.truncate(250);
        balls.push(small);
        let found = clustered(balls);
        assert_eq!(found.len(), MOST_SPECULAR);
        let own = found.iter().find(|sphere| sphere.centre == small.centre);
        assert!(
            own.is_some_and(|own| own.radius <= Sphere::MARGIN * small.radius),
            "{found:?}"
        );
    }

    #[test]
    fn many_objects_are_put_together() {
        let balls = (0..5000).map(|i| ball((f64::from(i) * 0.618).fract(), (f64::from(i) * 0.4142).fract(), 0.001));
        let balls: Vec<Sphere> = balls.collect();
        let found = clustered(balls.clone());
        assert_eq!(found.len(), MOST_SPECULAR);
        for ball in &balls {
            assert!(
                found
                    .iter()
                    .any(|sphere| sphere.centre.distance(ball.centre) + ball.radius <= sphere.radius),
                "{ball:?} is in none"
            );
        }
    }

    #[test]
    fn spheres_around_what_is_seen_grow_up_to_the_scene() {
        let point = |i: i32| VisiblePoint {
            position: [0.5 + 1e-4 * i as f32, 0.0, 0.0],
            ..VisiblePoint::zeroed()
        };
        let whole = ball(0.0, 0.0, 1.2);
        let found = nested(&(-50..=50).map(point).collect::<Vec<_>>(), &whole);
        assert!((found[0].radius - 13e-4).abs() < 1e-4, "{found:?}");
        let last = found[found.len() - 1];
        assert!(!last.contains(&whole) && last.radius * 2.0 > 1.7, "{found:?}");
        assert!(nested(&[], &whole).is_empty());
    }
}
