//! Dielectric boundaries: Snell's law, the Fresnel equations for unpolarised light, and microfacets (Walter and others,
//! «Microfacet Models for Refraction through Rough Surfaces», EGSR 2007).

use glam::DVec3;

use super::reflector::{Reflector, coat_passes};
use super::vector::rgb;
use crate::layout::{Material, SPECULAR_CHANGED};

/// A dielectric boundary, for light from one side. `n` points to that side.
#[derive(Debug, Clone, Copy)]
pub struct Glass {
    /// Refractive index inside over that outside.
    ior: f64,
    /// The light arrives from outside.
    front: bool,
    /// A thin wall: no interior.
    thin: bool,
    microfacets: Reflector,
    coat: f64,
    /// `KHR_materials_specular`: f0 and f90.
    specular: Option<(DVec3, f64)>,
}

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct DielectricSample {
    /// Unit vector.
    pub direction: DVec3,
    /// Probability of this sample instead of the other one.
    pub probability: f64,
    /// Factor of the flux of a path that chose this sample.
    pub weight: DVec3,
}

/// One sample on each side of the boundary.
#[derive(Debug, Clone, Copy)]
pub struct DielectricSamples {
    /// Reflection at the boundary or a microfacet.
    pub reflected: DielectricSample,
    /// `None` for total internal reflection.
    pub refracted: Option<DielectricSample>,
}

impl Glass {
    /// `outside`: refractive index on the outer side.
    pub fn new(material: &Material, outside: f64, front: bool) -> Self {
        let ior = f64::from(material.ior) / outside;
        let changed = material.flags & SPECULAR_CHANGED != 0;
        Self {
            ior,
            front,
            thin: material.thin != 0,
            microfacets: Reflector::microfacets(f64::from(material.roughness).powi(2)),
            coat: f64::from(material.coat),
            specular: changed.then(|| {
                let part = normal_reflectance(ior) / normal_reflectance(material.ior.into()).max(1e-10);
                (rgb(material.specular_f0) * part, f64::from(material.specular_f90))
            }),
        }
    }

    /// Whether both samples are delta distributions.
    pub fn is_smooth(&self) -> bool {
        self.microfacets.is_smooth()
    }

    /// Refractive index of the incident side over that of the other side.
    fn incident_eta(&self) -> f64 {
        if self.front || self.thin {
            1.0 / self.ior
        } else {
            self.ior
        }
    }

    /// The same for the media before and after the boundary (1 for thin walls). Radiance scales with its square (Veach, 1997,
    /// section 5.2).
    pub fn eta(&self) -> f64 {
        if self.thin { 1.0 } else { self.incident_eta() }
    }

    /// Weights of reflection and transmission by extensions (specular, clear coat) relative to the Fresnel equations'
    /// `reflectance`, at this cosine to the microfacet. `l`: direction of the transmitted light.
    fn weights(&self, n: DVec3, v: DVec3, l: DVec3, cosine: f64, reflectance: f64) -> [DVec3; 2] {
        let [mut reflected, mut refracted] = [DVec3::ONE; 2];
        if let (Some((f0, f90)), true) = (self.specular, reflectance < 1.0) {
            let normal = normal_reflectance(self.ior);
            let changed = f0.lerp(DVec3::splat(f90), (reflectance - normal) / (1.0 - normal));
            let changed = changed.min(DVec3::ONE);
            reflected *= changed / reflectance.max(1e-10);
            refracted *= (1.0 - changed) / (1.0 - reflectance);
        }
        // The coat lies outside, and its angle does not depend on the light's direction.
        if self.front || self.thin {
            reflected *= coat_passes(self.coat, cosine);
        }
        let outside = match (self.thin, self.front) {
            (true, _) => cosine,
            (false, true) => n.dot(v),
            (false, false) => -n.dot(l),
        };
        refracted *= coat_passes(self.coat, outside);
        [reflected, refracted]
    }

    /// Samples reflection and transmission of light from `v`, at a microfacet that `u` chooses. With an interpolated or mapped
    /// `n` a reflection may point into the surface: then it is reflected about the geometric normal.
    pub fn sample(&self, n: DVec3, geometric: DVec3, v: DVec3, u: [f64; 2]) -> DielectricSamples {
        let rough = !self.is_smooth();
        let m = if rough {
            self.microfacets.visible_normal(n, v, u)
        } else {
            n
        };
        let (cos_i, eta) = (v.dot(m), self.incident_eta());
        let mirrored = 2.0 * cos_i * m - v;
        let up = mirrored.dot(n);
        let kept = match (rough, up > 0.0) {
            (false, _) => 1.0,
            (true, true) => self.microfacets.joint_masking(n.dot(v), up),
            (true, false) => 0.0,
        };
        let fresnel = fresnel_dielectric(cos_i, eta);
        let reflectance = fresnel.map_or(1.0, |(reflectance, _)| reflectance);
        let refracted = fresnel.map(|(_, cos_t)| match (self.thin, rough) {
            // Thin wall with microfacets on both sides: the reflection, mirrored to the other side.
            (true, true) => mirrored - 2.0 * up * n,
            (true, false) => -v,
            // The tangential part of the wave vector is preserved.
            (false, _) => (eta * (cos_i * m - v) - cos_t * m).normalize(),
        });
        let [of_reflected, of_refracted] = self.weights(n, v, refracted.unwrap_or(-v), cos_i, reflectance);
        DielectricSamples {
            reflected: DielectricSample {
                direction: mirrored_above(geometric, m, v),
                probability: reflectance,
                weight: kept * of_reflected,
            },
            refracted: refracted.map(|direction| {
                let down = -direction.dot(n);
                let kept = match (rough, down > 0.0) {
                    (false, _) => 1.0,
                    (true, true) => self.microfacets.masking(down),
                    (true, false) => 0.0,
                };
                DielectricSample {
                    direction,
                    probability: 1.0 - reflectance,
                    weight: kept * of_refracted,
                }
            }),
        }
    }

    /// BSDF · cos of a rough boundary for radiance from `l` to `v`, and the density of `l` by [`Self::sample`] when one of its
    /// samples is chosen by its probability.
    pub fn evaluate(&self, n: DVec3, geometric: DVec3, v: DVec3, l: DVec3) -> (DVec3, f64) {
        const NOTHING: (DVec3, f64) = (DVec3::ZERO, 0.0);
        if self.is_smooth() {
            return NOTHING;
        }
        let (eta, passes) = (self.incident_eta(), l.dot(geometric) < 0.0);
        let bends = passes && !self.thin;
        let h = match (passes, self.thin) {
            (false, _) => v + l,
            (true, true) => v + l - 2.0 * l.dot(n) * n,
            (true, false) => eta * v + l,
        };
        let length = h.length();
        let h = (if h.dot(n) < 0.0 { -h } else { h }) / length.max(1e-6);
        let (nv, nl, vh, lh) = (n.dot(v), n.dot(l), v.dot(h), l.dot(h));
        // Straight transmission without refraction: every microfacet matches, so there is no lobe.
        if nv <= 0.0 || vh <= 0.0 || (nl < 0.0) != passes || (bends && lh >= 0.0) || length < 1e-6 {
            return NOTHING;
        }
        let reflectance = fresnel_dielectric(vh, eta).map_or(1.0, |(reflectance, _)| reflectance);
        let [reflected, refracted] = self.weights(n, v, l, vh, reflectance);
        // Density of the microfacet's normal, divided by 4 v·h below for reflection.
        let visible = self.microfacets.ggx(n, h) * self.microfacets.masking(nv) / nv;
        if !passes {
            let density = reflectance * 0.25 * visible;
            return (reflected * self.microfacets.joint_masking(nv, nl) * density, density);
        }
        let against_h = if bends {
            vh * -lh / (eta * vh + lh).powi(2)
        } else {
            0.25
        };
        let density = (1.0 - reflectance) * visible * against_h;
        let radiance = self.eta().powi(2);
        (
            refracted * self.microfacets.masking(-nl) * (density * radiance),
            density,
        )
    }
}

/// `v` reflected about `n`, or about the geometric normal if that would point into the surface.
pub(super) fn mirrored_above(geometric: DVec3, n: DVec3, v: DVec3) -> DVec3 {
    let about = |n: DVec3| 2.0 * v.dot(n) * n - v;
    let mirrored = about(n);
    let above = if mirrored.dot(geometric) > 0.0 {
        mirrored
    } else {
        about(geometric)
    };
    above.normalize()
}

/// A dielectric's reflectance at normal incidence.
fn normal_reflectance(ior: f64) -> f64 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}

/// Unpolarised Fresnel reflectance of a dielectric and the cosine of the refracted ray. `eta`: refractive index of the incident
/// side over that of the other side. `None` for total internal reflection.
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

    fn sample(front: bool, angle: f64) -> DielectricSamples {
        let material = Material {
            ior: 1.5,
            ..Material::zeroed()
        };
        let v = DVec3::new(-angle.sin(), 0.0, angle.cos());
        Glass::new(&material, 1.0, front).sample(DVec3::Z, DVec3::Z, v, [0.0; 2])
    }

    #[test]
    fn glass_reflects_four_percent_and_bends_by_snells_law() {
        assert!((sample(true, 0.0).reflected.probability - 0.04).abs() < 1e-12);
        let angle: f64 = 0.7;
        let samples = sample(true, angle);
        let refracted = samples.refracted.expect("light enters the denser medium").direction;
        assert!((refracted.x - angle.sin() / 1.5).abs() < 1e-12 && refracted.z < 0.0);
        let mirrored = DVec3::new(angle.sin(), 0.0, angle.cos());
        assert!((samples.reflected.direction - mirrored).length() < 1e-12);
    }

    #[test]
    fn brewsters_angle_passes_all_parallel_light_and_beyond_the_critical_one_none_passes() {
        let ior: f64 = 1.5;
        let brewster = ior.atan();
        // r∥ = 0 there, r⊥ = cos²θ_i − sin²θ_i.
        let expected = 0.5 * (brewster.cos().powi(2) - brewster.sin().powi(2)).powi(2);
        assert!((sample(true, brewster).reflected.probability - expected).abs() < 1e-12);
        let critical = (1.0 / ior).asin();
        assert!(sample(false, critical - 1e-6).refracted.is_some());
        let beyond = sample(false, critical + 1e-6);
        assert!(beyond.refracted.is_none() && beyond.reflected.probability == 1.0);
    }
}
