//! Meshes: from primitives to the triangles of nodes.

pub(crate) mod assembly;
pub(crate) mod attributes;
mod builder;
pub(crate) mod facet;
pub(crate) mod geometry;
pub(crate) mod instancing;
pub(crate) mod mesh_instance;
pub(crate) mod morph;
mod normalisation;
pub(crate) mod primitive;
mod sharing;
pub(crate) mod skin;
pub(crate) mod solid;
mod tangents;
