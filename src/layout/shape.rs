//! How structs and their fields are laid out, and what types fields can have, as kernels see them.

/// What a number is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// `uint`.
    Uint,
    /// `float`.
    Float,
}

/// Numbers of one kind: one, or rows of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Of each.
    pub scalar: Scalar,
    /// Numbers in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
}

impl Shape {
    /// Bytes.
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

/// A type that a field can have.
pub trait Shared {
    /// What kernels see of it.
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
