//! Rays against triangles, in f64: the counterpart of `glsl/shared/intersect.glsl`.

use std::ops::Range;

use glam::DVec3;

use super::Inputs;
use super::vector::{word, xyz};
use crate::config::Accel;
use crate::layout::{BvhRecord, LEAF, ShadingTriangle};

/// The points `origin + t · direction` with t > 0.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Where it starts, render units.
    pub origin: DVec3,
    /// Need not be a unit vector.
    pub direction: DVec3,
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f64,
    /// Barycentric coordinate of the triangle's second corner.
    pub u: f64,
    /// Barycentric coordinate of its third corner.
    pub v: f64,
    /// Index of the triangle in the order of the BVH's leaves.
    pub triangle: u32,
}

/// The nearest triangle but `ignored` before t = `limit`.
pub fn nearest_hit(inputs: &Inputs<'_>, ray: Ray, limit: f64, ignored: Option<u32>) -> Option<Hit> {
    Search::new(inputs, ray, limit, ignored, false).run(inputs)
}

/// Whether any triangle but `ignored` lies before t = `limit`.
pub fn is_blocked(inputs: &Inputs<'_>, ray: Ray, limit: f64, ignored: Option<u32>) -> bool {
    Search::new(inputs, ray, limit, ignored, true).run(inputs).is_some()
}

/// A search for the nearest or for any hit.
struct Search<'a> {
    triangles: &'a [ShadingTriangle],
    ray: Ray,
    ignored: Option<u32>,
    any: bool,
    /// t of the nearest hit so far.
    limit: f64,
    hit: Option<Hit>,
}

impl<'a> Search<'a> {
    fn new(inputs: &Inputs<'a>, ray: Ray, limit: f64, ignored: Option<u32>, any: bool) -> Self {
        Self {
            triangles: &inputs.scene.shading_triangles,
            ray,
            ignored,
            any,
            limit,
            hit: None,
        }
    }

    fn run(mut self, inputs: &Inputs<'_>) -> Option<Hit> {
        match inputs.config.accel {
            Accel::Brute => self.test(0..self.triangles.len() as u32),
            Accel::Bvh => self.traverse(&inputs.scene.bvh),
        }
        self.hit
    }

    fn is_over(&self) -> bool {
        self.any && self.hit.is_some()
    }

    fn test(&mut self, triangles: Range<u32>) {
        for index in triangles {
            if self.ignored == Some(index) || self.is_over() {
                continue;
            }
            let triangle = &self.triangles[index as usize];
            let corners = [triangle.p0, triangle.p1, triangle.p2].map(xyz);
            if let Some((t, u, v)) = intersect_triangle(self.ray, corners)
                && t < self.limit
            {
                self.limit = t;
                self.hit = Some(Hit {
                    t,
                    u,
                    v,
                    triangle: index,
                });
            }
        }
    }

    fn traverse(&mut self, records: &[BvhRecord]) {
        // A component of 0 gives infinite slabs; ±1e-20 keeps 0 · ∞ out of them.
        let safe = |d: f64| if d.abs() < 1e-20 { 1e-20 } else { d };
        let inverse = self.ray.direction.map(safe).recip();
        let mut stack = Vec::with_capacity(64);
        stack.push((0, 0.0));
        while let Some((reference, enter)) = stack.pop() {
            if enter > self.limit || self.is_over() {
                continue;
            }
            if reference & LEAF != 0 {
                self.test(leaf(records, reference));
                continue;
            }
            let [left, right] = children(&records[reference as usize], self.ray.origin, inverse, self.limit);
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

/// The triangles of a leaf.
fn leaf(records: &[BvhRecord], reference: u32) -> Range<u32> {
    let triangles = &records[(reference & !LEAF) as usize..];
    let first = triangles[0].row3[0].to_bits();
    let others = triangles.iter().position(|triangle| triangle.row3[1].to_bits() == 1);
    first..first + 1 + others.unwrap_or(0) as u32
}

/// The references to those children of a node whose boxes the ray enters before `limit`, and t at the entry.
fn children(node: &BvhRecord, origin: DVec3, inverse: DVec3, limit: f64) -> [Option<(u32, f64)>; 2] {
    [(node.row0, node.row1), (node.row2, node.row3)].map(|(min, max)| {
        let (t0, t1) = ((xyz(min) - origin) * inverse, (xyz(max) - origin) * inverse);
        let enter = t0.min(t1).max_element().max(0.0);
        // The factor covers the rounding of the slab test: Ize, «Robust BVH Ray Traversal», JCGT 2(2), 2013.
        let leave = t0.max(t1).min_element().min(limit) * (1.0 + 4.0 * f64::EPSILON);
        (enter <= leave).then_some((word(min), enter))
    })
}

/// t > 0 and the barycentric coordinates of the second and the third corner, by the signed volumes that the ray spans
/// with each edge: Kensler and Shirley, «Optimizing Ray-Triangle Intersection via Automated Search», 2006. Two
/// triangles that share an edge compute the same volume for it, up to the sign, so that no ray passes between them.
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
        // A fan around a corner that f32 can't hold exactly, and rays at points of its edges.
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
