//! Where a ray meets a surface and how it goes on: `surface_at` and `offset_origin` of `glsl/shared/scene.glsl`, and
//! `glsl/shared/bsdf.glsl`, in f64.

use std::f64::consts::PI;

use glam::DVec3;

use super::gloss::Reflector;
use super::sampling::decode_direction;
use super::vector::{rgb, word, xyz};
use crate::layout::{Material, SMOOTH_SHADED, ShadingTriangle};
use crate::scene::PackedScene;

/// [`Material::surface`] of a Lambertian reflector.
pub(super) const MATTE: u32 = 0;
/// [`Material::surface`] of a perfect mirror.
pub(super) const MIRROR: u32 = 1;
/// [`Material::surface`] of glass.
pub(super) const DIELECTRIC: u32 = 2;
/// [`Material::surface`] of microfacets over a Lambertian base.
pub(super) const GLOSSY: u32 = 3;

/// A point of a triangle.
#[derive(Clone, Copy)]
pub(super) struct Surface {
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric coordinates of its second and third corner.
    pub uv: [f64; 2],
    pub position: DVec3,
    /// Largest coordinates of the triangle's corners, without their signs.
    pub reach: DVec3,
    /// Unit vector on the triangle's front.
    pub geometric_normal: DVec3,
    /// On the same side.
    pub shading_normal: DVec3,
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
pub(super) fn surface_at(scene: &PackedScene, index: u32, u: f64, v: f64) -> Surface {
    let triangle = &scene.shading_triangles[index as usize];
    let [p0, p1, p2] = [triangle.p0, triangle.p1, triangle.p2].map(xyz);
    let geometric_normal = (p1 - p0).cross(p2 - p0).normalize();
    Surface {
        triangle: index,
        uv: [u, v],
        position: p0 + u * (p1 - p0) + v * (p2 - p0),
        reach: p0.abs().max(p1.abs()).max(p2.abs()),
        geometric_normal,
        shading_normal: interpolated_normal(triangle, u, v, geometric_normal),
        object: triangle.object,
        material: scene.materials[triangle.material as usize],
        material_index: triangle.material,
        light: triangle.light,
        flags: triangle.flags,
    }
}

impl Surface {
    /// Where a ray starts that leaves in `direction`: on the side that it flies to.
    pub fn origin_towards(&self, direction: DVec3) -> DVec3 {
        let n = self.geometric_normal;
        let n = if direction.dot(n) >= 0.0 { n } else { -n };
        offset_origin(self.position, n, self.reach)
    }
}

fn interpolated_normal(triangle: &ShadingTriangle, u: f64, v: f64, geometric_normal: DVec3) -> DVec3 {
    if triangle.flags & SMOOTH_SHADED == 0 {
        return geometric_normal;
    }
    let [n0, n1, n2] = [triangle.p0, triangle.p1, triangle.p2].map(|corner| decode_direction(word(corner)));
    let n = (1.0 - u - v) * n0 + u * n1 + v * n2;
    // Normals that cancel, or point to the back, say nothing.
    if n.length_squared() > 1e-12 && n.dot(geometric_normal) > 0.0 {
        n.normalize()
    } else {
        geometric_normal
    }
}

/// Parts of a triangle's coordinates by which rays leave it.
pub(super) const ROUNDINGS: f64 = 16.0 / 16_777_216.0;

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

    /// Where a glossy surface scatters a photon to, instead of the cosine-distributed `outgoing` or as that says, and the
    /// part of the flux that goes there.
    pub fn scatter(&self, reflector: &Reflector, incoming: DVec3, u: [f64; 4], outgoing: DVec3) -> (DVec3, DVec3) {
        let (n, v) = (self.shading_normal, -incoming);
        let nv = n.dot(v);
        let p = reflector.reflection_probability(nv);
        let reflects = u[3] < p;
        if reflector.is_smooth() {
            return if reflects {
                (self.reflect(incoming), reflector.fresnel(nv) / p)
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

    /// Reflectance of a mirror with this base colour: Schlick's approximation, as glTF 2.0, appendix B, has it.
    pub fn mirror_reflectance(&self, base_color: [f32; 3], incoming: DVec3) -> DVec3 {
        let f0 = rgb(base_color);
        let grazing = (1.0 + incoming.dot(self.shading_normal)).clamp(0.0, 1.0);
        f0 + (1.0 - f0) * grazing.powi(5)
    }
}

/// What can happen at a dielectric boundary.
pub(super) struct Boundary {
    /// Share of the power that is reflected.
    pub reflectance: f64,
    /// Index of the incident side over that of the other side; 1 for a thin wall.
    pub eta: f64,
    pub reflected: DVec3,
    /// `None` for total internal reflection.
    pub refracted: Option<DVec3>,
    /// What microfacets let through of what is reflected.
    pub reflected_weight: f64,
    /// And of what is refracted.
    pub refracted_weight: f64,
}

impl Boundary {
    /// Snell's law and Fresnel's equations for unpolarised light; `outside`: index of refraction. `u` chooses the microfacet
    /// of a rough boundary.
    pub fn new(facing: &Facing, incoming: DVec3, material: &Material, outside: f64, u: [f64; 2]) -> Self {
        let n = facing.shading_normal;
        let microfacets = Reflector::matte(DVec3::ZERO).with_alpha(f64::from(material.roughness).powi(2));
        let rough = !microfacets.is_smooth();
        let m = if rough {
            microfacets.visible_normal(n, -incoming, u)
        } else {
            n
        };
        let thin = material.thin != 0;
        let ior = f64::from(material.ior) / outside;
        let (n_i, n_t) = if facing.front || thin { (1.0, ior) } else { (ior, 1.0) };
        let eta = n_i / n_t;
        let cos_i = -incoming.dot(m);
        let sin2_t = eta * eta * (1.0 - cos_i * cos_i).max(0.0);
        let mirrored = incoming + 2.0 * cos_i * m;
        let nv = -incoming.dot(n);
        let up = mirrored.dot(n);
        let micro = Facing {
            shading_normal: m,
            ..*facing
        };
        let mut boundary = Self {
            reflectance: 1.0,
            eta,
            reflected: micro.reflect(incoming),
            refracted: None,
            reflected_weight: match (rough, up > 0.0) {
                (false, _) => 1.0,
                (true, true) => microfacets.joint_masking(nv, up),
                (true, false) => 0.0,
            },
            refracted_weight: 1.0,
        };
        if sin2_t >= 1.0 {
            return boundary;
        }
        let cos_t = (1.0 - sin2_t).sqrt();
        let r_parallel = (n_t * cos_i - n_i * cos_t) / (n_t * cos_i + n_i * cos_t);
        let r_perpendicular = (n_i * cos_i - n_t * cos_t) / (n_i * cos_i + n_t * cos_t);
        boundary.reflectance = 0.5 * (r_parallel.powi(2) + r_perpendicular.powi(2));
        // The tangential part of the wave vector stays the same.
        let mut refracted = (eta * (incoming + cos_i * m) - cos_t * m).normalize();
        if thin {
            // Microfacets on both sides: what is reflected, turned to the other side.
            refracted = if rough { mirrored - 2.0 * up * n } else { incoming };
            boundary.eta = 1.0;
        }
        if rough {
            let down = -refracted.dot(n);
            boundary.refracted_weight = if down > 0.0 { microfacets.masking(down) } else { 0.0 };
        }
        boundary.refracted = Some(refracted);
        boundary
    }
}

/// BSDF · cosine of a rough boundary between the viewer's side and a direction on either side: `glsl/shared/bsdf.glsl`, which
/// cites the source.
pub(super) fn rough_boundary(
    facing: &Facing,
    material: &Material,
    outside: f64,
    tint: DVec3,
    [v, l]: [DVec3; 2],
) -> DVec3 {
    let n = facing.shading_normal;
    let microfacets = Reflector::matte(DVec3::ZERO).with_alpha(f64::from(material.roughness).powi(2));
    let thin = material.thin != 0;
    let ior = f64::from(material.ior) / outside;
    let eta = if facing.front || thin { ior.recip() } else { ior };
    let (nv, nl) = (n.dot(v), n.dot(l).abs());
    let is_reflected = n.dot(l) > 0.0;
    if is_reflected || thin {
        let up = if is_reflected { l } else { l - 2.0 * n.dot(l) * n };
        let f = fresnel(v.dot((v + up).normalize()), eta).map_or(1.0, |(f, _)| f);
        // Density of what v's visible normals reflect.
        let density = microfacets.reflected_density(n, v, up);
        return if is_reflected {
            DVec3::splat(f * density * microfacets.joint_masking(nv, nl))
        } else {
            tint * ((1.0 - f) * density * microfacets.masking(nl))
        };
    }
    let across = eta * v + l;
    let Some(h) = across.try_normalize() else {
        return DVec3::ZERO;
    };
    let h = if h.dot(n) < 0.0 { -h } else { h };
    match fresnel(v.dot(h), eta) {
        Some((f, cos_t)) if v.dot(h) > 0.0 && l.dot(h) < 0.0 && across.length_squared() > 1e-12 => {
            let of_normal = microfacets.visible_density(n, v, h);
            let density = of_normal * cos_t / across.length_squared();
            tint * (eta * eta * (1.0 - f) * density * microfacets.masking(nl))
        }
        _ => DVec3::ZERO,
    }
}

/// Unpolarised reflectance and the cosine on the other side; `None` for total internal reflection.
fn fresnel(cos_i: f64, eta: f64) -> Option<(f64, f64)> {
    let sin2_t = eta * eta * (1.0 - cos_i * cos_i).max(0.0);
    if sin2_t >= 1.0 {
        return None;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let perpendicular = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    Some((0.5 * (parallel.powi(2) + perpendicular.powi(2)), cos_t))
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    fn facing(front: bool) -> Facing {
        Facing {
            geometric_normal: DVec3::Z,
            shading_normal: DVec3::Z,
            front,
        }
    }

    fn glass() -> Material {
        Material {
            ior: 1.5,
            ..Material::zeroed()
        }
    }

    fn meet(front: bool, incoming: DVec3) -> Boundary {
        Boundary::new(&facing(front), incoming, &glass(), 1.0, [0.0; 2])
    }

    fn incoming(angle: f64) -> DVec3 {
        DVec3::new(angle.sin(), 0.0, -angle.cos())
    }

    #[test]
    fn glass_reflects_four_percent_and_bends_by_snells_law() {
        let boundary = meet(true, incoming(0.0));
        assert!((boundary.reflectance - 0.04).abs() < 1e-12);
        let angle: f64 = 0.7;
        let boundary = meet(true, incoming(angle));
        let refracted = boundary.refracted.expect("light enters the denser medium");
        assert!((refracted.x - angle.sin() / 1.5).abs() < 1e-12 && refracted.z < 0.0);
        assert!((boundary.reflected - DVec3::new(angle.sin(), 0.0, angle.cos())).length() < 1e-12);
    }

    #[test]
    fn brewsters_angle_passes_all_parallel_light_and_beyond_the_critical_one_none_passes() {
        let ior: f64 = 1.5;
        let brewster = ior.atan();
        // r∥ = 0 there, r⊥ = cos²θ_i − sin²θ_i.
        let expected = 0.5 * (brewster.cos().powi(2) - brewster.sin().powi(2)).powi(2);
        assert!((meet(true, incoming(brewster)).reflectance - expected).abs() < 1e-12);
        let critical = (1.0 / ior).asin();
        assert!(meet(false, incoming(critical - 1e-6)).refracted.is_some());
        let beyond = meet(false, incoming(critical + 1e-6));
        assert!(beyond.refracted.is_none() && beyond.reflectance == 1.0);
    }

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

    /// What a rough boundary does to light from each direction adds up to what its sampled directions weigh: above, and below.
    #[test]
    fn rough_glass_is_evaluated_as_it_is_sampled() {
        const STEPS: u32 = 600;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        for (front, thin, cosine) in [
            (true, 0, 0.9),
            (true, 0, 0.3),
            (false, 0, 0.9),
            (false, 0, 0.5),
            (true, 1, 0.6),
        ] {
            let facing = facing(front);
            let material = Material {
                roughness: 0.6,
                thin,
                ..glass()
            };
            let v = DVec3::new((1.0_f64 - cosine * cosine).sqrt(), 0.0, cosine);
            let mut evaluated = [0.0; 2];
            let mut sampled = [0.0; 2];
            for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (at(i), at(j)))) {
                let z = 2.0 * i - 1.0;
                let (sin, cos) = (2.0 * PI * j).sin_cos();
                let across = (1.0 - z * z).sqrt();
                let l = DVec3::new(across * cos, across * sin, z);
                let value = rough_boundary(&facing, &material, 1.0, DVec3::ONE, [v, l]).x;
                evaluated[usize::from(z < 0.0)] += 4.0 * PI * value;
                let boundary = Boundary::new(&facing, -v, &material, 1.0, [j, i]);
                sampled[0] += boundary.reflectance * boundary.reflected_weight;
                let passed = (1.0 - boundary.reflectance) * boundary.eta.powi(2) * boundary.refracted_weight;
                sampled[1] += boundary.refracted.map_or(0.0, |_| passed);
            }
            for (evaluated, sampled) in evaluated.into_iter().zip(sampled) {
                let [evaluated, sampled] = [evaluated, sampled].map(|sum| sum / f64::from(STEPS * STEPS));
                assert!(
                    (evaluated - sampled).abs() < 2e-3 * sampled.max(0.1),
                    "front {front}, thin {thin}, cosine {cosine}: {evaluated} instead of {sampled}"
                );
            }
        }
    }
}
