//! Finds coincident faces. Rounding decides which of them a ray hits first, and the offset of the next ray's origin would skip
//! the other. So triangles are marked, and for marked triangles the kernels search for the other face.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use crate::layout::{
    BACK_EMITS, BACKED, BvhRecord, COINCIDENT, DIELECTRIC, Instance, LEAF, Material, OPAQUE, PARALLEL,
    PLACEMENT_RECORD, ROUNDINGS, ShadingTriangle, TOUCHED,
};
use crate::scene::Placement;

/// Maximum number of triangles of all instances of a primitive that are tested. With more, all dielectrics are assumed to touch
/// something, which costs the kernels a search, and others to touch nothing.
const MOST_PLACED: usize = 1 << 18;
/// Maximum number of nodes and leaves that are visited for each triangle.
const MOST_VISITS: usize = 1 << 13;
/// In addition to the flags of a triangle: it coincides with a face of the same object that faces the other side.
const DOUBLED: u32 = 1 << 31;

/// The coincident faces of a scene.
pub(crate) struct CoincidentFaces {
    /// Of each triangle: [`TOUCHED`], [`COINCIDENT`], [`BACKED`].
    pub flags: Vec<u32>,
    /// Whether an object has coincident faces that face opposite sides.
    pub doubled: bool,
}

/// Finds coincident faces, also of instances. A superset for dielectrics.
pub(crate) fn coincident_faces(
    records: &[BvhRecord],
    triangles: &[ShadingTriangle],
    instances: &[Instance],
    materials: &[Material],
) -> CoincidentFaces {
    let shared = instances.iter().map(|instance| instance.first_triangle).min();
    let own = &triangles[..shared.map_or(triangles.len(), |first| first as usize)];
    let scene = Scene {
        records,
        triangles,
        materials,
        faces: own.par_iter().map(|triangle| Face::new(triangle, None)).collect(),
        places: instances.iter().map(Place::new).collect(),
    };
    let mut found: Vec<u32> = own
        .par_iter()
        .zip(&scene.faces)
        .map(|(triangle, face)| face.flags(&scene, triangle.material))
        .collect();
    found.resize(triangles.len(), 0);
    let mut placed: BTreeMap<(usize, usize), Vec<&Place>> = BTreeMap::new();
    for (instance, place) in instances.iter().zip(&scene.places) {
        let shared = (instance.first_triangle as usize, instance.triangle_count as usize);
        placed.entry(shared).or_default().push(place);
    }
    for ((first, count), places) in placed {
        let found = &mut found[first..first + count];
        let material = triangles[first].material;
        if places.len() * count > MOST_PLACED {
            found.fill(if scene.is_dielectric(material) { TOUCHED } else { 0 });
            continue;
        }
        let triangles = found.par_iter_mut().zip(&triangles[first..]);
        triangles.for_each(|(found, triangle)| {
            let of_place = |place: &&Place| Face::new(triangle, Some(*place)).flags(&scene, material);
            *found = places.iter().map(of_place).fold(0, |all, of_one| all | of_one);
        });
    }
    let doubled = found.par_iter().any(|found| found & DOUBLED != 0);
    for found in &mut found {
        *found &= !DOUBLED;
    }
    CoincidentFaces { flags: found, doubled }
}

/// The faces that may coincide.
struct Scene<'a> {
    records: &'a [BvhRecord],
    triangles: &'a [ShadingTriangle],
    materials: &'a [Material],
    /// Triangles that are not shared.
    faces: Vec<Face>,
    /// Of the instances.
    places: Vec<Place>,
}

impl Scene<'_> {
    fn is_dielectric(&self, material: u32) -> bool {
        self.materials[material as usize].surface == DIELECTRIC
    }
}

/// The placement of an instance.
struct Place {
    placement: Placement,
    object: u32,
    /// Uncertainty of the positions of its planes.
    reach: f32,
}

impl Place {
    fn new(instance: &Instance) -> Self {
        let placement = Placement { rows: instance.rows };
        Self {
            placement,
            object: instance.object,
            reach: 2.0 * ROUNDINGS as f32 * placement.reach().element_sum(),
        }
    }

    /// A box around a transformed box.
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
    /// Of the front.
    normal: Vec3,
    object: u32,
    low: Vec3,
    high: Vec3,
    /// Uncertainty of the plane's position, to both sides.
    reach: f32,
    /// The part of it that is due to an instance.
    place_reach: f32,
}

impl Face {
    fn new(triangle: &ShadingTriangle, place: Option<&Place>) -> Self {
        let corners = [triangle.p0, triangle.p1, triangle.p2].map(Vec3::from);
        Self::of_corners(corners, triangle.object, place)
    }

    fn of_corners(corners: [Vec3; 3], object: u32, place: Option<&Place>) -> Self {
        let corners = corners.map(|corner| place.map_or(corner, |place| place.placement.point(corner)));
        let [a, b, c] = corners;
        let largest = a.abs().max(b.abs()).max(c.abs());
        let reach = 2.0 * ROUNDINGS as f32 * largest.element_sum();
        let normal = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize().as_vec3();
        Self {
            corners,
            normal: if place.is_some_and(|place| place.placement.is_mirrored()) {
                -normal
            } else {
                normal
            },
            object: place.map_or(object, |place| place.object),
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            reach: place.map_or(reach, |place| reach.max(place.reach)),
            place_reach: place.map_or(0.0, |place| place.reach),
        }
    }

    /// The flags of a triangle of this material, and [`DOUBLED`].
    fn flags(&self, scene: &Scene<'_>, material: u32) -> u32 {
        let mut found = 0;
        let all = if scene.is_dielectric(material) {
            TOUCHED | DOUBLED
        } else {
            COINCIDENT | BACKED | DOUBLED
        };
        // The boxes of render space do not include the uncertainty of instances.
        let uncertain = Vec3::splat(scene.places.iter().map(|place| place.reach).fold(0.0, f32::max));
        let mut stack = vec![(0, None)];
        for _ in 0..MOST_VISITS {
            let Some((reference, place)) = stack.pop() else {
                return found;
            };
            let first = (reference & !LEAF) as usize;
            if reference & LEAF == 0 {
                let node = scene.records[first].node();
                let children = [
                    (node.left, node.left_low, node.left_high),
                    (node.right, node.right_low, node.right_high),
                ];
                for (child, low, high) in children {
                    let (corner, opposite) = (Vec3::from(low), Vec3::from(high));
                    let (corner, opposite) = place
                        .map_or((corner - uncertain, opposite + uncertain), |place: &Place| {
                            place.place_box(corner, opposite)
                        });
                    if self.overlaps_box(corner, opposite) {
                        stack.push((child, place));
                    }
                }
                continue;
            }
            for (index, record) in (first..).zip(&scene.records[first..]) {
                let triangle = record.triangle();
                let number = triangle.index as usize;
                if triangle.kind == PLACEMENT_RECORD {
                    let root = scene.records[index + 1].instance().index;
                    stack.push((root, Some(&scene.places[number])));
                    break;
                }
                let other_material = scene.triangles[number].material;
                found |= match place {
                    None => self.flags_beside(&scene.faces[number], scene, [material, other_material]),
                    Some(place) => {
                        let corners = [triangle.p0, triangle.p1, triangle.p2].map(Vec3::from);
                        if self.is_near(corners.map(|corner| place.placement.point(corner)), place.reach) {
                            let other = Self::of_corners(corners, 0, Some(place));
                            self.flags_beside(&other, scene, [material, other_material])
                        } else {
                            0
                        }
                    }
                };
                if found == all {
                    return found;
                }
                if triangle.last == 1 {
                    break;
                }
            }
        }
        // Too many triangles in one place: the assumption for those that were not visited is as above.
        if scene.is_dielectric(material) { TOUCHED } else { found }
    }

    /// Whether a box around corners overlaps the box of this face.
    fn is_near(&self, [a, b, c]: [Vec3; 3], reach: f32) -> bool {
        self.overlaps_box(a.min(b).min(c) - reach, a.max(b).max(c) + reach)
    }

    fn overlaps_box(&self, low: Vec3, high: Vec3) -> bool {
        let reach = Vec3::splat(self.reach);
        (self.low - reach).cmple(high).all() && (self.high + reach).cmpge(low).all()
    }

    /// The flags that the other face adds.
    fn flags_beside(&self, other: &Self, scene: &Scene<'_>, materials: [u32; 2]) -> u32 {
        let cosine = self.normal.dot(other.normal);
        let same_object = self.object == other.object;
        let see_through = scene.materials[materials[0] as usize].alpha_mode != OPAQUE;
        let alike = same_object && cosine > 0.0 && !see_through;
        if cosine.abs() <= PARALLEL as f32 || alike || !self.touches(other) {
            return 0;
        }
        let [own, others] = materials.map(|material| &scene.materials[material as usize]);
        if own.surface == DIELECTRIC {
            return if same_object { TOUCHED | DOUBLED } else { TOUCHED };
        }
        // Glass on an opaque face needs no flag.
        if others.surface == DIELECTRIC || !self.overlaps(other) {
            return 0;
        }
        let emits_through = others.flags & BACK_EMITS != 0 && others.emission != [0.0; 3] && !same_object;
        let emits = others.emission != [0.0; 3];
        match (same_object, cosine > 0.0 || emits_through) {
            // Only if they emit it matters which of them is hit.
            (true, false) if emits => DOUBLED | BACKED,
            (true, _) => DOUBLED,
            (false, true) => COINCIDENT,
            (false, false) => BACKED,
        }
    }

    /// Whether the faces, which are parallel, can share a point: a superset of those that do.
    fn touches(&self, other: &Self) -> bool {
        let margin = Vec3::splat(other.place_reach);
        if !self.overlaps_box(other.low - margin, other.high + margin) {
            return false;
        }
        let height = |corner: &Vec3| other.normal.dot(*corner - other.corners[0]);
        let [a, b, c] = [0, 1, 2].map(|corner| height(&self.corners[corner]));
        let reach = self.reach.max(other.reach);
        a.min(b).min(c) <= reach && a.max(b).max(c) >= -reach
    }

    /// Whether the faces, which lie in one plane, share more than a line: no edge of either has the other face on its far side.
    fn overlaps(&self, other: &Self) -> bool {
        let reach = self.reach.max(other.reach);
        let is_beside = |face: &Self, beside: &Self| {
            (0..3).any(|edge| {
                let [from, to, opposite] = [0, 1, 2].map(|i| face.corners[(edge + i) % 3]);
                let mut inwards = face.normal.cross(to - from).normalize_or_zero();
                inwards *= inwards.dot(opposite - from).signum();
                beside.corners.iter().all(|corner| inwards.dot(*corner - from) <= reach)
            })
        };
        !is_beside(self, other) && !is_beside(other, self)
    }
}
