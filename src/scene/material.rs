//! Materials: how surfaces scatter and emit light, the record that kernels have of it, and what of their code that needs.

use glam::Vec3;

use crate::layout::{
    self, BACK_EMITS, BACK_HIDDEN, BLEND, DIELECTRIC, GLOSSY_SURFACE, MASK, MATTE, MIRROR, NO_TEXTURE, OPAQUE,
    SPECULAR_CHANGED,
};

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

/// KHR_materials_sheen: fibres that stand off the surface, below a coat.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sheen {
    /// Linear RGB, 0 ..= 1; black for none.
    pub color: Vec3,
    /// 0 ..= 1.
    pub roughness: f32,
}

/// KHR_materials_anisotropy: of the microfacets below coat and sheen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Anisotropy {
    /// 0 ..= 1; 0 for none.
    pub strength: f32,
    /// Angle from the tangent to the direction along which highlights are long, radians.
    pub rotation: f32,
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

/// What lies above the rest, and what other extensions make of the lobes; the default is none of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Layers {
    /// The topmost.
    pub coat: Coat,
    /// Below it.
    pub sheen: Sheen,
    /// Below both.
    pub anisotropy: Anisotropy,
}

impl Layers {
    /// Whether a surface with these has more than a Lambertian lobe or a mirror's.
    pub fn are_glossy(&self) -> bool {
        self.coat.factor > 0.0 || self.sheen.color != Vec3::ZERO
    }

    /// Whether it is more than a mirror, which may have a coat.
    pub fn hide_mirrors(&self) -> bool {
        self.sheen.color != Vec3::ZERO || self.anisotropy.strength > 0.0
    }
}

/// Declares a material's textures, each with its field in the record.
macro_rules! material_textures {
    ($($(#[$doc:meta])* $texture:ident: $field:ident,)*) => {
        /// Indices into [`Textures::lookups`](super::Textures::lookups) of what a material's factors are multiplied with.
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct MaterialTextures {
            $($(#[$doc])* pub $texture: Option<u32>,)*
            /// How far the normals lean.
            pub normal_scale: f32,
            /// How far those of the coat lean.
            pub coat_normal_scale: f32,
        }

        impl MaterialTextures {
            /// Whether there is one.
            pub fn any(&self) -> bool {
                [$(self.$texture),*].iter().any(Option::is_some)
            }

            fn pack(&self, record: &mut layout::Material) {
                $(record.$field = self.$texture.unwrap_or(NO_TEXTURE);)*
                record.normal_scale = self.normal_scale;
                record.coat_normal_scale = self.coat_normal_scale;
            }
        }
    };
}

material_textures! {
    /// Base colour, and alpha.
    base_color: color_texture,
    /// Roughness in green, metal in blue.
    metallic_roughness: metal_texture,
    /// Normals.
    normal: normal_texture,
    /// Emission.
    emission: emission_texture,
    /// Transmission in red.
    transmission: transmission_texture,
    /// Reflectance at both angles in alpha.
    specular: specular_texture,
    /// Reflectance at normal incidence.
    specular_color: specular_color_texture,
    /// How much of a clear coat there is, in red.
    coat: coat_texture,
    /// Its roughness, in green.
    coat_roughness: coat_roughness_texture,
    /// Its normals.
    coat_normal: coat_normal_texture,
    /// Reflectance of the sheen.
    sheen: sheen_texture,
    /// Its roughness, in alpha.
    sheen_roughness: sheen_roughness_texture,
    /// Direction of anisotropy in red and green, how far in blue.
    anisotropy: anisotropy_texture,
}

/// A glTF material, reduced to what is supported.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// How it scatters.
    pub surface: Surface,
    /// What lies above that.
    pub layers: Layers,
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

impl Material {
    /// As kernels have it.
    pub(crate) fn record(&self) -> layout::Material {
        let (surface, glass, gloss) = match self.surface {
            Surface::Matte => (MATTE, None, Gloss::default()),
            Surface::Mirror => (MIRROR, None, Gloss::default()),
            Surface::Dielectric(glass) => (DIELECTRIC, Some(glass), glass.gloss),
            Surface::Glossy(gloss) => (GLOSSY_SURFACE, None, gloss),
        };
        let inside = glass.unwrap_or(Dielectric::clear(1.0));
        let (alpha_mode, alpha, alpha_cutoff) = match self.alpha {
            Alpha::Opaque => (OPAQUE, 1.0, 0.0),
            Alpha::Mask { alpha, cutoff } => (MASK, alpha, cutoff),
            Alpha::Blend { alpha } => (BLEND, alpha, 0.0),
        };
        let mut record = layout::Material {
            base_color: self.base_color.to_array(),
            surface,
            emission: self.emission.to_array(),
            ior: inside.ior,
            flags: if self.back_emits { BACK_EMITS } else { 0 } | if self.back_hidden { BACK_HIDDEN } else { 0 },
            metallic: gloss.metallic,
            roughness: glass.map_or(gloss.roughness, |glass| glass.roughness),
            transmission: inside.transmission,
            specular_f0: gloss.specular_f0.to_array(),
            specular_f90: gloss.specular_f90,
            absorption: inside.absorption.to_array(),
            thin: inside.thin.into(),
            alpha_mode,
            alpha_cutoff,
            alpha,
            dispersion: inside.dispersion,
            coat: self.layers.coat.factor,
            coat_roughness: self.layers.coat.roughness,
            sheen_color: self.layers.sheen.color.to_array(),
            sheen_roughness: self.layers.sheen.roughness,
            anisotropy: self.layers.anisotropy.strength,
            anisotropy_rotation: self.layers.anisotropy.rotation,
            ..bytemuck::Zeroable::zeroed()
        };
        self.textures.pack(&mut record);
        if surface == DIELECTRIC && is_changed(&record) {
            record.flags |= SPECULAR_CHANGED;
        }
        record
    }

    /// Whether a place of a triangle makes something of it: by textures or by tangents.
    pub(crate) fn needs_corners(&self) -> bool {
        self.textures.any() || self.layers.anisotropy.strength > 0.0
    }
}

/// Whether a dielectric reflects another part of the light than its index says: KHR_materials_specular.
fn is_changed(glass: &layout::Material) -> bool {
    let textures = [glass.specular_texture, glass.specular_color_texture];
    let of_ior = normal_reflectance(glass.ior);
    let is_other = |f0: &f32| (f0 - of_ior).abs() > 1e-6 * of_ior;
    textures != [NO_TEXTURE; 2] || glass.specular_f90 != 1.0 || glass.specular_f0.iter().any(is_other)
}

/// Hands `$then` what kernels need to know of materials: a name, the constant that says so, and of which records it holds.
macro_rules! material_features {
    ($then:ident $($rest:tt)*) => {
        $then! {
            /// Mirrors.
            mirror: "MIRRORS" = |it| it.surface == $crate::layout::MIRROR,
            /// Boundaries of dielectrics.
            dielectric: "DIELECTRICS" = |it| it.is_dielectric(),
            /// Microfacets over a base.
            glossy: "GLOSSY" = |it| it.is_layered() || it.coat > 0.0,
            /// Microfacets of dielectrics.
            rough_glass: "ROUGH_GLASS" = |it| it.is_dielectric() && it.roughness > 0.0,
            /// Dielectrics without an inside.
            thin_walls: "THIN_WALLS" = |it| it.is_dielectric() && it.thin != 0,
            /// Dielectrics that pass a part of the light only.
            partly_clear: "PARTLY_CLEAR" = |it| it.is_mixed(),
            /// Dielectrics that absorb light inside.
            absorption: "ABSORPTION" = |it| it.is_dielectric() && it.absorption != [0.0; 3],
            /// Dielectrics that bend each wavelength its own way.
            dispersion: "DISPERSION" = |it| it.is_dielectric() && it.dispersion > 0.0,
            /// Dielectrics that reflect more or less than their index says.
            specular_glass: "SPECULAR_GLASS" = |it| it.flags & $crate::layout::SPECULAR_CHANGED != 0,
            /// Clear coats.
            coat: "CLEARCOAT" = |it| it.coat > 0.0,
            /// Sheens.
            sheen: "SHEEN" = |it| it.is_layered() && it.sheen_color != [0.0; 3],
            /// Microfacets whose highlights are longer in one direction.
            anisotropic: "ANISOTROPY" = |it| it.is_layered() && it.anisotropy > 0.0,
            /// Surfaces whose back no camera sees.
            culling: "CULLING" = |it| it.flags & $crate::layout::BACK_HIDDEN != 0,
            $($rest)*
        }
    };
}
pub(crate) use material_features;

impl layout::Material {
    pub(crate) fn is_dielectric(&self) -> bool {
        self.surface == DIELECTRIC
    }

    /// Whether a part of it is microfacets over a base, which can have layers.
    pub(crate) fn is_layered(&self) -> bool {
        self.surface == GLOSSY_SURFACE || self.is_mixed()
    }

    /// Whether it passes a part of the light only, at least somewhere: a texture makes less of the factor.
    pub(crate) fn is_mixed(&self) -> bool {
        let clear = self.transmission == 1.0 && self.transmission_texture == NO_TEXTURE && self.metallic == 0.0;
        self.is_dielectric() && !clear
    }
}

/// A dielectric's reflectance at normal incidence.
pub(crate) fn normal_reflectance(ior: f32) -> f32 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}
