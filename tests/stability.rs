//! Hard cases: extreme scenes, settings and numbers, each with a measure that shows that the picture is correct. docs/accuracy.md
//! lists them, and the results without the measure against each.
//!
//! Every picture and buffer of every case is searched for NaN, infinity and negative values (`sound`).

// Each test program uses a part of the shared module.
#[allow(dead_code)]
#[path = "kernels/bench.rs"]
mod bench;
#[allow(dead_code)]
#[path = "scene/fixture.rs"]
mod fixture;

#[path = "stability/capacity.rs"]
mod capacity;
#[path = "stability/coincidence.rs"]
mod coincidence;
#[path = "stability/geometry.rs"]
mod geometry;
#[path = "stability/glass.rs"]
mod glass;
#[path = "stability/immersion.rs"]
mod immersion;
#[path = "stability/lights.rs"]
mod lights;
#[path = "stability/model.rs"]
mod model;
#[path = "stability/nesting.rs"]
mod nesting;
#[path = "stability/places.rs"]
mod places;
#[path = "stability/scales.rs"]
mod scales;
#[path = "stability/sound.rs"]
mod sound;
#[path = "stability/sums.rs"]
mod sums;
#[path = "stability/uniform.rs"]
mod uniform;
