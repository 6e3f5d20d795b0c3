//! Memory layout of structs and types of fields, in GLSL.

/// Scalar types.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// `uint`.
    Uint,
    /// `float`.
    Float,
}

/// A number, a vector, or rows of vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Type of the numbers.
    pub scalar: Scalar,
    /// Numbers in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
}

impl Shape {
    /// Size in bytes.
    pub const fn size(self) -> usize {
        4 * self.columns * self.rows
    }

    const fn many(self, count: usize) -> Self {
        assert!(self.rows == 1, "an array of arrays of arrays has no type in GLSL");
        if self.columns == 1 {
            Self { columns: count, ..self }
        } else {
            Self { rows: count, ..self }
        }
    }
}

/// A type of fields.
pub trait Shared {
    /// Its shape in GLSL.
    const SHAPE: Shape;
}

impl Shared for u32 {
    const SHAPE: Shape = Shape {
        scalar: Scalar::Uint,
        columns: 1,
        rows: 1,
    };
}

impl Shared for f32 {
    const SHAPE: Shape = Shape {
        scalar: Scalar::Float,
        columns: 1,
        rows: 1,
    };
}

impl<T: Shared, const N: usize> Shared for [T; N] {
    const SHAPE: Shape = T::SHAPE.many(N);
}

/// A field of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldLayout {
    /// Its name.
    pub name: &'static str,
    /// Offset in bytes.
    pub offset: usize,
    /// Its type.
    pub shape: Shape,
}

/// A struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Its name.
    pub name: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// In the order of their offsets.
    pub fields: &'static [FieldLayout],
}
