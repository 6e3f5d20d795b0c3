//! Glossy reflection as glTF 2.0, appendix B, has it: a Lambertian base under a boundary of GGX microfacets.
//! `glsl/bsdf/microfacet.glsl` cites the sources.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use half::f16;

use super::sampling::{basis, decode_direction};
use super::vector::{rgb, word, xyz};
use crate::layout::{COAT_F0, COATED, Material, PackedBsdf, SMOOTH_ALPHA};

/// The fifth power of 1 − cosine.
pub(super) fn schlick(cosine: f64) -> f64 {
    (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// `KHR_materials_sheen`; `glsl/bsdf/reflection.glsl` cites the sources.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sheen {
    /// Black for none.
    pub color: DVec3,
    /// The largest channel of what covers the rest.
    pub covers: f64,
    /// Its square is the Charlie distribution's α.
    pub roughness: f64,
}

impl Sheen {
    /// Of this color.
    pub fn new(color: DVec3, roughness: f64) -> Self {
        Self {
            color,
            covers: color.max_element(),
            roughness,
        }
    }

    fn roughness(&self) -> f64 {
        self.roughness.max(0.1)
    }

    /// Albedo of a white one at grazing incidence.
    fn peak(&self) -> f64 {
        let r = self.roughness();
        2.463 + r * (-8.003_981_51 + r * (14.347_445_01 + r * (-12.328_056_92 + r * 4.074_911_65)))
    }

    /// Its value, 1/sr.
    pub fn brdf(&self, n: DVec3, v: DVec3, l: DVec3) -> DVec3 {
        let (nv, nl) = (n.dot(v), n.dot(l));
        let inverse = self.roughness().powi(-2);
        let sine = n.cross((v + l).normalize()).length().min(1.0);
        let distribution = (2.0 + inverse) * sine.powf(inverse) * (0.5 / PI);
        let visibility = (0.25 / (nl + nv - nl * nv).max(1e-6)).min(1.0);
        self.color * distribution * visibility / self.peak().max(1.0)
    }

    /// Albedo of a white one, never too low.
    pub fn albedo(&self, cosine: f64) -> f64 {
        let r = self.roughness();
        let fall = (1.0 - cosine).max(0.0).powf(0.84 / r + 0.4);
        let rest = 0.029_710_07 + r * (-0.295_079_69 + r * (0.983_457_12 - r * 0.497_009_58));
        (self.peak().min(1.0) * (rest + (1.0 - rest) * fall) + 0.024).min(1.0)
    }

    /// What it lets through to what lies below.
    pub fn passes(&self, nv: f64, nl: f64) -> f64 {
        if self.covers > 0.0 {
            1.0 - self.covers * self.albedo(nv.min(nl))
        } else {
            1.0
        }
    }
}

/// A Lambertian base under a boundary of microfacets. `v` and `l` are unit vectors to the viewer and to the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflector {
    /// Albedo of the base.
    pub diffuse: DVec3,
    /// Reflectance of the boundary at normal incidence.
    pub f0: DVec3,
    /// At grazing incidence.
    pub f90: f64,
    /// The largest channel of what reflects over the base, at normal and at grazing incidence.
    pub over_base: [f64; 2],
    /// GGX's α.
    pub alpha: f64,
    /// What lies above both: how much of a dielectric's reflection it has.
    pub coat: f64,
    /// Between.
    pub sheen: Sheen,
    /// α along a direction of the surface, where that is another.
    pub along: Option<(f64, DVec3)>,
}

/// What a coat lets through to what lies below.
pub fn coat_passes(coat: f64, cosine: f64) -> f64 {
    1.0 - coat * (COAT_F0 + (1.0 - COAT_F0) * schlick(cosine))
}

impl Reflector {
    /// A Lambertian one.
    pub fn matte(albedo: DVec3) -> Self {
        Self {
            diffuse: albedo,
            f0: DVec3::ZERO,
            f90: 0.0,
            over_base: [0.0; 2],
            alpha: 0.0,
            coat: 0.0,
            sheen: Sheen::default(),
            along: None,
        }
    }

    /// A perfect mirror: Schlick's approximation, as glTF 2.0, appendix B, has it for metals.
    pub fn mirror(f0: DVec3, coat: f64) -> Self {
        Self {
            f0,
            f90: 1.0,
            coat,
            ..Self::matte(DVec3::ZERO)
        }
    }

    /// A glossy material's.
    pub fn glossy(material: &Material) -> Self {
        let (base, metallic) = (rgb(material.base_color), f64::from(material.metallic));
        let alpha = f64::from(material.roughness).powi(2);
        let along = (material.anisotropy > 0.0 && alpha >= SMOOTH_ALPHA).then(|| {
            let part = f64::from(material.anisotropy).powi(2);
            let direction = decode_direction(material.anisotropy_direction);
            (alpha + (1.0 - alpha) * part, direction)
        });
        Self {
            diffuse: base * (1.0 - metallic),
            f0: rgb(material.specular_f0).lerp(base, metallic),
            f90: f64::from(material.specular_f90) * (1.0 - metallic) + metallic,
            over_base: [
                rgb(material.specular_f0).max_element(),
                f64::from(material.specular_f90),
            ],
            alpha,
            coat: f64::from(material.coat),
            sheen: Sheen::new(rgb(material.sheen_color), material.sheen_roughness.into()),
            along,
        }
    }

    /// A clear coat by itself.
    pub fn coat(material: &Material) -> Self {
        let coat = f64::from(material.coat);
        Self {
            f0: DVec3::splat(COAT_F0 * coat),
            f90: coat,
            alpha: f64::from(material.coat_roughness).powi(2),
            ..Self::matte(DVec3::ZERO)
        }
    }

    /// The microfacets of glass; what they reflect isn't among this.
    pub(super) fn microfacets(alpha: f64) -> Self {
        Self {
            alpha,
            ..Self::matte(DVec3::ZERO)
        }
    }

    /// What a visible point of the kernels keeps of a scene without sheen, the direction to the viewer, and whether the material is coated.
    pub(super) fn of_packed(packed: &PackedBsdf) -> (Self, DVec3, bool) {
        let half = |bits: u32| f16::from_bits(bits as u16).to_f64();
        let [f0_rg, f0_b_f90, alpha_coat, over_base] = packed.rest.map(|word| [half(word), half(word >> 16)]);
        let reflector = Self {
            diffuse: xyz(packed.diffuse_viewer),
            f0: DVec3::new(f0_rg[0], f0_rg[1], f0_b_f90[0]),
            f90: f0_b_f90[1],
            over_base,
            alpha: alpha_coat[0].abs(),
            coat: alpha_coat[1],
            sheen: Sheen::default(),
            along: None,
        };
        let viewer = decode_direction(word(packed.diffuse_viewer));
        (reflector, viewer, packed.rest[2] & COATED != 0)
    }

    /// Albedo of the base in the strongest channel, as far as it chooses among lobes.
    pub(super) fn base_albedo(&self) -> f64 {
        self.diffuse.max_element().max(self.sheen.color.max_element())
    }

    /// The same without its base and its sheen, which both still take their part.
    pub fn boundary(self) -> Self {
        Self {
            diffuse: DVec3::ZERO,
            sheen: Sheen {
                color: DVec3::ZERO,
                ..self.sheen
            },
            ..self
        }
    }

    /// Reflectance of the boundary.
    pub fn fresnel(&self, cosine: f64) -> DVec3 {
        self.f0 + (DVec3::splat(self.f90) - self.f0) * schlick(cosine)
    }

    /// What gets through to the base, alike for all colours (`KHR_materials_specular`), and past what isn't metal alone.
    fn through_to_base(&self, cosine: f64) -> f64 {
        let [normal, grazing] = self.over_base;
        1.0 - (normal + (grazing - normal) * schlick(cosine))
    }

    /// Whether the boundary is a mirror.
    pub fn is_smooth(&self) -> bool {
        self.alpha < SMOOTH_ALPHA
    }

    /// The directions along and across which α differs, the normal, and both α.
    fn frame(&self, n: DVec3) -> (DMat3, f64, f64) {
        let isotropic = || (basis(n), self.alpha, self.alpha);
        self.along.map_or_else(isotropic, |(along, t)| {
            let t = t - t.dot(n) * n;
            if t.length_squared() <= 1e-6 {
                return (basis(n), along, self.alpha);
            }
            let t = t.normalize();
            (DMat3::from_cols(t, n.cross(t), n), along, self.alpha)
        })
    }

    /// A direction in that frame as GGX of α 1 has it, up to its length.
    fn stretched(&self, n: DVec3, v: DVec3) -> DVec3 {
        let (frame, along, across) = self.frame(n);
        frame.transpose() * v * DVec3::new(along, across, 1.0)
    }

    pub(super) fn ggx(&self, n: DVec3, h: DVec3) -> f64 {
        let (frame, along, across) = self.frame(n);
        let a2 = along * across;
        let q = frame.transpose() * h * DVec3::new(across, along, a2);
        a2.powi(3) / (PI * q.length_squared().powi(2))
    }

    fn masking_root(&self, cosine: f64) -> f64 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * cosine * cosine).sqrt()
    }

    /// The same of a direction, since α may have one.
    fn root(&self, n: DVec3, v: DVec3) -> f64 {
        self.stretched(n, v).length()
    }

    /// The BRDF, 1/sr, without what a smooth boundary mirrors.
    pub fn brdf(&self, n: DVec3, v: DVec3, l: DVec3) -> DVec3 {
        let (nv, nl) = (n.dot(v), n.dot(l));
        if nv <= 0.0 || nl <= 0.0 {
            return DVec3::ZERO;
        }
        let h = (v + l).normalize();
        let base = self.through_to_base(v.dot(h)) * self.diffuse / PI;
        let lobe = if self.is_smooth() {
            DVec3::ZERO
        } else {
            let visibility = 0.5 / (nl * self.root(n, v) + nv * self.root(n, l));
            self.fresnel(v.dot(h)) * self.ggx(n, h) * visibility
        };
        let below = (base + lobe) * self.sheen.passes(nv, nl);
        coat_passes(self.coat, v.dot(h)) * (below + self.sheen.brdf(n, v, l))
    }

    /// Share of the samples that go to the boundary's reflection.
    pub fn reflection_probability(&self, nv: f64) -> f64 {
        let mut reflected = self.fresnel(nv).max_element();
        let mut under = self.diffuse.max_element() * (1.0 - reflected);
        if self.sheen.covers > 0.0 {
            let passes = self.sheen.passes(nv, nv);
            reflected *= passes;
            under = passes * under + self.sheen.color.max_element() * self.sheen.albedo(nv);
        }
        if reflected <= 0.0 {
            0.0
        } else if under <= 0.0 {
            1.0
        } else {
            (reflected / (reflected + under)).max(0.25)
        }
    }

    /// A microfacet's normal that v sees: Dupuy and Benyoub, «Sampling Visible GGX Normals with Spherical Caps», 2023.
    pub(super) fn visible_normal(&self, n: DVec3, v: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
        let (frame, along, across) = self.frame(n);
        let stretched = self.stretched(n, v).normalize();
        let (sin, cos) = (2.0 * PI * u0).sin_cos();
        let z = (1.0 - u1) * (1.0 + stretched.z) - stretched.z;
        let sine = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
        let cap = DVec3::new(sine * cos, sine * sin, z) + stretched;
        (frame * DVec3::new(along * cap.x, across * cap.y, cap.z.max(1e-6))).normalize()
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

    /// Its density per solid angle.
    pub fn reflected_density(&self, n: DVec3, v: DVec3, l: DVec3) -> f64 {
        let nv = n.dot(v).max(1e-6);
        self.ggx(n, (v + l).normalize()) * 0.5 / (nv + self.root(n, v))
    }

    /// BRDF · cos / density of a direction from [`Self::reflected_direction`], or of a mirror's.
    pub fn reflected_weight(&self, n: DVec3, v: DVec3, l: DVec3) -> DVec3 {
        let (nv, nl) = (n.dot(v), n.dot(l));
        if self.is_smooth() {
            return self.fresnel(nv) * coat_passes(self.coat, nv) * self.sheen.passes(nv, nv);
        }
        if nl <= 0.0 {
            return DVec3::ZERO;
        }
        let vh = v.dot((v + l).normalize());
        let root = self.root(n, v);
        let joint = nl * (nv + root) / (nl * root + nv * self.root(n, l));
        self.fresnel(vh) * coat_passes(self.coat, vh) * joint * self.sheen.passes(nv, nl)
    }
}
