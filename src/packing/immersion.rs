//! The media that a point is in: needed for paths that start in water.

use glam::{DMat3, DVec2, DVec3, Vec3};

use super::Part;
use super::nesting::{Nesting, is_solid};
use crate::layout::{Light, POINT_LIGHT, RANK, SPOT_LIGHT, TRIANGLE_LIGHT, VACUUM};
use crate::scene::{Object, Scene};

/// In no medium.
pub(crate) const IN_VACUUM: [u32; 4] = [VACUUM; 4];

/// Distance from a lamp's face at which its medium is determined, in render units: more than the offset of ray origins.
const OFF_FACE: f32 = 1e-5;
/// Triangles in a cell of a column grid, on average.
const A_CELL: usize = 4;

/// The solid dielectrics of a scene, to find the media of a point.
#[derive(Debug, Clone, Default)]
pub struct Immersion {
    solids: Vec<Solid>,
    /// Whether a point can be in several.
    nested: bool,
}

/// A solid's triangles, projected along a line that no edge is likely to be parallel to, in the columns of a grid across the
/// line.
#[derive(Debug, Clone)]
struct Solid {
    medium: u32,
    low: DVec2,
    cell: DVec2,
    cells: [usize; 2],
    /// Index of each column's first triangle, and the end.
    starts: Vec<usize>,
    /// The triangles of the columns, one column after the other.
    triangles: Vec<u32>,
    /// Projected along the line.
    corners: Vec<[Vec3; 3]>,
}

impl Immersion {
    pub(crate) fn new(scene: &Scene, nesting: &Nesting) -> Self {
        let solids = scene.objects.iter().zip(&nesting.ranks);
        let solids = solids
            .filter(|(object, _)| is_solid(scene, object.material) && !object.triangles.is_empty())
            .map(|(object, rank)| Solid::new(scene, object, rank << RANK | object.material));
        Self {
            solids: solids.collect(),
            nested: nesting.overlaps,
        }
    }

    /// The media that a point is in, the lowest first; [`u32::MAX`] if there are fewer than four.
    ///
    /// A point is in a closed solid, or behind the back of an open sheet. A closed mesh whose faces face inwards is a cavity in
    /// another mesh of its material.
    pub fn media_at(&self, point: Vec3) -> [u32; 4] {
        let mut media = Vec::new();
        let mut hollows = Vec::new();
        let seen = view() * point.as_dvec3();
        for solid in &self.solids {
            let sides = solid.sides(seen);
            if sides > 0 {
                media.push(solid.medium);
            } else if sides < -1 {
                hollows.push(solid.medium);
            }
        }
        let material = |medium: u32| medium & !(u32::MAX << RANK);
        for hollow in hollows {
            if let Some(filled) = media.iter().position(|&medium| material(medium) == material(hollow)) {
                media.swap_remove(filled);
            }
        }
        media.sort_unstable();
        media.dedup();
        media.truncate(if self.nested { 4 } else { 1 });
        media.resize(4, VACUUM);
        media.try_into().expect("four media")
    }

    /// The media of each light. Distant light comes from a vacuum. `corners`: of all triangles.
    pub(crate) fn of_lights(&self, lights: &[Light], corners: &[[Vec3; 3]]) -> Vec<[u32; 4]> {
        if self.solids.is_empty() {
            return vec![IN_VACUUM; lights.len()];
        }
        let of_light = |light: &Light| match light.kind {
            TRIANGLE_LIGHT => {
                let [a, b, c] = corners[light.triangle as usize];
                let normal = (b - a)
                    .as_dvec3()
                    .cross((c - a).as_dvec3())
                    .normalize_or_zero()
                    .as_vec3();
                self.media_at((a + b + c) / 3.0 + OFF_FACE * normal)
            }
            POINT_LIGHT | SPOT_LIGHT => self.media_at(light.position.into()),
            _ => IN_VACUUM,
        };
        // The parts of a triangle are consecutive.
        let mut media: Vec<[u32; 4]> = Vec::with_capacity(lights.len());
        for (index, light) in lights.iter().enumerate() {
            let is_next_part = light.kind == TRIANGLE_LIGHT && Part::of(light).number() > 0;
            media.push(if is_next_part {
                media[index - 1]
            } else {
                of_light(light)
            });
        }
        media
    }
}

/// Render space projected along the line, which is nearly vertical, because open sheets of water are horizontal.
fn view() -> DMat3 {
    let along = DVec3::new(0.061_803, 1.0, 0.041_421).normalize();
    let across = along.cross(DVec3::new(0.577_216, 0.0, 0.816_497)).normalize();
    DMat3::from_cols(across, along.cross(across), along).transpose()
}

impl Solid {
    fn new(scene: &Scene, object: &Object, medium: u32) -> Self {
        let mirrored = object.placement.is_some_and(|placement| placement.is_mirrored());
        let view = view();
        let seen = |corner: Vec3| (view * object.placed(corner).as_dvec3()).as_vec3();
        let triangles = object.triangles.clone();
        let corners: Vec<[Vec3; 3]> = triangles
            .map(|triangle| {
                let [a, b, c] = scene.corners_of(triangle).map(seen);
                // Mirrored instances exchange front and back; the renderer turns their faces round.
                if mirrored { [a, c, b] } else { [a, b, c] }
            })
            .collect();
        Self::of_corners(medium, corners)
    }

    /// corners: projected along the line.
    fn of_corners(medium: u32, corners: Vec<[Vec3; 3]>) -> Self {
        let all = || corners.iter().flatten().map(|corner| corner.truncate().as_dvec2());
        let low = all().fold(DVec2::INFINITY, DVec2::min);
        let high = all().fold(DVec2::NEG_INFINITY, DVec2::max);
        let side = ((corners.len() / A_CELL) as f64).sqrt().ceil().max(1.0);
        let cell = ((high - low) / side).max(DVec2::splat(f64::from(f32::MIN_POSITIVE)));
        let mut solid = Self {
            medium,
            low,
            cell,
            cells: [side as usize; 2],
            starts: Vec::new(),
            triangles: Vec::new(),
            corners,
        };
        solid.fill();
        solid
    }

    /// Distributes the triangles over the columns: counts, then places them.
    fn fill(&mut self) {
        let [columns, rows] = self.cells;
        let covered = |corners: &[Vec3; 3]| {
            let flat = corners.map(|corner| corner.truncate().as_dvec2());
            let [x0, y0] = self.column(flat[0].min(flat[1]).min(flat[2]));
            let [x1, y1] = self.column(flat[0].max(flat[1]).max(flat[2]));
            (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| y * columns + x))
        };
        let mut starts = vec![0; columns * rows + 1];
        for column in self.corners.iter().flat_map(covered) {
            starts[column + 1] += 1;
        }
        for column in 0..columns * rows {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut triangles = vec![0; starts[columns * rows]];
        for (triangle, corners) in self.corners.iter().enumerate() {
            for column in covered(corners) {
                triangles[next[column]] = triangle as u32;
                next[column] += 1;
            }
        }
        self.starts = starts;
        self.triangles = triangles;
    }

    /// The column of a point across the line; the nearest column if it lies outside.
    fn column(&self, across: DVec2) -> [usize; 2] {
        let place = (across - self.low) / self.cell;
        [0, 1].map(|axis| (place[axis] as usize).min(self.cells[axis] - 1))
    }

    /// The number of backs minus that of fronts on the line, from a point to both ends: 2 inside a closed solid. `seen`: the
    /// point, projected.
    fn sides(&self, seen: DVec3) -> i32 {
        let across = seen.truncate();
        let [x, y] = self.column(across);
        let column = y * self.cells[0] + x;
        let side = |&triangle: &u32| {
            let corners = self.corners[triangle as usize].map(Vec3::as_dvec3);
            let [a, b, c] = corners.map(|corner| corner.truncate() - across);
            let weights = [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)];
            let met = weights.iter().all(|&weight| weight > 0.0) || weights.iter().all(|&weight| weight < 0.0);
            if !met {
                return 0;
            }
            let sum: f64 = weights.iter().sum();
            let height = (weights[0] * corners[0].z + weights[1] * corners[1].z + weights[2] * corners[2].z) / sum;
            // Above the point, the line passes a back if the normal points up.
            let looks_up = sum > 0.0;
            if looks_up == (height > seen.z) { 1 } else { -1 }
        };
        let triangles = &self.triangles[self.starts[column]..self.starts[column + 1]];
        triangles.iter().map(side).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box whose faces face outwards, or inwards, projected along the line.
    fn block(medium: u32, low: Vec3, high: Vec3, inwards: bool) -> Solid {
        let corner = |i: usize| Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low);
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let view = view();
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let corners: Vec<[Vec3; 3]> = triangles
            .map(|triangle| {
                let [a, b, c] = triangle.map(|i| (view * corner(i).as_dvec3()).as_vec3());
                if inwards { [a, c, b] } else { [a, b, c] }
            })
            .collect();
        Solid::of_corners(medium, corners)
    }

    fn names(immersion: &Immersion, point: Vec3) -> Vec<u32> {
        let media = immersion.media_at(point);
        media.into_iter().take_while(|&medium| medium != VACUUM).collect()
    }

    #[test]
    fn a_point_is_in_the_solids_around_it_but_not_in_their_hollows() {
        let (glass, hollow, liquid) = (2 << RANK | 7, 1 << RANK | 7, 5);
        let cube = |half: f32| (Vec3::splat(-half), Vec3::splat(half));
        let solids = vec![
            block(glass, cube(1.0).0, cube(1.0).1, false),
            block(hollow, cube(0.5).0, cube(0.5).1, true),
            block(liquid, cube(0.6).0, cube(0.6).1, false),
        ];
        let immersion = Immersion { solids, nested: true };
        assert_eq!(names(&immersion, Vec3::ZERO), [liquid]);
        assert_eq!(names(&immersion, Vec3::splat(0.55)), [liquid, glass]);
        assert_eq!(names(&immersion, Vec3::new(0.0, 0.8, 0.0)), [glass]);
        assert_eq!(names(&immersion, Vec3::new(0.0, -1.1, 0.0)), [] as [u32; 0]);
        assert_eq!(names(&immersion, Vec3::new(3.0, 0.0, 0.0)), [] as [u32; 0]);
    }

    #[test]
    fn a_point_is_under_a_sheet_of_water_and_not_above_it() {
        let view = view();
        let corner = |x: f32, z: f32| (view * Vec3::new(x, 0.0, z).as_dvec3()).as_vec3();
        let [a, b, c, d] = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| corner(x, z));
        let water = Solid::of_corners(3, vec![[a, b, c], [a, c, d]]);
        let immersion = Immersion {
            solids: vec![water],
            nested: false,
        };
        assert_eq!(names(&immersion, Vec3::new(0.1, -0.5, 0.2)), [3]);
        assert_eq!(names(&immersion, Vec3::new(0.1, 0.5, 0.2)), [] as [u32; 0]);
    }
}
