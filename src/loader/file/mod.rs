//! The parts of a file: JSON, buffers, accessors and images, checked as they are read, within a memory limit.

pub(crate) mod accessor;
pub(crate) mod breaches;
pub(crate) mod budget;
pub(crate) mod buffer;
pub(crate) mod document;
pub(crate) mod draco;
pub(crate) mod elements;
pub(crate) mod glb;
pub(crate) mod image;
pub(crate) mod json;
pub(crate) mod ktx2;
pub(crate) mod meshopt;
mod raster;
