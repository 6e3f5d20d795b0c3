//! Constants shared by host and kernels. The build defines each in GLSL by its name, see `build/layout.rs`.

/// A constant's value in GLSL.
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
    /// Numbers per block of the prefix sum.
    pub const SCAN_BLOCK: u32 = 2048;

    /// Keys per tile of the radix sort.
    pub const SORT_TILE: u32 = 2048;

    /// Objects, and materials, of a pixel that are counted.
    pub const IDS_OF_PIXEL: u32 = 8;

    /// Object of a slot without a visible point.
    pub const NO_OBJECT: u32 = u32::MAX;

    /// Bit of a photon's object: since the light its path has hit only mirrors and glass, in a scene with a separate map of such
    /// photons.
    pub const CAUSTIC: u32 = 1 << 31;

    /// Shells around the camera with separate grids.
    pub const SHELLS: usize = 8;

    /// Light of a triangle that does not emit.
    pub const NO_LIGHT: u32 = u32::MAX;

    /// [`super::Light::kind`] of an emissive triangle.
    pub const TRIANGLE_LIGHT: u32 = 0;
    /// [`super::Light::kind`] of a point light.
    pub const POINT_LIGHT: u32 = 1;
    /// [`super::Light::kind`] of a spotlight.
    pub const SPOT_LIGHT: u32 = 2;
    /// [`super::Light::kind`] of a distant light with parallel rays.
    pub const DIRECTIONAL_LIGHT: u32 = 3;
    /// [`super::Light::kind`] of the environment: at most one, and the last light.
    pub const ENVIRONMENT_LIGHT: u32 = 4;

    /// Bit of a reference to a [`super::BvhRecord`]: it is the first record of a leaf.
    pub const LEAF: u32 = 1 << 31;

    /// [`super::BvhInstance::kind`]: the transform to render space. The next record is its [`RAY_RECORD`].
    pub const PLACEMENT_RECORD: u32 = 1;
    /// [`super::BvhInstance::kind`]: the transform of rays to the space of the instance.
    pub const RAY_RECORD: u32 = 2;

    /// Bit of [`super::ShadingTriangle::flags`]: the shading normals differ from the geometric one.
    pub const SMOOTH_SHADED: u32 = 1;
    /// Bit of [`super::ShadingTriangle::flags`]: dielectric, and it may lie on another face.
    pub const TOUCHED: u32 = 2;
    /// Bit of [`super::ShadingTriangle::flags`]: its material varies, by textures or vertex colours.
    pub const TEXTURED_TRIANGLE: u32 = 4;
    /// Bit of [`super::ShadingTriangle::flags`]: it may be partly transparent, see [`super::Material::alpha_mode`].
    pub const SEE_THROUGH: u32 = 8;
    /// Bit of [`super::ShadingTriangle::flags`]: not dielectric, and it lies on a face of another object that has the same
    /// orientation or emits to that side.
    pub const COINCIDENT: u32 = 16;
    /// Bit of [`super::ShadingTriangle::flags`]: not dielectric, and its back lies on the back of another object's face.
    pub const BACKED: u32 = 32;
    /// First bit of a dielectric's rank in [`super::ShadingTriangle::flags`] and [`super::Instance::flags`]: where several
    /// overlap, the lowest rank counts.
    pub const RANK: u32 = 16;

    /// Bit of [`super::Instance::flags`]: the transform swaps fronts and backs.
    pub const MIRRORED: u32 = 1;

    /// [`super::Material::flags`]: the back also emits.
    pub const BACK_EMITS: u32 = 1;
    /// [`super::Material::flags`]: the back is culled for cameras.
    pub const BACK_HIDDEN: u32 = 2;
    /// [`super::Material::flags`]: the reflectance of a dielectric is not that of its refractive index.
    pub const SPECULAR_CHANGED: u32 = 4;

    /// Camera paths follow reflections with a smaller GGX α.
    pub const FOLLOWED_ALPHA: f64 = 0.1;

    /// Index of a missing texture.
    pub const NO_TEXTURE: u32 = u32::MAX;

    /// [`super::Material::alpha_mode`]: opaque.
    pub const OPAQUE: u32 = 0;
    /// [`super::Material::alpha_mode`]: opaque where alpha reaches the cutoff, else transparent.
    pub const MASK: u32 = 1;
    /// [`super::Material::alpha_mode`]: alpha is the opacity.
    pub const BLEND: u32 = 2;

    /// Bit of [`super::TextureLookup::flags`]: the second set of coordinates.
    pub const SECOND_SET: u32 = 1;
    /// Bit of [`super::TextureLookup::flags`]: texels hold sRGB.
    pub const SRGB: u32 = 2;
    /// Bit of [`super::TextureLookup::flags`]: the nearest texel instead of bilinear interpolation.
    pub const NEAREST: u32 = 4;
    /// First bit of the wrap mode along u in [`super::TextureLookup::flags`]: [`REPEAT`], [`CLAMP`] or [`MIRROR_REPEAT`].
    pub const WRAP_U: u32 = 4;
    /// First bit of the wrap mode along v.
    pub const WRAP_V: u32 = 6;
    /// Wrap mode: repeat.
    pub const REPEAT: u32 = 0;
    /// Wrap mode: clamp to the edge.
    pub const CLAMP: u32 = 1;
    /// Wrap mode: mirrored repeat.
    pub const MIRROR_REPEAT: u32 = 2;

    /// Bit of [`super::StatusCounters::retry`]: photons exceeded the capacity of a lane or a batch.
    pub const PHOTONS_DID_NOT_FIT: u32 = 1;
    /// Bit of [`super::StatusCounters::retry`]: a lane's paths need more loop iterations than the driver allows.
    pub const LANES_TOO_LONG: u32 = 2;
    /// Bit of [`super::StatusCounters::retry`]: a visible point has more photons to test than the driver allows loop iterations.
    pub const GATHERS_TOO_LONG: u32 = 4;

    /// [`super::Material::surface`] of a Lambertian reflector.
    pub const MATTE: u32 = 0;
    /// [`super::Material::surface`] of a perfect mirror.
    pub const MIRROR: u32 = 1;
    /// [`super::Material::surface`] of a dielectric.
    pub const DIELECTRIC: u32 = 2;
    /// [`super::Material::surface`] of microfacets over a Lambertian base.
    pub const GLOSSY_SURFACE: u32 = 3;

    /// No medium; also fills unused entries of a set of four. It is the highest.
    pub const VACUUM: u32 = u32::MAX;

    /// Sign bit of α in [`super::PackedBsdf::rest`]: the material is coated.
    pub const COATED: u32 = 0x8000;

    /// Side of a tile in pixels: visible points are stored tile by tile.
    pub const TILE: u32 = 8;
    /// Entries of a pixel filter's table.
    pub const FILTER_PLACES: u32 = 64;
    /// Visible points per workgroup of the paper's orders: the workgroup size of `gather_*.comp`, and a cluster's run.
    pub const GROUP: u32 = 64;
    /// A filler in an order of visible points.
    pub const NO_SLOT: u32 = u32::MAX;
    /// Bits of a key along the space-filling curve of `point_curve.comp`, the same number for each coordinate.
    pub const CURVE_BITS: u32 = 18;
    /// log2 of the entries of the demand table.
    pub const DEMAND_BITS: u32 = 18;
    /// Size of the demand table's cells relative to those of the gather's grid.
    pub const COARSENING: f32 = 3.0;
    /// Bit of a slot's number of tested photons: the slot was processed.
    pub const GATHERED_FOR: u32 = 1 << 31;

    /// Cell size over R of a grid with equal radii. Measured, see docs/gather.md.
    pub const CELLS_TO_RADIUS: f32 = 1.5;
    /// Minimum cell size, render units. Positions resolve 6e-8: finer cells would gain nothing, and a visible point would reach
    /// too many of them.
    pub const SMALLEST_CELL: f32 = 1.0 / 1_048_576.0;
    /// Maximum number of cells that the largest radius of a shell spans: the few dark points with large radii must not slow down
    /// the others. There are so few photons there that cells of this size are nearly empty.
    pub const MOST_CELLS: f32 = 8.0;

    /// Random number generators: `config::Sampler`.
    pub const SOBOL: u32 = 0;
    /// See [`SOBOL`].
    pub const INDEPENDENT: u32 = 1;
    /// See [`SOBOL`].
    pub const CONGRUENTIAL: u32 = 2;
    /// Low-discrepancy sequences that iterations use in turn: iteration i takes the next numbers of sequence i mod 4. They are
    /// independent of each other, so that their spread shows the picture's error (`estimate`). Pixels continue them through the
    /// whole render, so that each converges nearly as fast as a single sequence would.
    pub const SEQUENCES: u32 = 4;
    /// Mixed into the seed, so that kinds of paths have different random numbers: `random::PathKind`.
    pub const CAMERA_PATH: u32 = 0x6361_6d65;
    /// See [`CAMERA_PATH`].
    pub const PHOTON_PATH: u32 = 0x7068_6f74;
    /// See [`CAMERA_PATH`].
    pub const LIGHT_SAMPLE: u32 = 0x6c69_6768;
    /// See [`CAMERA_PATH`].
    pub const COVERAGE_SAMPLE: u32 = 0x636f_7665;
    /// Second word of the random numbers of delta lights; no instance has that index.
    pub const DELTA_LIGHT_NUMBERS: u32 = 0x676c_696e;

    /// Offset of a ray's origin from its surface, relative to the coordinates of the triangle.
    pub const ROUNDINGS: f64 = 16.0 / 16_777_216.0;
    /// Minimum cosine between planes whose faces can coincide in more than a line.
    pub const PARALLEL: f64 = 0.99;
    /// A shadow ray ends this fraction of its length before the light, because its rounded end could hit the light's neighbours.
    pub const ENDS_BEFORE: f64 = 16.0 / 16_777_216.0;

    /// Boundaries with a smaller α are perfect mirrors.
    pub const SMOOTH_ALPHA: f64 = 1e-3;
    /// Minimum roughness of anisotropic materials: their α across the direction is at least [`SMOOTH_ALPHA`].
    pub const LEAST_ROUGHNESS: f64 = 0.031_623;
    /// Reflectance of a clear coat (refractive index 1.5) at normal incidence.
    pub const COAT_F0: f64 = 0.04;
    /// Shortest sampled wavelength, nm.
    pub const SHORTEST_WAVELENGTH: f64 = 400.0;
    /// Longest sampled wavelength, nm.
    pub const LONGEST_WAVELENGTH: f64 = 700.0;

    /// Spheres seen within a cone of less than this sin² are aimed at from matte surfaces.
    pub const NARROW_CONE: f64 = 0.25;
    /// For spheres seen within a cone of more than this sin², directions are sampled by their cosine.
    pub const WIDE_CONE: f64 = 0.5;
    /// Share of the choices among contributing light sources that does not depend on the point, because bright sources may be
    /// occluded.
    pub const WITHOUT_POINT: f64 = 0.1;

    /// Maximum number of glass surfaces between a point and a light sample.
    pub const DIRECT_CROSSINGS: u32 = 8;
    /// From this number of photons on, a point samples light behind glass only in the first of [`BEHIND_GLASS_EVERY`] iterations.
    pub const SEASONED: u32 = 16;
    /// See [`SEASONED`].
    pub const BEHIND_GLASS_EVERY: u32 = 32;
    /// Weight of an iteration in a disc's coverage, whatever its number of samples.
    pub const COVERAGE_WHOLE: u32 = 16;
    /// A disc that has been fully covered in this number of iterations is sampled only in every eighth one, with its neighbours:
    /// discs only shrink.
    pub const COVERAGE_TRUSTED: u32 = 4;
    /// Maximum number of surfaces between a visible point and a point of its disc.
    pub const COVERAGE_CROSSINGS: u32 = 4;

    /// R² and τ stop shrinking at this R²: far below the resolution of positions, far above the smallest f32. With α close to 0,
    /// equation 2 reaches it after a few photons; from then on the density is that at this radius.
    pub const SMALLEST_RADIUS2: f64 = 1e-24;
}
