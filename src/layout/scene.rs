//! What kernels have of a scene.

use bytemuck::{Pod, Zeroable};

#[allow(unused_imports, reason = "most are linked by the documentation alone")]
use super::constants::*;
use super::shape::{FieldLayout, Layout, Shared};

device_structs! {
    /// A record of the BVH: a [`BvhNode`], a [`BvhTriangle`], or one of the two [`BvhInstance`]s of an instance. Records refer to
    /// each other by index. A reference with [`LEAF`] set is to the first record of a leaf, whose others follow it; an instance is
    /// a leaf of its own.
    pub struct BvhRecord: 64 {
        /// Bits of whichever it is.
        pub t0: [u32; 4],
        /// More bits.
        pub t1: [u32; 4],
        /// More bits.
        pub t2: [u32; 4],
        /// More bits.
        pub t3: [u32; 4],
    }

    /// An inner node with the boxes of both children.
    pub struct BvhNode: 64 {
        /// Lower corner of the left box.
        pub left_low: [f32; 3],
        /// Reference to the left child.
        pub left: u32,
        /// Upper corner.
        pub left_high: [f32; 3],
        /// Zero.
        pub padding0: u32,
        /// Lower corner of the right box.
        pub right_low: [f32; 3],
        /// Reference to the right child.
        pub right: u32,
        /// Upper corner.
        pub right_high: [f32; 3],
        /// Zero.
        pub padding1: u32,
    }

    /// A triangle of a leaf.
    pub struct BvhTriangle: 64 {
        /// First corner.
        pub p0: [f32; 3],
        /// Zero.
        pub padding0: u32,
        /// Second corner.
        pub p1: [f32; 3],
        /// Zero.
        pub padding1: u32,
        /// Third corner.
        pub p2: [f32; 3],
        /// Zero.
        pub padding2: u32,
        /// Index of the triangle.
        pub index: u32,
        /// 1 for a leaf's last triangle, else 0.
        pub last: u32,
        /// Zero: see [`BvhInstance::kind`].
        pub kind: u32,
        /// Zero.
        pub padding3: u32,
    }

    /// An instance: a record of its placement, then a record for rays that enter it.
    pub struct BvhInstance: 64 {
        /// Rows of the map to render space, or of its inverse.
        pub rows: [[f32; 4]; 3],
        /// Index of the instance, or root of its hierarchy.
        pub index: u32,
        /// Zero: see [`BvhTriangle::last`].
        pub last: u32,
        /// [`PLACEMENT_RECORD`] or [`RAY_RECORD`].
        pub kind: u32,
        /// Of the latter: widening of the hierarchy's boxes.
        pub widening: f32,
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
        /// Position of the first corner.
        pub p0: [f32; 3],
        /// Octahedral shading normal there.
        pub n0: u32,
        /// Of the second corner.
        pub p1: [f32; 3],
        /// Of the second corner.
        pub n1: u32,
        /// Of the third corner.
        pub p2: [f32; 3],
        /// Of the third corner.
        pub n2: u32,
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
}

/// Conversions between [`BvhRecord`] and what it holds.
macro_rules! bvh_records {
    ($($struct:ident $get:ident,)*) => {
        $(impl From<$struct> for BvhRecord {
            fn from(record: $struct) -> Self {
                bytemuck::cast(record)
            }
        })*
        impl BvhRecord {
            $(/// As this struct; which one it is tells the reference to it.
            pub fn $get(self) -> $struct {
                bytemuck::cast(self)
            })*
        }
    };
}

bvh_records! {
    BvhNode node,
    BvhTriangle triangle,
    BvhInstance instance,
}
