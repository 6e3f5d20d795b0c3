//! Emission: sampling tables of photon paths, learned from the values of earlier paths.
//!
//! A path belongs to the first *target* (spheres in order, smaller ones first) that its first segment hits, or to none. The paths
//! of a source that belong to one target are a *stratum*. A path that was sampled for another stratum is rejected, so each path
//! can be sampled in one way only, and its flux needs no other density. The starts of a stratum have five coordinates; boxes of
//! them, *cells*, have a probability each ([`Aim`]), with a lower bound, so that no photon carries many times the flux of a
//! photon by power.

mod learning;
mod motion;
mod path_value;
mod strata;
mod table;
mod targets;

pub use learning::{Aim, counted_paths, is_learned_from};
pub use motion::aims_alike;
pub use path_value::PathValue;
pub use table::{DIMENSIONS, Table, light_of};
