//! Accessors as vectors of numbers or as indices, in the formats that glTF allows for each use.

use gltf_json::accessor::ComponentType::{F32, I8, I16, U8, U16, U32};
use gltf_json::accessor::Type;
use gltf_json::{Accessor, Index};

use super::document::Document;
use super::elements::{Elements, Format, unsigned};
use crate::loader::diagnostic::Check;

/// The formats allowed for a use.
pub(crate) struct Formats {
    /// Formats of core glTF (2.0, section 3.7.2.1).
    core: &'static [Format],
    /// Additional formats in a file that uses `KHR_mesh_quantization`.
    quantized: &'static [Format],
}

/// Only floats.
const FLOAT: &[Format] = &[Format::plain(F32)];
/// Floats and fractions of unsigned integers.
const UNSIGNED_FRACTIONS: &[Format] = &[Format::plain(F32), Format::normalized(U8), Format::normalized(U16)];
const SIGNED_FRACTIONS: &[Format] = &[Format::normalized(I8), Format::normalized(I16)];

/// Uses that allow only floats: keyframe times, translations, scales, matrices.
pub(crate) const FLOATS: Formats = Formats {
    core: FLOAT,
    quantized: &[],
};
/// POSITION.
pub(crate) const POSITIONS: Formats = Formats {
    core: FLOAT,
    quantized: &[
        Format::plain(I8),
        Format::normalized(I8),
        Format::plain(U8),
        Format::normalized(U8),
        Format::plain(I16),
        Format::normalized(I16),
        Format::plain(U16),
        Format::normalized(U16),
    ],
};
/// NORMAL and TANGENT, of morph targets as well.
pub(crate) const DIRECTIONS: Formats = Formats {
    core: FLOAT,
    quantized: SIGNED_FRACTIONS,
};
/// TEXCOORD_n.
pub(crate) const TEXCOORDS: Formats = Formats {
    core: UNSIGNED_FRACTIONS,
    quantized: &[
        Format::plain(I8),
        Format::normalized(I8),
        Format::plain(U8),
        Format::plain(I16),
        Format::normalized(I16),
        Format::plain(U16),
    ],
};
/// COLOR_n and WEIGHTS_n.
pub(crate) const FRACTIONS: Formats = Formats {
    core: UNSIGNED_FRACTIONS,
    quantized: &[],
};

/// Rotations of instances of a node.
pub(crate) const INSTANCE_ROTATIONS: Formats = Formats {
    core: &[Format::plain(F32), Format::normalized(I8), Format::normalized(I16)],
    quantized: &[],
};

/// Rotations and weights of animations.
pub(crate) const ANIMATED_FRACTIONS: Formats = Formats {
    core: &[
        Format::plain(F32),
        Format::normalized(I8),
        Format::normalized(U8),
        Format::normalized(I16),
        Format::normalized(U16),
    ],
    quantized: &[],
};

/// Vectors of `N` numbers, widened to f64.
#[derive(Clone, Copy)]
pub(crate) struct Vectors<'a, const N: usize>(Elements<'a>);

impl<'a, const N: usize> Vectors<'a, N> {
    /// Opens an accessor of vectors of `N` components.
    pub(crate) fn open(document: &'a Document, index: Index<Accessor>, formats: &Formats) -> Check<Self> {
        let shape = match N {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            4 => Type::Vec4,
            _ => Type::Mat4,
        };
        Self::open_any(document, index, &[shape], formats)
    }

    fn open_any(document: &'a Document, index: Index<Accessor>, shapes: &[Type], formats: &Formats) -> Check<Self> {
        let quantized = if document.is_quantized { formats.quantized } else { &[] };
        let formats = [formats.core, quantized].concat();
        Ok(Self(Elements::open(document, index, shapes, &formats)?))
    }

    /// Number of vectors.
    pub(crate) fn len(&self) -> usize {
        self.0.count
    }

    /// The vector at `index`, which is less than `len`. It may hold NaN or infinity.
    pub(crate) fn get(&self, index: usize) -> [f64; N] {
        // A missing alpha is 1; no other use has fewer components than N.
        let mut vector = [1.0; N];
        let width = self.0.width.min(N);
        match self.0.get(index) {
            None => vector[..width].fill(0.0),
            Some(bytes) => {
                let components = bytes.chunks_exact(self.0.format.component.size());
                for (value, bytes) in vector.iter_mut().zip(components) {
                    *value = number(bytes, self.0.format);
                }
            }
        }
        vector
    }

    /// The same, or `None` if a component isn't finite.
    pub(crate) fn finite(&self, index: usize) -> Option<[f64; N]> {
        let vector = self.get(index);
        vector.iter().all(|component| component.is_finite()).then_some(vector)
    }
}

impl<'a> Vectors<'a, 4> {
    /// Opens an accessor of RGB or RGBA colours, which become RGBA with an alpha of 1.
    pub(crate) fn open_colors(document: &'a Document, index: Index<Accessor>) -> Check<Self> {
        Self::open_any(document, index, &[Type::Vec3, Type::Vec4], &FRACTIONS)
    }
}

/// A component as a number; fractions as defined in glTF 2.0, section 3.6.2.2.
fn number(
    bytes: &[u8],
    Format {
        component,
        is_normalized,
    }: Format,
) -> f64 {
    let bits = unsigned(bytes);
    let (value, largest) = match component {
        I8 => (f64::from(bits as u8 as i8), f64::from(i8::MAX)),
        U8 => (f64::from(bits), f64::from(u8::MAX)),
        I16 => (f64::from(bits as u16 as i16), f64::from(i16::MAX)),
        U16 => (f64::from(bits), f64::from(u16::MAX)),
        U32 => (f64::from(bits), f64::from(u32::MAX)),
        F32 => return f64::from(f32::from_bits(bits)),
    };
    if is_normalized {
        (value / largest).max(-1.0)
    } else {
        value
    }
}

/// Unsigned integers: vertex indices or, four at a time, joints.
#[derive(Clone, Copy)]
pub(crate) struct Integers<'a, const N: usize>(Elements<'a>);

impl<'a> Integers<'a, 1> {
    /// Opens an accessor of vertex indices.
    pub(crate) fn open_indices(document: &'a Document, index: Index<Accessor>) -> Check<Self> {
        let formats = [U8, U16, U32].map(Format::plain);
        Ok(Self(Elements::open(document, index, &[Type::Scalar], &formats)?))
    }
}

impl<'a> Integers<'a, 4> {
    /// Opens an accessor of joints.
    pub(crate) fn open_joints(document: &'a Document, index: Index<Accessor>) -> Check<Self> {
        let formats = [U8, U16].map(Format::plain);
        Ok(Self(Elements::open(document, index, &[Type::Vec4], &formats)?))
    }
}

impl<const N: usize> Integers<'_, N> {
    /// Number of elements.
    pub(crate) fn len(&self) -> usize {
        self.0.count
    }

    /// The element at `index`, which is less than `len`.
    pub(crate) fn get(&self, index: usize) -> [u32; N] {
        let mut element = [0; N];
        if let Some(bytes) = self.0.get(index) {
            let components = bytes.chunks_exact(self.0.format.component.size());
            for (value, bytes) in element.iter_mut().zip(components) {
                *value = unsigned(bytes);
            }
        }
        element
    }
}
