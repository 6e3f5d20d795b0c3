//! The paper's ladder of gather methods, from testing every photon to clusters with a grid. Its kernels are in `glsl/ladder`.

pub mod photons;
pub mod points;
