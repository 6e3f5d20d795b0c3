//! How much a file may show.

/// The most triangles that a scene may have. A few hundred bytes of instances of instances could ask for any number.
pub(crate) const MAX_TRIANGLES: usize = 1 << 25;

/// The most primitives of all nodes together.
pub(crate) const MAX_OBJECTS: usize = 1 << 20;
