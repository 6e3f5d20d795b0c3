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

impl From<f32> for Number {
    fn from(value: f32) -> Self {
        Self::Float(value.into())
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
    /// Numbers of a block of the prefix sum.
    pub const SCAN_BLOCK: u32 = 2048;

    /// Keys of a tile of the radix sort.
    pub const SORT_TILE: u32 = 2048;

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

    /// Bit of [`super::StatusCounters::retry`]: a lane's photons or a batch's didn't fit.
    pub const PHOTONS_DID_NOT_FIT: u32 = 1;
    /// Bit of [`super::StatusCounters::retry`]: a lane's paths need more loop iterations than the driver gives.
    pub const LANES_TOO_LONG: u32 = 2;
    /// Bit of [`super::StatusCounters::retry`]: a visible point has more photons to test than loop iterations.
    pub const GATHERS_TOO_LONG: u32 = 4;

    /// [`super::Material::surface`] of a Lambertian reflector.
    pub const MATTE: u32 = 0;
    /// [`super::Material::surface`] of a perfect mirror.
    pub const MIRROR: u32 = 1;
    /// [`super::Material::surface`] of a dielectric.
    pub const DIELECTRIC: u32 = 2;
    /// [`super::Material::surface`] of microfacets over a Lambertian base.
    pub const GLOSSY_SURFACE: u32 = 3;

    /// No medium: what a set of four has where it has fewer. It comes last.
    pub const VACUUM: u32 = u32::MAX;

    /// In [`super::PackedBsdf::rest`], the sign of α: whether the material is coated.
    pub const COATED: u32 = 0x8000;

    /// Pixels of a tile's side: visible points lie in memory tile by tile.
    pub const TILE: u32 = 8;
    /// Visible points of a workgroup of the paper's orders: the workgroup size of `gather_*.comp`, and a cluster's run.
    pub const GROUP: u32 = 64;
    /// What an order of visible points has at a filler's place.
    pub const NO_SLOT: u32 = u32::MAX;
    /// Bits of a key along the space-filling curve of `point_curve.comp`, as many of each coordinate.
    pub const CURVE_BITS: u32 = 18;
    /// log2 of the entries of the table of what visible points want.
    pub const DEMAND_BITS: u32 = 18;
    /// Cells of that table are so many times larger than those of the gather's grid.
    pub const COARSENING: f32 = 3.0;
    /// Bit of a slot's number of tested photons: it had its turn.
    pub const GATHERED_FOR: u32 = 1 << 31;

    /// Cell size over R, of a grid, where all radii are alike. Measured, see docs/gather.md.
    pub const CELLS_TO_RADIUS: f32 = 1.5;
    /// Smallest cell size, render units. Positions resolve 6e-8: finer cells would gain nothing, and a visible point would reach
    /// too many of them.
    pub const SMALLEST_CELL: f32 = 1.0 / 1_048_576.0;
    /// Cells that the largest radius of a shell may span: the few points in the dark that have it must not hold up the rest. It
    /// holds so few photons that cells of that size are nearly empty.
    pub const MOST_CELLS: f32 = 8.0;

    /// Where random numbers come from: `config::Sampler`.
    pub const SOBOL: u32 = 0;
    /// Likewise.
    pub const INDEPENDENT: u32 = 1;
    /// Likewise.
    pub const CONGRUENTIAL: u32 = 2;
    /// Sequences of random numbers of low discrepancy that iterations take turns with: iteration i has the next numbers of
    /// sequence i mod 4. They are independent of each other, so that their spread tells the picture's error
    /// (`estimate`), and those of pixels go on through the whole render, so that each converges nearly as fast as one
    /// for all would.
    pub const SEQUENCES: u32 = 4;
    /// Mixed into the seed, so that kinds of paths don't draw the same numbers: `random::PathKind`.
    pub const CAMERA_PATH: u32 = 0x6361_6d65;
    /// Likewise.
    pub const PHOTON_PATH: u32 = 0x7068_6f74;
    /// Likewise.
    pub const LIGHT_SAMPLE: u32 = 0x6c69_6768;
    /// Likewise.
    pub const COVERAGE_SAMPLE: u32 = 0x636f_7665;
    /// Second word of the random numbers that belong to delta lights; no instance has that index.
    pub const DELTA_LIGHT_NUMBERS: u32 = 0x676c_696e;

    /// Parts of a triangle's coordinates by which rays leave it.
    pub const ROUNDINGS: f64 = 16.0 / 16_777_216.0;
    /// Cosine of the angle between planes up to which faces can lie on each other over more than a line.
    pub const PARALLEL: f64 = 0.99;
    /// A shadow ray ends this part of its length before the light, whose neighbours its rounded end may meet otherwise.
    pub const ENDS_BEFORE: f64 = 16.0 / 16_777_216.0;

    /// Below this α a boundary is a mirror.
    pub const SMOOTH_ALPHA: f64 = 1e-3;
    /// Reflectance of a clear coat, whose index of refraction is 1.5, at normal incidence.
    pub const COAT_F0: f64 = 0.04;
    /// Wavelengths that paths have, nm: the shortest.
    pub const SHORTEST_WAVELENGTH: f64 = 400.0;
    /// The longest.
    pub const LONGEST_WAVELENGTH: f64 = 700.0;

    /// A sphere that is seen within less than this, sin² of its cone's angle, is worth aiming at from a matte surface.
    pub const NARROW_CONE: f64 = 0.25;
    /// Where a sphere takes up more than this of the directions, sin² of its cone's angle, they are chosen by their cosine.
    pub const WIDE_CONE: f64 = 0.5;
    /// The part of all choices among sources that can bring anything that is made without knowing the point: what is before a
    /// bright one isn't known.
    pub const WITHOUT_POINT: f64 = 0.1;

    /// Glass surfaces that are crossed on the way to a light at the most.
    pub const DIRECT_CROSSINGS: u32 = 8;
    /// Photons from which on a point asks for what lies behind glass in the first of [`ASKS_EVERY`] iterations alone.
    pub const SEASONED: u32 = 16;
    /// See [`SEASONED`].
    pub const ASKS_EVERY: u32 = 32;
    /// What an iteration counts for in a disc's coverage, whatever its points.
    pub const COVERAGE_WHOLE: u32 = 16;
    /// A disc that has been covered in so many iterations, and wholly, is asked for in every eighth one alone, as its neighbours
    /// are: discs only shrink.
    pub const COVERAGE_TRUSTED: u32 = 4;
    /// Surfaces that are crossed on the way to a point of a disc at the most.
    pub const COVERAGE_CROSSINGS: u32 = 4;

    /// R² where it stops shrinking, and τ with it: far below what positions resolve, far above the smallest f32. With an α next
    /// to 0 it takes eq. 2 a few photons to get there; from then on their density is that at this radius.
    pub const SMALLEST_RADIUS2: f64 = 1e-24;
}
