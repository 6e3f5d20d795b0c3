//! Boundaries of dielectrics: `meet_boundary` of `glsl/shared/bsdf.glsl`, in f64.

use glam::DVec3;

use super::gloss::{Reflector, coat_passes};
use super::surface::Facing;
use super::vector::rgb;
use crate::layout::{Material, SPECULAR_CHANGED};

/// What can happen at a dielectric boundary.
pub(super) struct Boundary {
    /// Share of the power that is reflected.
    pub reflectance: f64,
    /// Index of the incident side over that of the other side; 1 for a thin wall.
    pub eta: f64,
    pub reflected: DVec3,
    /// `None` for total internal reflection.
    pub refracted: Option<DVec3>,
    /// What microfacets and a coat let through of what is reflected.
    pub reflected_weight: DVec3,
    /// And of what is refracted.
    pub refracted_weight: DVec3,
}

impl Boundary {
    /// Snell's law and Fresnel's equations for unpolarised light; `outside`: index of refraction. `u` chooses the microfacet
    /// of a rough boundary.
    pub fn new(facing: &Facing, incoming: DVec3, material: &Material, outside: f64, u: [f64; 2]) -> Self {
        let n = facing.shading_normal;
        let microfacets = Reflector::microfacets_of(material);
        let rough = !microfacets.is_smooth();
        let m = if rough {
            microfacets.visible_normal(n, -incoming, u)
        } else {
            n
        };
        let thin = material.thin != 0;
        let ior = f64::from(material.ior) / outside;
        let eta = if facing.front || thin { 1.0 / ior } else { ior };
        let cos_i = -incoming.dot(m);
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
            reflected_weight: DVec3::splat(match (rough, up > 0.0) {
                (false, _) => 1.0,
                (true, true) => microfacets.joint_masking(nv, up),
                (true, false) => 0.0,
            }),
            refracted_weight: DVec3::ONE,
        };
        let Some((reflectance, cos_t)) = fresnel_dielectric(cos_i, eta) else {
            boundary.weigh(facing, incoming, material, ior, cos_i);
            return boundary;
        };
        boundary.reflectance = reflectance;
        // The tangential part of the wave vector stays the same.
        let mut refracted = (eta * (incoming + cos_i * m) - cos_t * m).normalize();
        if thin {
            // Microfacets on both sides: what is reflected, turned to the other side.
            refracted = if rough { mirrored - 2.0 * up * n } else { incoming };
            boundary.eta = 1.0;
        }
        if rough {
            let down = -refracted.dot(n);
            boundary.refracted_weight = DVec3::splat(if down > 0.0 { microfacets.masking(down) } else { 0.0 });
        }
        boundary.refracted = Some(refracted);
        boundary.weigh(facing, incoming, material, ior, cos_i);
        boundary
    }

    /// Weighs what is reflected and refracted with what extensions make of it; `ior`: index inside over that outside; `cosine`: to
    /// the microfacet's normal.
    pub fn weigh(&mut self, facing: &Facing, incoming: DVec3, material: &Material, ior: f64, cosine: f64) {
        let n = facing.shading_normal;
        let coat = f64::from(material.coat);
        // It lies outside, and its angle is the same whichever way the light goes.
        let thin = material.thin != 0;
        if facing.front || thin {
            self.reflected_weight *= coat_passes(coat, cosine);
        }
        let Some(refracted) = self.refracted else { return };
        let outside = if facing.front { incoming } else { refracted };
        self.refracted_weight *= coat_passes(coat, if thin { cosine } else { -n.dot(outside) });
        if material.flags & SPECULAR_CHANGED == 0 {
            return;
        }
        // KHR_materials_specular changes the ends of Fresnel's curve.
        let f0 = normal_reflectance(ior);
        let ends = rgb(material.specular_f0) * (f0 / normal_reflectance(f64::from(material.ior)).max(1e-10));
        let grazing = DVec3::splat(f64::from(material.specular_f90));
        let changed = ends.lerp(grazing, (self.reflectance - f0) / (1.0 - f0)).min(DVec3::ONE);
        self.reflected_weight *= changed / self.reflectance.max(1e-10);
        self.refracted_weight *= (1.0 - changed) / (1.0 - self.reflectance);
    }
}

/// A dielectric's reflectance at normal incidence.
fn normal_reflectance(ior: f64) -> f64 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}

/// Unpolarised Fresnel reflectance of a dielectric and the cosine beyond; `eta`: index of the incident side over that of the other
/// side. `None` where all is reflected.
pub(super) fn fresnel_dielectric(cos_i: f64, eta: f64) -> Option<(f64, f64)> {
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
}
