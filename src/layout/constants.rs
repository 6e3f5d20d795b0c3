//! Numbers that host and kernels share. The build gives the kernels each by its name, see `build/layout.rs`.

/// A constant's value, as kernels know it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// `uint`.
    Uint(u32),
    /// `float`.
    Float(f64),
}

impl From<u32> for Number {
    fn from(value: u32) -> Self {
        Self::Uint(value)
    }
}

impl From<usize> for Number {
    fn from(value: usize) -> Self {
        Self::Uint(u32::try_from(value).expect("a uint"))
    }
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}

/// Declares constants, and [`all`], which lists them.
macro_rules! shared_constants {
    ($($(#[$doc:meta])* pub const $name:ident: $type:ty = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: $type = $value;)*

        /// Name and value of every constant of this module.
        pub fn all() -> Vec<(&'static str, Number)> {
            vec![$((stringify!($name), $name.into()),)*]
        }
    };
}

shared_constants! {
    /// Object of a visible point whose path met no matte surface.
    pub const NO_OBJECT: u32 = u32::MAX;

    /// Bit of a photon's object: since the light it has met mirrors and glass alone, in a scene that gathers such photons apart.
    pub const CAUSTIC: u32 = 1 << 31;

    /// Shells around the camera that have grids of their own.
    pub const SHELLS: usize = 8;

    /// Light of a triangle that doesn't emit.
    pub const NO_LIGHT: u32 = u32::MAX;

    /// [`super::Light::kind`] of a triangle that emits.
    pub const TRIANGLE_LIGHT: u32 = 0;
    /// [`super::Light::kind`] of a point that shines in all directions.
    pub const POINT_LIGHT: u32 = 1;
    /// [`super::Light::kind`] of a point that shines into a cone.
    pub const SPOT_LIGHT: u32 = 2;
    /// [`super::Light::kind`] of a light so far away that its rays are parallel.
    pub const DIRECTIONAL_LIGHT: u32 = 3;
    /// [`super::Light::kind`] of the environment. There is one at the most, and it is the last light.
    pub const ENVIRONMENT_LIGHT: u32 = 4;

    /// Bit of a reference to a [`super::BvhRecord`]: it is a triangle of a leaf.
    pub const LEAF: u32 = 1 << 31;

    /// Kind of a leaf's [`super::BvhRecord`]: where an instance puts its triangles. The next record is its [`RAY_RECORD`].
    pub const PLACEMENT_RECORD: u32 = 1;
    /// Kind of a leaf's [`super::BvhRecord`]: how rays come to the space of an instance's triangles.
    pub const RAY_RECORD: u32 = 2;

    /// Bit of [`super::ShadingTriangle::flags`]: the shading normals differ from the geometric one.
    pub const SMOOTH_SHADED: u32 = 1;
    /// Bit of [`super::ShadingTriangle::flags`]: a dielectric's, and it may lie on another face.
    pub const TOUCHED: u32 = 2;
    /// Bit of [`super::ShadingTriangle::flags`]: its material depends on the place, by textures or its corners' colours.
    pub const TEXTURED_TRIANGLE: u32 = 4;
    /// Bit of [`super::ShadingTriangle::flags`]: parts of it may not be there, see [`super::Material::alpha_mode`].
    pub const SEE_THROUGH: u32 = 8;
    /// Bit of [`super::ShadingTriangle::flags`]: no dielectric's, and it lies on a face of another object that looks to the same side or
    /// shines to it.
    pub const COINCIDENT: u32 = 16;
    /// Bit of [`super::ShadingTriangle::flags`]: no dielectric's, and its back lies on the back of another object's face.
    pub const BACKED: u32 = 32;
    /// From this bit on [`super::ShadingTriangle::flags`] and [`super::Instance::flags`] have a dielectric's rank: where several overlap, the
    /// lowest is there.
    pub const RANK: u32 = 16;

    /// Bit of [`super::Instance::flags`]: fronts become backs.
    pub const MIRRORED: u32 = 1;

    /// [`super::Material::flags`]: the back emits as the front does.
    pub const BACK_EMITS: u32 = 1;
    /// [`super::Material::flags`]: no camera sees the back.
    pub const BACK_HIDDEN: u32 = 2;
    /// [`super::Material::flags`]: a dielectric that reflects another part of the light than its index says.
    pub const SPECULAR_CHANGED: u32 = 4;

    /// Below this α of GGX camera paths follow reflections.
    pub const FOLLOWED_ALPHA: f64 = 0.1;

    /// Texture of a material that has none there.
    pub const NO_TEXTURE: u32 = u32::MAX;

    /// [`super::Material::alpha_mode`] of what is all there.
    pub const OPAQUE: u32 = 0;
    /// [`super::Material::alpha_mode`] of what is there where alpha reaches the cutoff.
    pub const MASK: u32 = 1;
    /// [`super::Material::alpha_mode`] of what is there with alpha as probability.
    pub const BLEND: u32 = 2;

    /// Bit of [`super::TextureLookup::flags`]: the second set of coordinates.
    pub const SECOND_SET: u32 = 1;
    /// Bit of [`super::TextureLookup::flags`]: texels hold sRGB.
    pub const SRGB: u32 = 2;
    /// Bit of [`super::TextureLookup::flags`]: the nearest texel instead of a blend of four.
    pub const NEAREST: u32 = 4;
    /// Place of the wrap along u in [`super::TextureLookup::flags`]: [`REPEAT`], [`CLAMP`] or [`MIRROR_REPEAT`].
    pub const WRAP_U: u32 = 4;
    /// Place of the wrap along v.
    pub const WRAP_V: u32 = 6;
    /// Wrap: begins anew.
    pub const REPEAT: u32 = 0;
    /// Wrap: the texel at the edge goes on.
    pub const CLAMP: u32 = 1;
    /// Wrap: goes back and forth.
    pub const MIRROR_REPEAT: u32 = 2;

    /// Bit of [`super::StatusCounters::again`]: a lane's photons or a batch's didn't fit.
    pub const PHOTONS_DID_NOT_FIT: u32 = 1;
    /// Bit of [`super::StatusCounters::again`]: a lane's paths need more loop iterations than the driver gives.
    pub const LANES_TOO_LONG: u32 = 2;
    /// Bit of [`super::StatusCounters::again`]: a visible point has more photons to test than loop iterations.
    pub const GATHERS_TOO_LONG: u32 = 4;
}
