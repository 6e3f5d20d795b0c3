//! Where a ray meets a surface and how it goes on: `surface_at` and `offset_origin` of `glsl/shared/scene.glsl`, and
//! `glsl/shared/bsdf.glsl`, in f64.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::gloss::{Reflector, coat_passes, schlick};
use super::intersect::{Hit, PlacedTriangle};
use super::sampling::decode_direction;
use super::vector::{rgb, word};
use crate::layout::{COAT_F0, DIELECTRIC, GLOSSY_SURFACE, Material, RANK, ROUNDINGS, SMOOTH_SHADED, ShadingTriangle};
use crate::packing::PackedScene;

/// A point of a triangle.
#[derive(Clone, Copy)]
pub(super) struct Surface {
    /// Which triangle.
    pub triangle: PlacedTriangle,
    /// Barycentric coordinates of its second and third corner.
    pub uv: [f64; 2],
    pub position: DVec3,
    /// Largest coordinates of the triangle's corners, or what those are sums of, without their signs.
    pub reach: DVec3,
    /// Unit vector on the triangle's front.
    pub geometric_normal: DVec3,
    /// On the same side.
    pub shading_normal: DVec3,
    /// Likewise, of a clear coat.
    pub coat_normal: DVec3,
    pub object: u32,
    /// Without its textures, until [`super::texture::apply_textures`].
    pub material: Material,
    /// Its index.
    pub material_index: u32,
    /// Index of its light, or [`crate::layout::NO_LIGHT`].
    pub light: u32,
    /// Of the triangle.
    pub flags: u32,
}

/// The point with the barycentric coordinates `u` and `v` of the second and the third corner.
pub(super) fn surface_at(scene: &PackedScene, at: PlacedTriangle, u: f64, v: f64) -> Surface {
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
        // So much the corners are uncertain by against those of other objects in the same place.
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

/// The point that a ray met.
pub(super) fn surface_of(scene: &PackedScene, hit: Hit) -> Surface {
    surface_at(scene, hit.at, hit.u, hit.v)
}

impl Surface {
    /// Where a ray starts that leaves in `direction`: on the side that it flies to.
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
    let [n0, n1, n2] = [triangle.p0, triangle.p1, triangle.p2].map(|corner| {
        let normal = decode_direction(word(corner));
        normal_matrix.map_or(normal, |matrix| (matrix * normal).normalize())
    });
    let n = (1.0 - u - v) * n0 + u * n1 + v * n2;
    // Normals that cancel, or point to the back, say nothing.
    if n.length_squared() > 1e-12 && n.dot(geometric_normal) > 0.0 {
        n.normalize()
    } else {
        geometric_normal
    }
}

/// Moves a ray's origin off its surface, to the side of `n`, by a bound of the rounding errors that positions and planes
/// of triangles with corners up to `reach` have on a device: Pharr, Jakob and Humphreys, «Physically Based Rendering»,
/// 3rd edition, 2016, section 3.9.5.
pub(super) fn offset_origin(position: DVec3, n: DVec3, reach: DVec3) -> DVec3 {
    position + ROUNDINGS * n.abs().dot(reach) * n
}

/// Largest coordinates of an object, without their signs, or a little more.
pub(super) fn reach_of(scene: &PackedScene, object: u32) -> DVec3 {
    let grid = &scene.object_grids[object as usize];
    let low = rgb(grid.low);
    let size = DVec3::from_array(grid.cells.map(f64::from)) / f64::from(grid.inverse_cell);
    low.abs().max((low + size).abs())
}

/// A ray's meeting with a surface, with both normals turned to the side that the ray comes from.
#[derive(Clone, Copy)]
pub(super) struct Facing {
    pub geometric_normal: DVec3,
    pub shading_normal: DVec3,
    /// The ray meets the triangle's front.
    pub front: bool,
}

impl Facing {
    pub fn new(surface: &Surface, incoming: DVec3) -> Self {
        let front = incoming.dot(surface.geometric_normal) < 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let geometric_normal = side * surface.geometric_normal;
        let shading_normal = side * surface.shading_normal;
        Self {
            geometric_normal,
            // Past the shading normal's horizon the geometric normal stands in.
            shading_normal: if incoming.dot(shading_normal) < 0.0 {
                shading_normal
            } else {
                geometric_normal
            },
            front,
        }
    }

    /// The incoming direction, mirrored.
    pub fn reflect(&self, incoming: DVec3) -> DVec3 {
        let about = |n: DVec3| incoming - 2.0 * incoming.dot(n) * n;
        let reflected = about(self.shading_normal);
        if reflected.dot(self.geometric_normal) > 0.0 {
            reflected.normalize()
        } else {
            about(self.geometric_normal).normalize()
        }
    }

    /// Where a path goes that follows what a boundary of microfacets reflects, and its weight: none of it where that would
    /// fly into the surface.
    pub fn follow(&self, reflector: &Reflector, incoming: DVec3, u: [f64; 2]) -> (DVec3, DVec3) {
        let direction = if reflector.is_smooth() {
            self.reflect(incoming)
        } else {
            reflector.reflected_direction(self.shading_normal, -incoming, u)
        };
        let weight = if direction.dot(self.geometric_normal) > 0.0 {
            reflector.reflected_weight(self.shading_normal, -incoming, direction)
        } else {
            DVec3::ZERO
        };
        (direction, weight)
    }

    /// What a ray meets of a coated surface is by chance the coat, which then is the material, or what lies below it. Returns
    /// the factor of what the path carries. The inside of glass has no coat.
    pub fn choose_layer(&mut self, material: &mut Material, coat_normal: DVec3, incoming: DVec3, u: f64) -> f64 {
        if !(self.front || material.surface != DIELECTRIC || material.thin != 0) {
            return 1.0;
        }
        let n = if self.front { coat_normal } else { -coat_normal };
        let n = if incoming.dot(n) < 0.0 {
            n
        } else {
            self.geometric_normal
        };
        let coat = f64::from(material.coat);
        let p = (1.0 - coat_passes(coat, -incoming.dot(n))).clamp(0.25 * coat, 0.9);
        if u >= p {
            return 1.0 / (1.0 - p);
        }
        self.shading_normal = n;
        *material = Material {
            surface: GLOSSY_SURFACE,
            base_color: [0.0; 3],
            metallic: 0.0,
            roughness: material.coat_roughness,
            specular_f0: [(COAT_F0 * coat) as f32; 3],
            specular_f90: material.coat,
            coat: 0.0,
            ..*material
        };
        1.0 / p
    }

    /// Where a glossy surface scatters a photon to, instead of the cosine-distributed `outgoing` or as that says, and the
    /// part of the flux that goes there.
    pub fn scatter(&self, reflector: &Reflector, incoming: DVec3, u: [f64; 4], outgoing: DVec3) -> (DVec3, DVec3) {
        let (n, v) = (self.shading_normal, -incoming);
        let nv = n.dot(v);
        let p = reflector.reflection_probability(nv);
        let reflects = u[3] < p;
        if reflector.is_smooth() {
            return if reflects {
                let passes = coat_passes(reflector.coat, nv);
                (self.reflect(incoming), reflector.fresnel(nv) * passes / p)
            } else {
                (outgoing, PI / (1.0 - p) * reflector.brdf(n, v, outgoing))
            };
        }
        let outgoing = if reflects {
            reflector.reflected_direction(n, v, [u[0], u[1]])
        } else {
            outgoing
        };
        let cosine = outgoing.dot(self.geometric_normal).max(0.0);
        let density = (1.0 - p) * cosine / PI + p * reflector.reflected_density(n, v, outgoing);
        (outgoing, reflector.brdf(n, v, outgoing) * (cosine / density.max(1e-20)))
    }

    /// Reflectance of a mirror of this material: Schlick's approximation, as glTF 2.0, appendix B, has it.
    pub fn mirror_reflectance(&self, material: &Material, incoming: DVec3) -> DVec3 {
        let f0 = rgb(material.base_color);
        let cosine = -incoming.dot(self.shading_normal);
        let passes = coat_passes(f64::from(material.coat), cosine);
        passes * (f0 + (1.0 - f0) * schlick(cosine))
    }

    /// What the shading normal's cosine makes of a photon's flux, which is per area of the geometric surface: Veach, «Robust
    /// Monte Carlo Methods for Light Transport Simulation», 1997, section 5.3.
    pub fn landing_correction(&self, incoming: DVec3) -> f64 {
        incoming.dot(self.shading_normal) / incoming.dot(self.geometric_normal)
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
