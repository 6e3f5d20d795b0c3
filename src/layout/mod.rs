//! Every struct and number that host and kernels share, written once: `build/layout.rs` makes GLSL of this module, which is
//! why it knows no other. `tests/layout.rs` compares each struct with the reflected one.

pub mod constants;
mod shape;

use bytemuck::{Pod, Zeroable};

pub use constants::*;
pub use shape::{Scalar, Shape, Shared};

/// A field of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldLayout {
    /// Its name.
    pub name: &'static str,
    /// Bytes from the struct's beginning.
    pub offset: usize,
    /// Its type.
    pub shape: Shape,
}

/// A struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Its name.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// In order.
    pub fields: &'static [FieldLayout],
}

/// Declares structs of the device's layout and [`LAYOUTS`], which lists their fields.
macro_rules! device_structs {
    ($($(#[$doc:meta])* pub struct $name:ident: $size:literal {
        $($(#[$field_doc:meta])* pub $field:ident: $type:ty,)*
    })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
            pub struct $name {
                $($(#[$field_doc])* pub $field: $type,)*
            }
            const _: () = assert!(size_of::<$name>() == $size);
        )*
        /// Every struct of this module.
        pub const LAYOUTS: &[Layout] = &[
            $(Layout {
                name: stringify!($name),
                size: $size,
                fields: &[
                    $(FieldLayout {
                        name: stringify!($field),
                        offset: std::mem::offset_of!($name, $field),
                        shape: <$type as Shared>::SHAPE,
                    },)*
                ],
            },)*
        ];
    };
}

device_structs! {
    /// What stays the same through a render. Lengths in render units.
    pub struct Settings: 192 {
        /// xyz: centre of projection; w: radius of the lens.
        pub camera_position: [f32; 4],
        /// xyz: to the picture's right edge, at distance 1; w: distance along the direction of view of what is in focus.
        pub camera_right: [f32; 4],
        /// xyz: to the picture's top edge, at distance 1; w: 1 where rays are parallel, else 0.
        pub camera_up: [f32; 4],
        /// xyz: into the middle of the picture, at distance 1 along the direction of view.
        pub camera_forward: [f32; 4],
        /// Pixels, width and height.
        pub resolution: [u32; 2],
        /// Visible points a pixel.
        pub slots_per_pixel: u32,
        /// The user's seed.
        pub seed: u32,
        /// Lights.
        pub light_count: u32,
        /// Instances.
        pub instance_count: u32,
        /// Bounces of a path at the most.
        pub max_depth: u32,
        /// Triangles that instances don't share. Those come first.
        pub triangle_count: u32,
        /// Invocations of the photon stage.
        pub photon_lanes: u32,
        /// Photons that each of them can store.
        pub lane_capacity: u32,
        /// Photons that a batch can store.
        pub photon_capacity: u32,
        /// log2 of the grid's buckets.
        pub cell_bits: u32,
        /// Eq. 2's α.
        pub alpha: f32,
        /// The user's R² before the first photon; 0 where it follows the footprints.
        pub initial_radius2: f32,
        /// Iterations that all loops of one invocation may make together.
        pub loop_limit: u32,
        /// Probability that direct light is sampled by a direction of the BSDF instead of a light's point, near a
        /// light.
        pub bsdf_sampling: f32,
        /// R before the first photon in footprints, of global and of caustic photons.
        pub first_footprints: [f32; 2],
        /// R at the most; 0: no bound.
        pub most_footprints: [f32; 2],
        /// 2 where caustic photons are gathered apart from the others, else 1.
        pub photon_maps: u32,
        /// Side of a pixel's footprint at distance 1 along a path, or anywhere where rays are parallel.
        pub pixel_spread: f32,
        /// What the squared radiance has beside it where what visible points want of photons is weighed.
        pub demand_floor2: f32,
        /// Spheres in which a light is near.
        pub near_light_count: u32,
        /// [`LightSource`]s.
        pub light_source_count: u32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
        /// Names of the media that the camera is in, the lowest first; 2³² − 1 where there are fewer.
        pub camera_media: [u32; 4],
    }

    /// A record of the BVH: an inner node with the boxes of both children, or a triangle of a leaf, or one of the two of an
    /// instance. Records refer to each other by index; a reference with [`LEAF`] set is to the first record of a leaf, whose
    /// others follow it. An instance is a leaf of its own.
    pub struct BvhRecord: 64 {
        /// Node: corner of the left box; w: u32 bits, the left reference. Triangle: its first corner. Instance: first row of
        /// the map to render space, or back.
        pub row0: [f32; 4],
        /// Node: the left box's other corner. Triangle: its second corner. Instance: second row.
        pub row1: [f32; 4],
        /// Node: corner of the right box; w: u32 bits, the right reference. Triangle: its third corner. Instance: third row.
        pub row2: [f32; 4],
        /// Node: the right box's other corner. Leaf: u32 bits: x: index of the triangle or instance, or root of the instance's
        /// hierarchy; y: 1 for a leaf's last; z: 0, [`PLACEMENT_RECORD`] or [`RAY_RECORD`]. f32: w: of the latter, what the
        /// hierarchy's boxes are widened by.
        pub row3: [f32; 4],
    }

    /// Where shared triangles are put.
    pub struct Instance: 64 {
        /// Rows of the map to render space.
        pub rows: [[f32; 4]; 3],
        /// Index of its object.
        pub object: u32,
        /// [`MIRRORED`], and the rank from bit [`RANK`] on.
        pub flags: u32,
        /// Index of its first triangle.
        pub first_triangle: u32,
        /// How many it has.
        pub triangle_count: u32,
    }

    /// Havel and Herout's precomputed triangle.
    pub struct HavelTriangle: 48 {
        /// xyz: normal (not unit); w: its plane's offset.
        pub n0: [f32; 4],
        /// xyz, w: plane whose value is the barycentric coordinate u.
        pub n1: [f32; 4],
        /// xyz, w: plane whose value is the barycentric coordinate v.
        pub n2: [f32; 4],
    }

    /// A triangle as shading needs it.
    pub struct ShadingTriangle: 64 {
        /// xyz: position; w: u32 bits, octahedral shading normal.
        pub p0: [f32; 4],
        /// Likewise.
        pub p1: [f32; 4],
        /// Likewise.
        pub p2: [f32; 4],
        /// Index of its object; what instances share has none.
        pub object: u32,
        /// Index of its material.
        pub material: u32,
        /// [`SMOOTH_SHADED`], [`TOUCHED`], [`TEXTURED_TRIANGLE`], [`SEE_THROUGH`], [`COINCIDENT`], [`BACKED`], and the rank from bit
        /// [`RANK`] on; what instances share has none.
        pub flags: u32,
        /// Index of its light, the first of those of its parts, or [`NO_LIGHT`].
        pub light: u32,
    }

    /// What the corner of a triangle has for textures.
    pub struct Corner: 32 {
        /// Coordinates of the first set.
        pub first: [f32; 2],
        /// Of the second set.
        pub second: [f32; 2],
        /// Factor of the base colour, linear RGBA, f16s.
        pub color: [u32; 2],
        /// Octahedral tangent.
        pub tangent: u32,
        /// 1 or −1 for the bitangent's side, 0 where there is no tangent.
        pub bitangent: f32,
    }

    /// How a texture is looked up. A place is row · (u, v, 1), in widths and heights of the image.
    pub struct TextureLookup: 48 {
        /// To the place along the image's width.
        pub row_u: [f32; 3],
        /// Index of the image's first texel, which is the top left one: RGBA, a byte each.
        pub first_texel: u32,
        /// To the place along the image's height.
        pub row_v: [f32; 3],
        /// Width, and height in the upper half.
        pub size: u32,
        /// [`SECOND_SET`], [`SRGB`], [`NEAREST`], and the wraps at [`WRAP_U`] and [`WRAP_V`].
        pub flags: u32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
    }

    /// A material. Textures are indices of [`TextureLookup`]s, or [`NO_TEXTURE`]; each is a factor.
    pub struct Material: 160 {
        /// Linear RGB albedo, reflectance or tint.
        pub base_color: [f32; 3],
        /// 0 matte, 1 mirror, 2 dielectric, 3 glossy.
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
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
    }

    /// A light, and a cell of the alias table that chooses one. What its kind doesn't use is zero.
    pub struct Light: 80 {
        /// Triangle: its index.
        pub triangle: u32,
        /// Its probability, nearly in proportion to its flux.
        pub probability: f32,
        /// Area of the triangle, or of its part, or of the disc that a distant light's photons start from.
        pub area: f32,
        /// [`TRIANGLE_LIGHT`], [`POINT_LIGHT`], [`SPOT_LIGHT`], [`DIRECTIONAL_LIGHT`] or [`ENVIRONMENT_LIGHT`].
        pub kind: u32,
        /// Of the cell: the part of it that chooses this light.
        pub accept: f32,
        /// Of the cell: the light that the rest of it chooses.
        pub alias: u32,
        /// Probability of this light and those before it among the lights of its source ([`EmissionCell`]), a multiple of 2⁻²⁴.
        pub cumulative: f32,
        /// Point, spot: radius of a disc that looks at whom it lights, render units. Directional: 1 − cos of the angle between the
        /// middle and the edge of what is seen of it. 0: none.
        pub extent: f32,
        /// Point, spot: radiant intensity along the axis. Directional: irradiance across the rays. Linear RGB.
        pub intensity: [f32; 3],
        /// Spot: 1 − cos of the angle where it begins to fall off.
        pub inner: f32,
        /// Point, spot: where it is. Directional: centre of the disc. Triangle: which of its parts, each a light of its own, this one is:
        /// column and row, and how many columns there are; all of it is 0, 0, 1. They follow each other row by row.
        pub position: [f32; 3],
        /// Spot: 1 − cos of the angle where it ends.
        pub outer: f32,
        /// Spot, directional: unit vector that it shines along.
        pub direction: [f32; 3],
        /// Point, spot: 1 over the distance that it reaches, 0 where it reaches any.
        pub inverse_range: f32,
    }

    /// What a source of light can bring at the most: its lights' bounds in place and direction.
    pub struct LightSource: 64 {
        /// Triangles, points: centre of a sphere around them.
        pub centre: [f32; 3],
        /// Its radius.
        pub radius: f32,
        /// Unit vector that they shine along; 0 where that is to all sides.
        pub axis: [f32; 3],
        /// Cosine of the angle that a triangle's normal or a spot's edge leans from it at the most, or of half the angle that a sun is
        /// seen at.
        pub cos_cone: f32,
        /// Triangles, points: intensity along the normal or axis. Others: irradiance.
        pub strength: f32,
        /// As of its lights, where all have one.
        pub inverse_range: f32,
        /// As of its lights.
        pub kind: u32,
        /// Index of its first light.
        pub first_light: u32,
        /// Lights.
        pub light_count: u32,
        /// Probability that it is chosen without knowing the point.
        pub probability: f32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
    }

    /// A box of starts of photon paths, and a cell of the alias table that chooses one. A start has five coordinates in [0, 1):
    /// place x and y, direction x and y, and which light of its source.
    pub struct EmissionCell: 64 {
        /// Lower corner of the box, but for the last coordinate.
        pub low: [f32; 4],
        /// Its sides.
        pub size: [f32; 4],
        /// Lower end of the last coordinate.
        pub low_light: f32,
        /// That side.
        pub size_light: f32,
        /// The box's volume over its probability.
        pub weight: f32,
        /// Of the table's cell: the part of it that chooses this box.
        pub accept: f32,
        /// Of the table's cell: the box that the rest of it chooses.
        pub alias: u32,
        /// First light of the source.
        pub first_light: u32,
        /// How many it has.
        pub lights: u32,
        /// Index of the sphere that the paths meet first of all, or the number of spheres for those that meet none.
        pub target: u32,
    }

    /// The paper's hitpoint.
    pub struct VisiblePoint: 48 {
        /// xyz: position; w: u32 bits, object or [`NO_OBJECT`].
        pub position_object: [f32; 4],
        /// rgb: throughput × BRDF, 1/sr; w: u32 bits, octahedral geometric normal on the viewer's side, or without an object 1
        /// where the path met a surface.
        pub weight_normal: [f32; 4],
        /// rgb: radiance that the path saw by itself; w: u32 bits, octahedral shading normal on the viewer's side.
        pub emitted_normal: [f32; 4],
    }

    /// How a visible point's surface scatters, where the scene has glossy ones.
    pub struct Gloss: 32 {
        /// rgb: albedo under the reflecting boundary; w: u32 bits, octahedral direction to the viewer.
        pub diffuse_viewer: [f32; 4],
        /// f16s, two to a word: reflectance of the boundary at normal incidence, linear RGB, and at grazing incidence; GGX's α, 0
        /// where the path followed the reflection itself; how much of a coat there is; the largest channel of what lies over
        /// the base at both angles. α's sign: whether the material is coated.
        pub rest: [u32; 4],
    }

    /// Where a photon path starts.
    pub struct PathStart: 48 {
        /// Position.
        pub origin: [f32; 3],
        /// The triangle that it leaves, u32::MAX for none.
        pub triangle: u32,
        /// Unit vector.
        pub direction: [f32; 3],
        /// 1 over the range of a punctual light, 0 where it reaches any distance.
        pub inverse_range: f32,
        /// Not divided by the emitted paths; 0 of a path that isn't to be traced.
        pub flux: [f32; 3],
        /// The light that it leaves.
        pub light: u32,
    }

    /// A photon.
    pub struct Photon: 32 {
        /// xyz: position; w: u32 bits, object and [`CAUSTIC`].
        pub position_object: [f32; 4],
        /// rgb: flux, not divided by the emitted paths, and on coated materials over the cosine to the geometric normal; w: u32
        /// bits, octahedral direction of flight.
        pub flux_direction: [f32; 4],
    }

    /// R², N and τ of a visible point.
    pub struct Statistics: 48 {
        /// R², leading f32.
        pub radius2_high: f32,
        /// R², rest.
        pub radius2_low: f32,
        /// Photons accepted so far, low word; eq. 2's N is α times the whole.
        pub accepted_low: u32,
        /// High word.
        pub accepted_high: u32,
        /// rgb: τ, leading f32s; w: likewise of the curvature, whose share of τ tells the bias.
        pub flux_high: [f32; 4],
        /// rgb: τ, rest.
        pub flux_low: [f32; 4],
    }

    /// An iteration's photons of a visible point.
    pub struct Gathered: 32 {
        /// rgb: Σ flux; w: u32 bits, M.
        pub flux_count: [f32; 4],
        /// Σ flux · distance², flux as the mean of its channels.
        pub moment: f32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
    }

    /// Radiance seen directly, summed over the iterations.
    pub struct DirectSum: 32 {
        /// rgb: leading f32s; w: what lights behind glass would have added unbent.
        pub high: [f32; 4],
        /// rgb: rest; w: iterations that asked for that.
        pub low: [f32; 4],
    }

    /// Of the discs around a visible point, how much can have photons, in sixteenths.
    pub struct Coverage: 16 {
        /// That can.
        pub covered: u32,
        /// In all.
        pub asked: u32,
        /// Iterations in which a ray from a point without photons met something that may send it some.
        pub surrounded: u32,
        /// Camera paths of the slot that met a surface; of the first photon map's alone.
        pub met: u32,
    }

    /// Of a pixel, what tells whether it has its part of the light behind glass.
    pub struct BehindGlass: 20 {
        /// Radiance that it would have of that light if the glass didn't bend it, mean of the channels.
        pub unbent: f32,
        /// Radiance that such photons gave it, likewise.
        pub arrived: f32,
        /// Their number.
        pub photons: f32,
        /// R, in pixels.
        pub radius: f32,
        /// R², render units.
        pub radius2: f32,
    }

    /// Of the radii of discs in a shell around the camera, see `glsl/shared/grid.glsl`.
    pub struct ShellRadii: 16 {
        /// Σ log2 R of a sample of them, offset, in parts of 256.
        pub logs: u32,
        /// Of that sample.
        pub count: u32,
        /// Bits of the largest R² of all.
        pub largest: u32,
        /// Zero.
        pub padding: u32,
    }

    /// The hashed grids of an iteration.
    pub struct GridShape: 64 {
        /// 1 / cell size of each photon map's shells.
        pub inverse_cell_size: [f32; 2 * SHELLS],
    }

    /// A grid of cubes for an object. The scene's.
    pub struct ObjectGrid: 32 {
        /// Corner of the object's bounding box, render units.
        pub low: [f32; 3],
        /// 1 / side of a cube.
        pub inverse_cell: f32,
        /// Cubes along each axis.
        pub cells: [u32; 3],
        /// Cubes of the objects before.
        pub first_cell: u32,
    }

    /// What the stages report to the host.
    pub struct StatusCounters: 56 {
        /// Most photons that one lane had to store.
        pub lane_need: u32,
        /// Most photons of a batch.
        pub batch_need: u32,
        /// Paths ended by the bounce limit.
        pub truncated_paths: u32,
        /// Paths ended by the driver's loop limit.
        pub cut_paths: u32,
        /// Values that were NaN or infinite and were left out.
        pub non_finite: u32,
        /// Why the iteration has to be done again, bits; see [`PHOTONS_DID_NOT_FIT`] and the next two.
        pub again: u32,
        /// Photons stored, low word.
        pub photons_stored_low: u32,
        /// High word.
        pub photons_stored_high: u32,
        /// Photons beyond the maximum that a user set for a grid cell.
        pub lost_photons: u32,
        /// Grid cells that had more than that maximum.
        pub full_cells: u32,
        /// Photons that landed where visible points could be, wanted or not, low word.
        pub photons_landed_low: u32,
        /// High word.
        pub photons_landed_high: u32,
        /// Photons that the picture's visible points accepted in all iterations, low word.
        pub photons_accepted_low: u32,
        /// High word.
        pub photons_accepted_high: u32,
    }
}

/// 64 bits from two words.
fn wide(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

impl Statistics {
    /// Photons accepted so far.
    pub fn accepted(&self) -> u64 {
        wide(self.accepted_low, self.accepted_high)
    }
}

impl StatusCounters {
    /// Photons stored.
    pub fn photons_stored(&self) -> u64 {
        wide(self.photons_stored_low, self.photons_stored_high)
    }

    /// Photons that landed where visible points could be, wanted or not.
    pub fn photons_landed(&self) -> u64 {
        wide(self.photons_landed_low, self.photons_landed_high)
    }

    /// Photons that the picture's visible points accepted in all iterations.
    pub fn photons_accepted(&self) -> u64 {
        wide(self.photons_accepted_low, self.photons_accepted_high)
    }
}
