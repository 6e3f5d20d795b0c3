//! What kernels have of materials: the record of each, and what a visible point carries of its BSDF.

use bytemuck::{Pod, Zeroable};

#[allow(unused_imports, reason = "most are linked by the documentation alone")]
use super::constants::*;
use super::shape::{FieldLayout, Layout, Shared};

device_structs! {
    /// A material. Textures are indices of [`TextureLookup`](super::TextureLookup)s, or [`NO_TEXTURE`]; each is a factor.
    pub struct Material: 192 {
        /// Linear RGB albedo, reflectance or tint.
        pub base_color: [f32; 3],
        /// [`MATTE`], [`MIRROR`], [`DIELECTRIC`] or [`GLOSSY_SURFACE`].
        pub surface: u32,
        /// Emitted radiance, linear RGB.
        pub emission: [f32; 3],
        /// Index of refraction inside.
        pub ior: f32,
        /// [`BACK_EMITS`], [`BACK_HIDDEN`], [`SPECULAR_CHANGED`].
        pub flags: u32,
        /// How far the surface is a metal.
        pub metallic: f32,
        /// Of a glossy surface; its square is GGX's α.
        pub roughness: f32,
        /// Share of what is no metal that passes light, of a dielectric; the rest is glossy.
        pub transmission: f32,
        /// Reflectance at normal incidence of the glossy surface's dielectric part, linear RGB.
        pub specular_f0: [f32; 3],
        /// Its reflectance at grazing incidence.
        pub specular_f90: f32,
        /// Absorption coefficient inside of a dielectric, linear RGB, 1/length.
        pub absorption: [f32; 3],
        /// 1 for a dielectric that is a thin wall, without an inside.
        pub thin: u32,
        /// Of the base colour, its alpha with it.
        pub color_texture: u32,
        /// Roughness in green, how far it is a metal in blue.
        pub metal_texture: u32,
        /// Normals in the space of the tangent.
        pub normal_texture: u32,
        /// Of the emission.
        pub emission_texture: u32,
        /// In red.
        pub transmission_texture: u32,
        /// Of the reflectance at both angles, in alpha.
        pub specular_texture: u32,
        /// Of the reflectance at normal incidence.
        pub specular_color_texture: u32,
        /// How far the normals of their texture lean.
        pub normal_scale: f32,
        /// [`OPAQUE`], [`MASK`] or [`BLEND`].
        pub alpha_mode: u32,
        /// Of [`MASK`].
        pub alpha_cutoff: f32,
        /// Factor of alpha.
        pub alpha: f32,
        /// 20 over the Abbe number of a dielectric; 0: its index is that of every wavelength.
        pub dispersion: f32,
        /// How much of a clear coat lies above; 0: none.
        pub coat: f32,
        /// Its square is GGX's α of the coat.
        pub coat_roughness: f32,
        /// Of how much there is of the coat, in red.
        pub coat_texture: u32,
        /// Of its roughness, in green.
        pub coat_roughness_texture: u32,
        /// Its normals in the space of the tangent.
        pub coat_normal_texture: u32,
        /// How far those lean.
        pub coat_normal_scale: f32,
        /// Roughness of the sheen; its square is the Charlie distribution's α.
        pub sheen_roughness: f32,
        /// Of the sheen's roughness, in alpha.
        pub sheen_roughness_texture: u32,
        /// Reflectance of the sheen, linear RGB; black: none.
        pub sheen_color: [f32; 3],
        /// Of that.
        pub sheen_texture: u32,
        /// How far its highlights are longer along their direction than across it.
        pub anisotropy: f32,
        /// Angle from the tangent to that direction, radians.
        pub anisotropy_rotation: f32,
        /// Of both: the direction in red and green, how far in blue.
        pub anisotropy_texture: u32,
        /// At a place: the octahedral direction.
        pub anisotropy_direction: u32,
    }

    /// How a visible point's surface scatters, where the scene has glossy ones.
    pub struct PackedBsdf: 32 {
        /// rgb: albedo under the reflecting boundary; w: u32 bits, octahedral direction to the viewer.
        pub diffuse_viewer: [f32; 4],
        /// f16s, two to a word: reflectance of the boundary at normal incidence, linear RGB, and at grazing incidence; GGX's α, 0
        /// where the path followed the reflection itself; how much of a coat there is; the largest channel of what lies over
        /// the base at both angles. α's sign: whether the material is coated.
        pub rest: [u32; 4],
    }

    /// What else lies above it, where the scene has such; those of all slots follow the [`PackedBsdf`]s of all.
    pub struct PackedLayers: 16 {
        /// f16s, two to a word: the sheen's reflectance, linear RGB, and its roughness.
        pub sheen: [u32; 2],
        /// f16: GGX's α along the direction of anisotropy; 0 where it is the same all around.
        pub along: u32,
        /// That direction, octahedral.
        pub direction: u32,
    }
}

/// What a visible point's BSDF can have beside a Lambertian lobe: constants of what makes visible points and gathers for them.
pub const VISIBLE_LOBES: [&str; 3] = ["GLOSSY", "SHEEN", "ANISOTROPY"];

/// Which of [`VISIBLE_LOBES`] there are.
pub type VisibleLobes = [bool; VISIBLE_LOBES.len()];

/// Texels that a visible point needs for these.
pub fn packed_bsdf_texels(lobes: VisibleLobes) -> u64 {
    let [glossy, sheen, anisotropic] = lobes;
    let of = |present, bytes: usize| if present { bytes as u64 / 16 } else { 0 };
    of(glossy, size_of::<PackedBsdf>()) + of(sheen || anisotropic, size_of::<PackedLayers>())
}

/// What a texture multiplies in [`Material`]: a channel each.
#[derive(Debug, Clone, Copy)]
pub struct TextureFactor {
    /// Offset of the [`TextureLookup`](super::TextureLookup)'s index in the record.
    pub texture: usize,
    /// Offset of the first number.
    pub factor: usize,
    /// Its channel, and that of each number after it.
    pub channels: &'static [usize],
}

macro_rules! texture_factors {
    ($($texture:ident: $factor:ident * $channels:expr,)*) => {
        /// What textures make of a material's factors; [`Material::base_color`] has the corners' colours beside.
        pub const TEXTURE_FACTORS: &[TextureFactor] = &[
            $(TextureFactor {
                texture: std::mem::offset_of!(Material, $texture),
                factor: std::mem::offset_of!(Material, $factor),
                channels: $channels,
            },)*
        ];
    };
}

/// All of a texture's colour.
const RGB: &[usize] = &[0, 1, 2];

texture_factors! {
    color_texture: base_color * RGB,
    metal_texture: roughness * &[1],
    metal_texture: metallic * &[2],
    emission_texture: emission * RGB,
    transmission_texture: transmission * &[0],
    specular_texture: specular_f0 * &[3, 3, 3],
    specular_texture: specular_f90 * &[3],
    specular_color_texture: specular_f0 * RGB,
    coat_texture: coat * &[0],
    coat_roughness_texture: coat_roughness * &[1],
    sheen_texture: sheen_color * RGB,
    sheen_roughness_texture: sheen_roughness * &[3],
}
