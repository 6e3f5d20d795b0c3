//! Glossy reflection as glTF 2.0, appendix B, has it: `glsl/shared/gloss.glsl` in f64, which cites the sources.

use std::f64::consts::PI;

use glam::DVec3;
use half::f16;

use super::sampling::{basis, decode_direction, encode_direction};
use super::vector::{rgb, with_word, word, xyz};
use crate::layout::{Gloss, Material};

/// Below this α a boundary is a mirror.
pub const SMOOTH_ALPHA: f64 = 1e-3;
/// Below this α camera paths follow reflections.
pub(super) const FOLLOWED_ALPHA: f64 = 0.1;

/// In which a byte has a part from 0 to 1: a half is one of them.
const PART_STEPS: f64 = 254.0;

fn schlick_weight(cosine: f64) -> f64 {
    (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// A Lambertian base under a boundary of microfacets. `v` and `l` are unit vectors to the viewer and to the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflector {
    /// Albedo of the base.
    pub diffuse: DVec3,
    /// Reflectance of the boundary at normal incidence.
    pub f0: DVec3,
    /// At grazing incidence, of the part that isn't metal; metal has 1.
    pub specular: f64,
    /// Part that is metal and has no base.
    pub metallic: f64,
    /// GGX's α.
    pub alpha: f64,
}

impl Reflector {
    /// A glossy material's.
    pub(super) fn of_material(material: &Material) -> Self {
        let (base, metallic) = (rgb(material.base_color), f64::from(material.metallic));
        Self {
            diffuse: base * (1.0 - metallic),
            f0: rgb(material.specular_f0).lerp(base, metallic),
            specular: material.specular_f90.into(),
            metallic,
            alpha: f64::from(material.roughness).powi(2),
        }
    }

    /// A Lambertian one.
    pub(super) fn matte(albedo: DVec3) -> Self {
        Self {
            diffuse: albedo,
            f0: DVec3::ZERO,
            specular: 0.0,
            metallic: 0.0,
            alpha: 0.0,
        }
    }

    /// The same with microfacets.
    pub(super) fn with_alpha(self, alpha: f64) -> Self {
        Self { alpha, ..self }
    }

    /// What a visible point keeps, and the direction to the viewer.
    pub(super) fn from_gloss(gloss: &Gloss) -> (Self, DVec3) {
        let rest = word(gloss.f0_rest);
        let [.., metallic, specular] = rest.to_le_bytes();
        let reflector = Self {
            diffuse: xyz(gloss.diffuse_viewer),
            f0: xyz(gloss.f0_rest),
            specular: f64::from(specular) / PART_STEPS,
            metallic: f64::from(metallic) / PART_STEPS,
            alpha: f16::from_bits(rest as u16).to_f64(),
        };
        (reflector, decode_direction(word(gloss.diffuse_viewer)))
    }

    pub(super) fn to_gloss(self, v: DVec3) -> Gloss {
        let [low, high] = f16::from_f64(self.alpha).to_bits().to_le_bytes();
        let [metallic, specular] = [self.metallic, self.specular].map(|part| (part * PART_STEPS + 0.5) as u8);
        Gloss {
            diffuse_viewer: with_word(self.diffuse, encode_direction(v)),
            f0_rest: with_word(self.f0, u32::from_le_bytes([low, high, metallic, specular])),
        }
    }

    /// Reflectance of the boundary.
    pub fn fresnel(&self, cosine: f64) -> DVec3 {
        let f90 = self.specular + (1.0 - self.specular) * self.metallic;
        self.f0 + (DVec3::splat(f90) - self.f0) * schlick_weight(cosine)
    }

    /// What gets through to the base, alike for all colours (`KHR_materials_specular`), and past what isn't metal alone.
    fn through_to_base(&self, cosine: f64) -> f64 {
        // f0 is a mixture of the metal's colour, of which `diffuse` is what isn't metal, and of what is wanted.
        let rest = (1.0 - self.metallic).max(1e-3);
        let over_base = (self.f0 - self.diffuse * (self.metallic / rest)).max_element() / rest;
        let over_base = over_base.max(0.0);
        1.0 - (over_base + (self.specular - over_base) * schlick_weight(cosine))
    }

    pub(super) fn is_smooth(&self) -> bool {
        self.alpha < SMOOTH_ALPHA
    }

    fn ggx(&self, n: DVec3, h: DVec3) -> f64 {
        let a2 = self.alpha * self.alpha;
        a2 / (PI * (n.cross(h).length_squared() + a2 * n.dot(h).powi(2)).powi(2))
    }

    fn masking_root(&self, cosine: f64) -> f64 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * cosine * cosine).sqrt()
    }

    /// The BRDF, 1/sr, without what a smooth boundary mirrors.
    pub fn brdf(&self, n: DVec3, v: DVec3, l: DVec3) -> DVec3 {
        let (nv, nl) = (n.dot(v), n.dot(l));
        if nv <= 0.0 || nl <= 0.0 {
            return DVec3::ZERO;
        }
        let h = (v + l).normalize();
        let f = self.fresnel(v.dot(h));
        let base = self.through_to_base(v.dot(h)) * self.diffuse / PI;
        if self.is_smooth() {
            return base;
        }
        let visibility = 0.5 / (nl * self.masking_root(nv) + nv * self.masking_root(nl));
        base + f * self.ggx(n, h) * visibility
    }

    /// Share of the samples that go to the boundary's reflection.
    pub fn reflection_probability(&self, nv: f64) -> f64 {
        let reflected = self.fresnel(nv).max_element();
        let under = self.diffuse.max_element() * (1.0 - reflected);
        if reflected <= 0.0 {
            0.0
        } else if under <= 0.0 {
            1.0
        } else {
            (reflected / (reflected + under)).max(0.25)
        }
    }

    /// A microfacet's normal that v sees.
    pub(super) fn visible_normal(&self, n: DVec3, v: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
        let frame = basis(n);
        let local = frame.transpose() * v;
        let stretched = DVec3::new(self.alpha * local.x, self.alpha * local.y, local.z).normalize();
        let (sin, cos) = (2.0 * PI * u0).sin_cos();
        let z = (1.0 - u1) * (1.0 + stretched.z) - stretched.z;
        let sine = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
        let cap = DVec3::new(sine * cos, sine * sin, z) + stretched;
        (frame * DVec3::new(self.alpha * cap.x, self.alpha * cap.y, cap.z.max(1e-6))).normalize()
    }

    /// A reflected direction by the normals that v sees.
    pub fn reflected_direction(&self, n: DVec3, v: DVec3, u: [f64; 2]) -> DVec3 {
        let h = self.visible_normal(n, v, u);
        (2.0 * v.dot(h) * h - v).normalize()
    }

    /// The share of the light that v's visible normals reflect that isn't held back on its way out.
    pub(super) fn joint_masking(&self, nv: f64, nl: f64) -> f64 {
        let root_v = self.masking_root(nv);
        nl * (nv + root_v) / (nl * root_v + nv * self.masking_root(nl))
    }

    /// The same of the light that they pass.
    pub(super) fn masking(&self, cosine: f64) -> f64 {
        2.0 * cosine / (cosine + self.masking_root(cosine))
    }

    /// Density of [`Self::visible_normal`].
    pub(super) fn visible_density(&self, n: DVec3, v: DVec3, h: DVec3) -> f64 {
        let nv = n.dot(v).max(1e-6);
        self.ggx(n, h) * 2.0 * v.dot(h).max(0.0) / (nv + self.masking_root(nv))
    }

    /// Its density per solid angle.
    pub fn reflected_density(&self, n: DVec3, v: DVec3, l: DVec3) -> f64 {
        let nv = n.dot(v).max(1e-6);
        self.ggx(n, (v + l).normalize()) * 0.5 / (nv + self.masking_root(nv))
    }

    /// BRDF · cos / density of a direction from [`Self::reflected_direction`], or of a mirror's.
    pub fn reflected_weight(&self, n: DVec3, v: DVec3, l: DVec3) -> DVec3 {
        let (nv, nl) = (n.dot(v), n.dot(l));
        if self.is_smooth() {
            return self.fresnel(nv);
        }
        if nl <= 0.0 {
            return DVec3::ZERO;
        }
        self.fresnel(v.dot((v + l).normalize())) * self.joint_masking(nv, nl)
    }
}
