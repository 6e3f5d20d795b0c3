//! Materials: how surfaces scatter and emit light.

use glam::Vec3;

/// How a surface scatters light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Lambertian reflection with the material's base colour as albedo.
    Matte,
    /// Perfect mirror: Schlick's Fresnel with the base colour as reflectance at normal incidence.
    Mirror,
    /// Boundary of a dielectric.
    Dielectric(Dielectric),
    /// A Lambertian base under a boundary of microfacets: glTF 2.0, appendix B.
    Glossy(Gloss),
}

/// What passes light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dielectric {
    /// Index of refraction inside, relative to vacuum.
    pub ior: f32,
    /// Its square is GGX's α; 0 ..= 1.
    pub roughness: f32,
    /// Share of what is no metal that passes light, 0 ..= 1.
    pub transmission: f32,
    /// How the rest reflects.
    pub gloss: Gloss,
    /// A wall without an inside, which doesn't bend light.
    pub thin: bool,
    /// Absorption coefficient inside, linear RGB, 1/render unit.
    pub absorption: Vec3,
    /// 20 over the Abbe number; 0: the index is that of every wavelength.
    pub dispersion: f32,
}

impl Dielectric {
    /// Smooth and clear.
    pub fn clear(ior: f32) -> Self {
        Self {
            ior,
            roughness: 0.0,
            transmission: 1.0,
            gloss: Gloss::default(),
            thin: false,
            absorption: Vec3::ZERO,
            dispersion: 0.0,
        }
    }
}

/// How a boundary of microfacets reflects.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gloss {
    /// How far the surface is a metal, 0 ..= 1.
    pub metallic: f32,
    /// Its square is GGX's α; 0 ..= 1.
    pub roughness: f32,
    /// Reflectance at normal incidence where it is no metal, linear RGB.
    pub specular_f0: Vec3,
    /// Reflectance at grazing incidence where it is no metal.
    pub specular_f90: f32,
}

/// KHR_materials_clearcoat: a dielectric's reflection above all others.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Coat {
    /// How much of it there is, 0 ..= 1; 0 for none.
    pub factor: f32,
    /// Its square is GGX's α; 0 ..= 1.
    pub roughness: f32,
}

/// Where a surface is there at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Alpha {
    /// Everywhere.
    Opaque,
    /// Where alpha, with texture and corners' colours, is at least the cutoff.
    Mask {
        /// Factor.
        alpha: f32,
        /// The least.
        cutoff: f32,
    },
    /// With alpha as probability.
    Blend {
        /// Factor.
        alpha: f32,
    },
}

/// Indices into [`Textures::lookups`] of what a material's factors are multiplied with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MaterialTextures {
    /// Base colour, and alpha.
    pub base_color: Option<u32>,
    /// Roughness in green, metal in blue.
    pub metallic_roughness: Option<u32>,
    /// Normals, and how far they lean.
    pub normal: Option<(u32, f32)>,
    /// Emission.
    pub emission: Option<u32>,
    /// Transmission in red.
    pub transmission: Option<u32>,
    /// Reflectance at both angles in alpha.
    pub specular: Option<u32>,
    /// Reflectance at normal incidence.
    pub specular_color: Option<u32>,
    /// How much of a clear coat there is, in red.
    pub coat: Option<u32>,
    /// Its roughness, in green.
    pub coat_roughness: Option<u32>,
    /// Its normals, and how far they lean.
    pub coat_normal: Option<(u32, f32)>,
}

/// A glTF material, reduced to what is supported.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// How it scatters.
    pub surface: Surface,
    /// What lies above that.
    pub coat: Coat,
    /// Linear RGB albedo (matte), reflectance (mirror) or tint of each crossing (dielectric); each in 0 ..= 1.
    pub base_color: Vec3,
    /// Emitted radiance, linear RGB; zero for what isn't a light.
    pub emission: Vec3,
    /// Whether the back side emits as well. (Every surface scatters on both sides.)
    pub back_emits: bool,
    /// Whether a camera looks through the back side, as glTF 2.0 has it of surfaces with one side. It reflects light and throws
    /// shadows all the same, and mirrors and glass show it.
    pub back_hidden: bool,
    /// KHR_materials_unlit: it is seen as its emission, but lights nothing and reflects nothing.
    pub unlit: bool,
    /// Where it is there.
    pub alpha: Alpha,
    /// Its textures.
    pub textures: MaterialTextures,
}

/// A dielectric's reflectance at normal incidence.
pub(crate) fn normal_reflectance(ior: f32) -> f32 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}
