//! Finds where dielectrics touch other objects. Rounding decides which of two faces in one place a ray meets first, and the
//! step off the one would take it past the other: the kernels look for the other face where a triangle is marked.

use glam::Vec3;
use rayon::prelude::*;

use super::features::DIELECTRIC;
use crate::layout::{BvhRecord, LEAF, Material, ShadingTriangle};

/// As `offset_origin` in `glsl/shared/scene.glsl`: rays leave surfaces by that much of their corners' coordinates.
const ROUNDINGS: f32 = 16.0 / 16_777_216.0;
/// Cosine of the angle between planes up to which faces can lie on each other over more than a line.
const PARALLEL: f32 = 0.99;

/// Whether each triangle is a dielectric's and may lie, with some part, on a triangle of another object.
pub(super) fn touched(records: &[BvhRecord], triangles: &[ShadingTriangle], materials: &[Material]) -> Vec<bool> {
    let is_dielectric = |triangle: &ShadingTriangle| materials[triangle.material as usize].surface == DIELECTRIC;
    let faces: Vec<Face> = triangles.iter().map(Face::new).collect();
    triangles
        .par_iter()
        .zip(&faces)
        .map(|(triangle, face)| is_dielectric(triangle) && face.touches_any(records, &faces))
        .collect()
}

struct Face {
    corners: [Vec3; 3],
    normal: Vec3,
    object: u32,
    low: Vec3,
    high: Vec3,
    /// What the plane is uncertain by, on both sides.
    reach: f32,
}

impl Face {
    fn new(triangle: &ShadingTriangle) -> Self {
        let corners = [triangle.p0, triangle.p1, triangle.p2].map(|[x, y, z, _]| Vec3::new(x, y, z));
        let [a, b, c] = corners;
        let largest = a.abs().max(b.abs()).max(c.abs());
        Self {
            corners,
            normal: (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize().as_vec3(),
            object: triangle.object,
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            reach: 2.0 * ROUNDINGS * largest.element_sum(),
        }
    }

    fn touches_any(&self, records: &[BvhRecord], faces: &[Self]) -> bool {
        let mut stack = vec![0];
        while let Some(reference) = stack.pop() {
            if reference & LEAF == 0 {
                let node = &records[reference as usize];
                for (low, high) in [(node.row0, node.row1), (node.row2, node.row3)] {
                    if self.meets_box(Vec3::new(low[0], low[1], low[2]), Vec3::new(high[0], high[1], high[2])) {
                        stack.push(low[3].to_bits());
                    }
                }
                continue;
            }
            for record in &records[(reference & !LEAF) as usize..] {
                if self.touches(&faces[record.row3[0].to_bits() as usize]) {
                    return true;
                }
                if record.row3[1].to_bits() == 1 {
                    break;
                }
            }
        }
        false
    }

    fn meets_box(&self, low: Vec3, high: Vec3) -> bool {
        let reach = Vec3::splat(self.reach);
        (self.low - reach).cmple(high).all() && (self.high + reach).cmpge(low).all()
    }

    /// Whether the faces can share more than a line: a superset of those that do.
    fn touches(&self, other: &Self) -> bool {
        let parallel = self.normal.dot(other.normal).abs() > PARALLEL;
        if self.object == other.object || !parallel || !self.meets_box(other.low, other.high) {
            return false;
        }
        let height = |corner: &Vec3| other.normal.dot(*corner - other.corners[0]);
        let [a, b, c] = [0, 1, 2].map(|corner| height(&self.corners[corner]));
        a.min(b).min(c) <= self.reach && a.max(b).max(c) >= -self.reach
    }
}
