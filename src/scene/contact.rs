//! Finds where dielectrics touch other objects. Rounding decides which of two faces in one place a ray meets first, and the
//! step off the one would take it past the other: the kernels look for the other face where a triangle is marked.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use super::Placement;
use super::features::DIELECTRIC;
use crate::layout::{BvhRecord, Instance, LEAF, Material, PLACEMENT_RECORD, ShadingTriangle};

/// As `offset_origin` in `glsl/shared/scene.glsl`: rays leave surfaces by that much of their corners' coordinates.
const ROUNDINGS: f32 = 16.0 / 16_777_216.0;
/// Cosine of the angle between planes up to which faces can lie on each other over more than a line.
const PARALLEL: f32 = 0.99;
/// Triangles of all instances of a primitive that are looked at; where there are more, all are taken to touch something,
/// which costs the kernels a look.
const MOST_PLACED: usize = 1 << 20;

/// Whether each triangle is a dielectric's and may lie, with some part, on a triangle of another object, wherever an instance
/// puts it.
pub(super) fn touched(
    records: &[BvhRecord],
    triangles: &[ShadingTriangle],
    instances: &[Instance],
    materials: &[Material],
) -> Vec<bool> {
    let is_dielectric = |triangle: &ShadingTriangle| materials[triangle.material as usize].surface == DIELECTRIC;
    let shared = instances.iter().map(|instance| instance.first_triangle).min();
    let own = &triangles[..shared.map_or(triangles.len(), |first| first as usize)];
    let scene = Scene {
        records,
        faces: own.iter().map(|triangle| Face::new(triangle, None)).collect(),
        places: instances.iter().map(Place::new).collect(),
    };
    let own = own.par_iter().zip(&scene.faces);
    let mut touched: Vec<bool> = own
        .map(|(triangle, face)| is_dielectric(triangle) && face.touches_any(&scene))
        .collect();
    touched.resize(triangles.len(), false);
    let mut placed: BTreeMap<(usize, usize), Vec<&Place>> = BTreeMap::new();
    for (instance, place) in instances.iter().zip(&scene.places) {
        let shared = (instance.first_triangle as usize, instance.triangle_count as usize);
        placed.entry(shared).or_default().push(place);
    }
    for ((first, count), places) in placed {
        if !is_dielectric(&triangles[first]) {
            continue;
        }
        let all = places.len() * count > MOST_PLACED;
        let triangles = touched[first..first + count].par_iter_mut().zip(&triangles[first..]);
        triangles.for_each(|(touched, triangle)| {
            let touches = |place: &&Place| Face::new(triangle, Some(*place)).touches_any(&scene);
            *touched = all || places.iter().any(touches);
        });
    }
    touched
}

/// What may touch.
struct Scene<'a> {
    records: &'a [BvhRecord],
    /// Triangles that aren't shared.
    faces: Vec<Face>,
    /// Of the instances.
    places: Vec<Place>,
}

/// Where an instance is.
struct Place {
    placement: Placement,
    object: u32,
    /// What its planes are uncertain by.
    reach: f32,
}

impl Place {
    fn new(instance: &Instance) -> Self {
        let placement = Placement { rows: instance.rows };
        Self {
            placement,
            object: instance.object,
            reach: 2.0 * ROUNDINGS * placement.reach().element_sum(),
        }
    }

    /// A box around a box that it puts somewhere.
    fn place_box(&self, low: Vec3, high: Vec3) -> (Vec3, Vec3) {
        let centre = self.placement.point(0.5 * (low + high));
        let half = 0.5 * (high - low);
        let half = Vec3::from_array(
            self.placement
                .rows
                .map(|[x, y, z, _]| x.abs() * half.x + y.abs() * half.y + z.abs() * half.z),
        );
        (centre - half - self.reach, centre + half + self.reach)
    }
}

struct Face {
    corners: [Vec3; 3],
    normal: Vec3,
    object: u32,
    low: Vec3,
    high: Vec3,
    /// What the plane is uncertain by, on both sides.
    reach: f32,
    /// The part of that which an instance makes.
    place_reach: f32,
}

impl Face {
    fn new(triangle: &ShadingTriangle, place: Option<&Place>) -> Self {
        let corners = [triangle.p0, triangle.p1, triangle.p2].map(|[x, y, z, _]| Vec3::new(x, y, z));
        Self::of_corners(corners, triangle.object, place)
    }

    fn of_corners(corners: [Vec3; 3], object: u32, place: Option<&Place>) -> Self {
        let corners = corners.map(|corner| place.map_or(corner, |place| place.placement.point(corner)));
        let [a, b, c] = corners;
        let largest = a.abs().max(b.abs()).max(c.abs());
        let reach = 2.0 * ROUNDINGS * largest.element_sum();
        Self {
            corners,
            normal: (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize().as_vec3(),
            object: place.map_or(object, |place| place.object),
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            reach: place.map_or(reach, |place| reach.max(place.reach)),
            place_reach: place.map_or(0.0, |place| place.reach),
        }
    }

    fn touches_any(&self, scene: &Scene<'_>) -> bool {
        let xyz = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
        let mut stack = vec![(0, None)];
        while let Some((reference, place)) = stack.pop() {
            let first = (reference & !LEAF) as usize;
            if reference & LEAF == 0 {
                let node = &scene.records[first];
                for (low, high) in [(node.row0, node.row1), (node.row2, node.row3)] {
                    let (corner, opposite) = (xyz(low), xyz(high));
                    let (corner, opposite) =
                        place.map_or((corner, opposite), |place: &Place| place.place_box(corner, opposite));
                    if self.meets_box(corner, opposite) {
                        stack.push((low[3].to_bits(), place));
                    }
                }
                continue;
            }
            for (index, record) in (first..).zip(&scene.records[first..]) {
                let number = record.row3[0].to_bits() as usize;
                if record.row3[2].to_bits() == PLACEMENT_RECORD {
                    let root = scene.records[index + 1].row3[0].to_bits();
                    stack.push((root, Some(&scene.places[number])));
                    break;
                }
                let touches = match place {
                    None => self.touches(&scene.faces[number]),
                    Some(_) => {
                        let corners = [record.row0, record.row1, record.row2].map(xyz);
                        self.touches(&Self::of_corners(corners, 0, place))
                    }
                };
                if touches {
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
        let reach = Vec3::splat(other.place_reach);
        if self.object == other.object || !parallel || !self.meets_box(other.low - reach, other.high + reach) {
            return false;
        }
        let height = |corner: &Vec3| other.normal.dot(*corner - other.corners[0]);
        let [a, b, c] = [0, 1, 2].map(|corner| height(&self.corners[corner]));
        let reach = self.reach.max(other.place_reach);
        a.min(b).min(c) <= reach && a.max(b).max(c) >= -reach
    }
}
