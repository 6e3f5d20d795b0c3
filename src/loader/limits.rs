//! Limits of a file's content.

/// Maximum number of triangles of a scene. A few hundred bytes of nested instances could request any number.
pub(crate) const MAX_TRIANGLES: usize = 1 << 25;

/// Maximum number of primitives of all nodes together.
pub(crate) const MAX_OBJECTS: usize = 1 << 20;
