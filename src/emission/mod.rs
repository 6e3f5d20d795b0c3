//! Where photon paths start, learned from what earlier ones were worth.
//!
//! A path belongs to the first of the *targets* (spheres, smaller ones first) that it meets from its light on, or
//! to none. The paths of a source that belong to one target are a *stratum*, and what chooses a path rejects it
//! where it belongs to another one: so each path can be chosen in one way alone, and its flux needs no other's density. A
//! stratum's starts have five coordinates; boxes of them, *cells*, have a probability each ([`Aim`]), which is never so small
//! that a photon carries many times what it would have carried by power.

mod learning;
mod path_value;
mod strata;
mod table;
mod targets;

pub use learning::{Aim, counted_paths, is_learned_from};
pub use path_value::PathValue;
pub use table::{DIMENSIONS, Table, light_of};
