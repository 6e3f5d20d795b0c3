//! Structs of a scene.

use bytemuck::{Pod, Zeroable};

#[allow(unused_imports, reason = "most are linked by the documentation alone")]
use super::constants::*;
use super::shape::{FieldLayout, Layout, Shared};

device_structs! {
    /// A record of the BVH: a [`BvhNode`], a [`BvhTriangle`], or one of the two [`BvhInstance`]s of an instance. References are
    /// indices of records. With [`LEAF`] set, a reference is to the first record of a leaf, whose other records follow it. An
    /// instance is a separate leaf.
    pub struct BvhRecord: 64 {
        /// Bits of one of these structs.
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

    /// An instance in the BVH: a record of its transform, then a record of the transform of rays.
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

    /// A placement of shared triangles.
    pub struct Instance: 64 {
        /// Rows of the map to render space.
        pub rows: [[f32; 4]; 3],
        /// Index of its object.
        pub object: u32,
        /// [`MIRRORED`], and the rank from bit [`RANK`] on.
        pub flags: u32,
        /// Index of its first triangle.
        pub first_triangle: u32,
        /// Number of triangles.
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

    /// A triangle for shading.
    pub struct ShadingTriangle: 64 {
        /// Position of the first corner.
        pub p0: [f32; 3],
        /// Octahedral shading normal at the first corner.
        pub n0: u32,
        /// Position of the second corner.
        pub p1: [f32; 3],
        /// Octahedral shading normal at the second corner.
        pub n1: u32,
        /// Position of the third corner.
        pub p2: [f32; 3],
        /// Octahedral shading normal at the third corner.
        pub n2: u32,
        /// Index of its object; unused for shared triangles.
        pub object: u32,
        /// Index of its material.
        pub material: u32,
        /// [`SMOOTH_SHADED`], [`TOUCHED`], [`TEXTURED_TRIANGLE`], [`SEE_THROUGH`], [`COINCIDENT`], [`BACKED`], and the rank from
        /// bit [`RANK`] on, which is unused for shared triangles.
        pub flags: u32,
        /// Index of its first light, one for each part, or [`NO_LIGHT`].
        pub light: u32,
    }

    /// Texture coordinates, colour and tangent of a triangle's corner.
    pub struct Corner: 32 {
        /// Coordinates of the first set.
        pub first: [f32; 2],
        /// Of the second set.
        pub second: [f32; 2],
        /// Factor of the base colour, linear RGBA, f16s.
        pub color: [u32; 2],
        /// Octahedral tangent.
        pub tangent: u32,
        /// Sign of the bitangent: 1 or −1, 0 without a tangent.
        pub bitangent: f32,
    }

    /// A texture lookup. Coordinates row · (u, v, 1) are in widths and heights of the image.
    pub struct TextureLookup: 48 {
        /// Row of the coordinate along the image's width.
        pub row_u: [f32; 3],
        /// Index of the image's first texel (top left): RGBA, a byte each.
        pub first_texel: u32,
        /// Row of the coordinate along the image's height.
        pub row_v: [f32; 3],
        /// Width, and height in the upper half.
        pub size: u32,
        /// [`SECOND_SET`], [`SRGB`], [`NEAREST`], and the wrap modes at [`WRAP_U`] and [`WRAP_V`].
        pub flags: u32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
    }

    /// A light, and a cell of the alias table that chooses one. Fields that its kind does not use are zero.
    pub struct Light: 80 {
        /// Triangle: its index.
        pub triangle: u32,
        /// Its probability, nearly in proportion to its flux.
        pub probability: f32,
        /// Area of the triangle or its part, or of the disc from which a distant light's photons start. Spot: 1 where the
        /// falloff is a smoothstep, 0 where it is the square of a ramp.
        pub area: f32,
        /// [`TRIANGLE_LIGHT`], [`POINT_LIGHT`], [`SPOT_LIGHT`], [`DIRECTIONAL_LIGHT`] or [`ENVIRONMENT_LIGHT`].
        pub kind: u32,
        /// Alias table: the fraction of the cell that chooses this light.
        pub accept: f32,
        /// Alias table: the light that the rest of the cell chooses.
        pub alias: u32,
        /// Cumulative probability of this light among the lights of its source ([`EmissionCell`]), a multiple of 2⁻²⁴.
        pub cumulative: f32,
        /// Point, spot: radius of a disc that faces the illuminated point, render units. Directional: 1 − cos of the angle
        /// between the centre and the edge of the visible disc. 0: no extent.
        pub extent: f32,
        /// Point, spot: radiant intensity along the axis. Directional: irradiance across the rays. Linear RGB.
        pub intensity: [f32; 3],
        /// Spot: 1 − cos of the angle where the falloff begins.
        pub inner: f32,
        /// Point, spot: position. Directional: centre of the disc. Triangle: the part, which is a separate light: column, row,
        /// and number of columns; 0, 0, 1 for the whole triangle. Parts are stored row by row.
        pub position: [f32; 3],
        /// Spot: 1 − cos of the angle where the falloff ends.
        pub outer: f32,
        /// Spot, directional: unit vector of the direction of emission.
        pub direction: [f32; 3],
        /// Point, spot: 1 over the range; 0 without a range.
        pub inverse_range: f32,
    }

    /// Bounds of a light source in position and direction, which bound its contribution to a point.
    pub struct LightSource: 64 {
        /// Triangles, points: centre of a bounding sphere.
        pub centre: [f32; 3],
        /// Its radius.
        pub radius: f32,
        /// Unit vector of the main direction of emission; 0 if it emits in all directions.
        pub axis: [f32; 3],
        /// Cosine of the maximum angle between that axis and a triangle's normal or a spot's edge, or of the angular radius of a
        /// sun.
        pub cos_cone: f32,
        /// Triangles, points: intensity along the normal or axis. Others: irradiance.
        pub strength: f32,
        /// That of its lights, if all have one.
        pub inverse_range: f32,
        /// Kind of its lights.
        pub kind: u32,
        /// Index of its first light.
        pub first_light: u32,
        /// Number of lights.
        pub light_count: u32,
        /// Probability of choosing it independently of the point.
        pub probability: f32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
    }

    /// A box of starts of photon paths, and a cell of the alias table that chooses one. A start has five coordinates in [0, 1):
    /// position x and y, direction x and y, and the choice of a light of its source.
    pub struct EmissionCell: 64 {
        /// Lower corner of the box, without the last coordinate.
        pub low: [f32; 4],
        /// Size of the box, without the last coordinate.
        pub size: [f32; 4],
        /// Lower end of the last coordinate.
        pub low_light: f32,
        /// Size along the last coordinate.
        pub size_light: f32,
        /// The box's volume over its probability.
        pub weight: f32,
        /// Alias table: the fraction of the cell that chooses this box.
        pub accept: f32,
        /// Alias table: the box that the rest of the cell chooses.
        pub alias: u32,
        /// First light of the source.
        pub first_light: u32,
        /// Number of lights.
        pub lights: u32,
        /// Index of the target sphere that the paths hit first, or the number of spheres for paths that hit none.
        pub target: u32,
    }

    /// An object's grid of cubes.
    pub struct ObjectGrid: 32 {
        /// Corner of the object's bounding box, render units.
        pub low: [f32; 3],
        /// 1 / side of a cube.
        pub inverse_cell: f32,
        /// Cubes along each axis.
        pub cells: [u32; 3],
        /// Number of cubes of all previous objects.
        pub first_cell: u32,
    }
}

/// Conversions between [`BvhRecord`] and the structs that it contains.
macro_rules! bvh_records {
    ($($struct:ident $get:ident,)*) => {
        $(impl From<$struct> for BvhRecord {
            fn from(record: $struct) -> Self {
                bytemuck::cast(record)
            }
        })*
        impl BvhRecord {
            $(/// As this struct, if the reference is to one.
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
