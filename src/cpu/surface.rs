//! Surface points and ray origins.

use glam::{DMat3, DVec3};

use super::intersect::{Hit, PlacedTriangle};
use super::sampling::decode_direction;
use crate::layout::{Material, RANK, ROUNDINGS, SMOOTH_SHADED, ShadingTriangle};
use crate::packing::PackedScene;

/// A point on a triangle.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// The triangle.
    pub triangle: PlacedTriangle,
    /// Barycentric coordinates of the second and the third corner.
    pub uv: [f64; 2],
    /// In render units.
    pub position: DVec3,
    /// Bound of the coordinates for rounding errors: largest absolute coordinates of the corners, or of the terms that make them.
    pub reach: DVec3,
    /// Unit vector on the triangle's front.
    pub geometric_normal: DVec3,
    /// On the same side.
    pub shading_normal: DVec3,
    /// The clear coat's normal, on the same side.
    pub coat_normal: DVec3,
    /// Index of the object.
    pub object: u32,
    /// Without textures, until [`super::texture::apply_textures`].
    pub material: Material,
    /// Index of the material.
    pub material_index: u32,
    /// Index of the light, or [`crate::layout::NO_LIGHT`].
    pub light: u32,
    /// The triangle's flags.
    pub flags: u32,
}

/// The point at the barycentric coordinates `u` and `v` of the second and the third corner.
pub fn surface_at(scene: &PackedScene, at: PlacedTriangle, u: f64, v: f64) -> Surface {
    let triangle = &scene.shading_triangles[at.triangle as usize];
    let [p0, p1, p2] = at.corners(scene);
    let mut geometric_normal = (p1 - p0).cross(p2 - p0).normalize();
    let mut reach = p0.abs().max(p1.abs()).max(p2.abs());
    let mut object = triangle.object;
    let mut flags = triangle.flags;
    let mut normal_matrix = None;
    if let (Some(index), Some(placement)) = (at.instance, at.placement(scene)) {
        if placement.is_mirrored() {
            geometric_normal = -geometric_normal;
        }
        // The uncertainty of the corners relative to those of coincident objects.
        reach = placement.reach().as_dvec3();
        let instance = &scene.instances[index as usize];
        object = instance.object;
        flags |= instance.flags >> RANK << RANK;
        normal_matrix = Some(placement.map().matrix3.inverse().transpose());
    }
    let shading_normal = interpolated_normal(triangle, u, v, geometric_normal, normal_matrix);
    Surface {
        triangle: at,
        uv: [u, v],
        position: p0 + u * (p1 - p0) + v * (p2 - p0),
        reach,
        geometric_normal,
        shading_normal,
        coat_normal: shading_normal,
        object,
        material: scene.materials[triangle.material as usize],
        material_index: triangle.material,
        light: triangle.light,
        flags,
    }
}

/// The point that a ray hit.
pub fn surface_of(scene: &PackedScene, hit: Hit) -> Surface {
    surface_at(scene, hit.at, hit.u, hit.v)
}

impl Surface {
    /// The origin of a ray in `direction`, offset to the side that it leaves on.
    pub fn origin_towards(&self, direction: DVec3) -> DVec3 {
        let n = self.geometric_normal;
        let n = if direction.dot(n) >= 0.0 { n } else { -n };
        offset_origin(self.position, n, self.reach)
    }
}

fn interpolated_normal(
    triangle: &ShadingTriangle,
    u: f64,
    v: f64,
    geometric_normal: DVec3,
    normal_matrix: Option<DMat3>,
) -> DVec3 {
    if triangle.flags & SMOOTH_SHADED == 0 {
        return geometric_normal;
    }
    let [n0, n1, n2] = [triangle.n0, triangle.n1, triangle.n2].map(|normal| {
        let normal = decode_direction(normal);
        normal_matrix.map_or(normal, |matrix| (matrix * normal).normalize())
    });
    let n = (1.0 - u - v) * n0 + u * n1 + v * n2;
    // Interpolated normals that cancel, or point to the back, are ignored.
    if n.length_squared() > 1e-12 && n.dot(geometric_normal) > 0.0 {
        n.normalize()
    } else {
        geometric_normal
    }
}

/// Offsets a ray's origin to the side of `n` by a bound of the rounding errors of positions and planes of triangles with corners
/// up to `reach`: Pharr, Jakob and Humphreys, «Physically Based Rendering», 3rd edition, 2016, section 3.9.5.
pub fn offset_origin(position: DVec3, n: DVec3, reach: DVec3) -> DVec3 {
    position + ROUNDINGS * n.abs().dot(reach) * n
}

/// The normals of a surface, on the side that a path comes from.
#[derive(Debug, Clone, Copy)]
pub struct Normals {
    /// Of the triangle.
    pub geometric: DVec3,
    /// Interpolated, or from a normal map.
    pub shading: DVec3,
    /// Of a clear coat.
    pub coat: DVec3,
    /// The path hits the triangle's front.
    pub front: bool,
}

impl Normals {
    /// From the normals on the triangle's front (geometric, shading, coat). `v`: unit vector away from the surface.
    pub fn of([geometric, shading, coat]: [DVec3; 3], v: DVec3) -> Self {
        let front = v.dot(geometric) > 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let geometric = side * geometric;
        // Below the horizon of another normal the geometric normal is used.
        let facing = |n: DVec3| if v.dot(side * n) > 0.0 { side * n } else { geometric };
        Self {
            geometric,
            shading: facing(shading),
            coat: facing(coat),
            front,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_origins_lie_on_the_normals_side_and_as_near_as_floats_are_fine() {
        for position in [DVec3::new(0.9, -0.4, 1e-3), DVec3::new(-1e-8, 0.0, 3e-9)] {
            for n in [DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.36, 0.48, -0.8)] {
                let moved = offset_origin(position, n, position.abs()) - position;
                assert!(moved.dot(n) > 0.0, "{moved} doesn't lead to the side of {n}");
                assert!(moved.length() < 2e-6 * position.length(), "{moved} is far");
            }
        }
    }
}
