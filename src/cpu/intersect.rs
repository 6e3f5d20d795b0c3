//! Ray-triangle intersection.

use std::ops::Range;

use glam::{DAffine3, DVec3};

use super::Inputs;
use super::vector::xyz;
use crate::config::Accel;
use crate::layout::{BvhRecord, LEAF, PLACEMENT_RECORD};
use crate::packing::PackedScene;
use crate::scene::Placement;

/// Relative rounding error of distances.
const TIE: f64 = 1e-9;

/// The points `origin + t · direction` with t > 0.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// In render units.
    pub origin: DVec3,
    /// Not necessarily a unit vector.
    pub direction: DVec3,
}

/// A triangle, with the instance that places it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct PlacedTriangle {
    /// Index of the instance; `None` if the triangle is in render space.
    pub instance: Option<u32>,
    /// Index of the triangle in the order of the BVH's leaves.
    pub triangle: u32,
}

impl PlacedTriangle {
    /// A triangle in render space.
    pub(super) fn unplaced(triangle: u32) -> Self {
        Self {
            triangle,
            instance: None,
        }
    }

    /// Its instance's transform.
    pub(super) fn placement(self, scene: &PackedScene) -> Option<Placement> {
        self.instance.map(|instance| placement(scene, instance))
    }

    /// Its corners in render space, rounded as on the device.
    pub(super) fn corners(self, scene: &PackedScene) -> [DVec3; 3] {
        let triangle = &scene.shading_triangles[self.triangle as usize];
        let corners = [triangle.p0, triangle.p1, triangle.p2].map(xyz);
        self.placement(scene).map_or(corners, |placement| {
            corners.map(|corner| placement.point(corner.as_vec3()).as_dvec3())
        })
    }
}

fn placement(scene: &PackedScene, instance: u32) -> Placement {
    Placement {
        rows: scene.instances[instance as usize].rows,
    }
}

/// Where a ray hits a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f64,
    /// Barycentric coordinate of the second corner.
    pub u: f64,
    /// Barycentric coordinate of the third corner.
    pub v: f64,
    /// The triangle.
    pub at: PlacedTriangle,
}

/// Progress of a search along a ray: only later hits count. Hits at the same distance are ordered by instance and triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Progress {
    t: f64,
    at: Option<PlacedTriangle>,
}

impl Progress {
    pub const AT_ORIGIN: Self = Self { t: 0.0, at: None };

    pub fn past(hit: Hit) -> Self {
        Self {
            t: hit.t,
            at: Some(hit.at),
        }
    }
}

/// The nearest triangle except `ignored` before t = `limit`.
pub fn nearest_hit(inputs: &Inputs<'_>, ray: Ray, limit: f64, ignored: Option<PlacedTriangle>) -> Option<Hit> {
    nearest_hit_from(inputs, ray, Progress::AT_ORIGIN, limit, ignored)
}

/// The same after `progress`.
pub(super) fn nearest_hit_from(
    inputs: &Inputs<'_>,
    ray: Ray,
    progress: Progress,
    limit: f64,
    ignored: Option<PlacedTriangle>,
) -> Option<Hit> {
    let search = Search::new(inputs, ray, limit, ignored);
    Search { progress, ..search }.run(inputs)
}

/// A search for the nearest hit.
struct Search<'a> {
    scene: &'a PackedScene,
    ray: Ray,
    ignored: Option<PlacedTriangle>,
    progress: Progress,
    /// t of the nearest hit so far.
    limit: f64,
    hit: Option<Hit>,
}

impl<'a> Search<'a> {
    fn new(inputs: &Inputs<'a>, ray: Ray, limit: f64, ignored: Option<PlacedTriangle>) -> Self {
        Self {
            scene: inputs.scene,
            ray,
            ignored,
            progress: Progress::AT_ORIGIN,
            limit,
            hit: None,
        }
    }

    fn run(mut self, inputs: &Inputs<'_>) -> Option<Hit> {
        match inputs.config.accel {
            Accel::Brute => {
                self.test(0..self.scene.own_triangles, None);
                for (index, instance) in (0..).zip(&self.scene.instances) {
                    let first = instance.first_triangle;
                    self.test(first..first + instance.triangle_count, Some(index));
                }
            }
            Accel::Auto | Accel::Bvh | Accel::RayQuery => self.traverse(&self.scene.bvh, 0, None),
        }
        self.hit
    }

    /// Whether a hit comes after `progress`, and is nearer than the nearest so far.
    fn is_nearer(&self, t: f64, at: PlacedTriangle) -> bool {
        let later = t > self.progress.t || (t == self.progress.t && self.progress.at.is_some_and(|last| last < at));
        let nearer = t < self.limit || (t == self.limit && self.hit.is_some_and(|hit| at < hit.at));
        later && nearer
    }

    fn test(&mut self, triangles: Range<u32>, instance: Option<u32>) {
        for triangle in triangles {
            let at = PlacedTriangle { triangle, instance };
            if self.ignored == Some(at) {
                continue;
            }
            if let Some((t, u, v)) = intersect_triangle(self.ray, at.corners(self.scene))
                && self.is_nearer(t, at)
            {
                self.limit = t;
                self.hit = Some(Hit { t, u, v, at });
            }
        }
    }

    /// Traverses the hierarchy below a root, in the space of an instance if there is one.
    fn traverse(&mut self, records: &[BvhRecord], root: u32, instance: Option<Entered>) {
        let to_local = instance.map_or(DAffine3::IDENTITY, |entered| entered.to_local);
        let wider = instance.map_or(0.0, |entered| entered.widening);
        let origin = to_local.transform_point3(self.ray.origin);
        // A component of 0 gives infinite slabs; ±1e-20 avoids 0 · ∞.
        let safe = |d: f64| if d.abs() < 1e-20 { 1e-20 } else { d };
        let inverse = to_local.transform_vector3(self.ray.direction).map(safe).recip();
        let mut stack = Vec::with_capacity(64);
        stack.push((root, 0.0));
        while let Some((reference, enter)) = stack.pop() {
            if enter > self.limit * (1.0 + TIE) {
                continue;
            }
            if reference & LEAF != 0 {
                let first = (reference & !LEAF) as usize;
                if records[first].instance().kind == PLACEMENT_RECORD {
                    let entered = Entered::new(self.scene, &records[first], &records[first + 1]);
                    self.traverse(records, records[first + 1].instance().index, Some(entered));
                } else {
                    self.test(leaf(records, reference), instance.map(|entered| entered.index));
                }
                continue;
            }
            let [left, right] = children(
                &records[reference as usize],
                [origin + wider, origin - wider],
                inverse,
                self.limit,
            );
            let left_first = match (left, right) {
                (Some((_, left)), Some((_, right))) => left <= right,
                _ => true,
            };
            let (first, second) = if left_first { (left, right) } else { (right, left) };
            stack.extend(second);
            stack.extend(first);
        }
    }
}

/// An instance that a ray has entered.
#[derive(Clone, Copy)]
struct Entered {
    index: u32,
    to_local: DAffine3,
    /// Widening of the boxes, for the rounding of placed corners.
    widening: f64,
}

impl Entered {
    /// From the instance's two records.
    fn new(scene: &PackedScene, to_render: &BvhRecord, ray: &BvhRecord) -> Self {
        let index = to_render.instance().index;
        Self {
            index,
            to_local: placement(scene, index).map().inverse(),
            widening: ray.instance().widening.into(),
        }
    }
}

/// The triangles of a leaf.
fn leaf(records: &[BvhRecord], reference: u32) -> Range<u32> {
    let triangles = &records[(reference & !LEAF) as usize..];
    let first = triangles[0].triangle().index;
    let others = triangles.iter().position(|record| record.triangle().last == 1);
    first..first + 1 + others.unwrap_or(0) as u32
}

/// References to the children of a node whose boxes the ray enters before `limit`, with t at the entry. The origin is shifted for
/// the boxes' lower and upper corners.
fn children(record: &BvhRecord, [low, high]: [DVec3; 2], inverse: DVec3, limit: f64) -> [Option<(u32, f64)>; 2] {
    let node = record.node();
    let boxes = [
        (node.left, node.left_low, node.left_high),
        (node.right, node.right_low, node.right_high),
    ];
    boxes.map(|(child, min, max)| {
        let (t0, t1) = ((xyz(min) - low) * inverse, (xyz(max) - high) * inverse);
        let enter = t0.min(t1).max_element().max(0.0);
        // The factors cover the rounding of the slab test (Ize, «Robust BVH Ray Traversal», JCGT 2(2), 2013) and of coincident
        // faces.
        let leave = t0.max(t1).min_element().min(limit * (1.0 + TIE)) * (1.0 + 4.0 * f64::EPSILON);
        (enter <= leave).then_some((child, enter))
    })
}

/// t > 0 and the barycentric coordinates of the second and the third corner, by the signed volumes of the ray and each edge:
/// Kensler and Shirley, «Optimizing Ray-Triangle Intersection via Automated Search», 2006. Two triangles that share an edge
/// compute the same volume for it, up to the sign, so that no ray passes between them.
fn intersect_triangle(ray: Ray, corners: [DVec3; 3]) -> Option<(f64, f64, f64)> {
    let [a, b, c] = corners.map(|corner| corner - ray.origin);
    let d = ray.direction;
    let (w, u, v) = (d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b)));
    if w.min(u).min(v) < 0.0 && w.max(u).max(v) > 0.0 {
        return None;
    }
    let volume = w + u + v;
    let t = (b - a).cross(c - a).dot(a) / volume;
    (volume != 0.0 && t > 0.0).then_some((t, u / volume, v / volume))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn ray(origin: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray {
            origin: origin.into(),
            direction: direction.into(),
        }
    }

    #[test]
    fn distance_and_coordinates_are_those_of_the_point() {
        let (t, u, v) = intersect_triangle(ray([0.25, 0.5, 3.0], [0.0, 0.0, -2.0]), TRIANGLE).expect("a hit");
        assert_eq!((t, u, v), (1.5, 0.25, 0.5));
        let (t, u, v) =
            intersect_triangle(ray([0.25, 0.5, -3.0], [0.0, 0.0, 2.0]), TRIANGLE).expect("a hit from behind");
        assert_eq!((t, u, v), (1.5, 0.25, 0.5));
    }

    #[test]
    fn what_lies_behind_beside_or_along_the_plane_is_no_hit() {
        for (origin, direction) in [
            ([0.25, 0.25, 1.0], [0.0, 0.0, 1.0]),
            ([0.75, 0.75, 1.0], [0.0, 0.0, -1.0]),
            ([-0.01, 0.5, 1.0], [0.0, 0.0, -1.0]),
            ([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0]),
        ] {
            assert_eq!(
                intersect_triangle(ray(origin, direction), TRIANGLE),
                None,
                "{origin:?} {direction:?}"
            );
        }
    }

    #[test]
    fn no_ray_passes_between_two_triangles() {
        // A fan around a corner that f32 cannot represent exactly, and rays to points on its edges.
        let centre = DVec3::new(0.1, 0.2, 0.3);
        let rim = |i: u32| {
            let angle = f64::from(i) * 0.7;
            DVec3::new(angle.cos() * 1.3, angle.sin() * 0.7, 0.1 * angle.sin())
        };
        let origin = DVec3::new(0.3, -0.4, 5.0);
        for i in 1..8 {
            for step in 0..100 {
                let target = centre.lerp(rim(i), 0.9 * f64::from(step) / 99.0);
                let ray = Ray {
                    origin,
                    direction: target - origin,
                };
                let hit = (0..9).any(|j| intersect_triangle(ray, [centre, rim(j), rim(j + 1)]).is_some());
                assert!(hit, "the ray through {target} on edge {i} passes");
            }
        }
    }
}
