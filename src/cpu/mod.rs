//! A plain progressive photon mapper in f64: what `--backend cpu` renders with, the oracle of the kernels' tests, and the
//! paper's CPU column (its kd-tree).
//!
//! Each module is a part of the physics: `sampling`, `reflector`, `glass` and `bsdf`, `lights` and `environment`, `texture`,
//! `intersect` and `interaction`, `gather`, `statistics` (equations 2 to 4). They are pure functions, which kernels are compared
//! with one by one through probes; `camera`, `photons`, `direct` and `renderer` are the algorithm, made of them. It converges to the
//! kernels' picture, but repeats neither their steps nor what they do to be quick: emission by learned tables, demand, glass
//! whose reflections are looked at apart, a map for caustics.
//!
//! Every function gives the same bits whatever the number of threads: no sum depends on an order.

mod bsdf;
mod camera;
mod coverage;
mod direct;
mod dispersion;
mod environment;
mod gather;
mod glass;
mod interaction;
mod intersect;
mod lights;
mod media;
mod photons;
mod reflector;
mod renderer;
mod sampling;
mod slots;
mod statistics;
mod surface;
mod texture;
mod vector;

pub use bsdf::{Branch, Bsdf, Width};
pub use camera::{CameraPath, VisiblePoint};
pub use coverage::{Place, can_have_photons, is_surrounded};
pub use dispersion::ior_at;
pub use environment::{Environment, Sky};
pub use gather::{Gathered, Receiver, Receivers, SeenByKernels, gather_kd_tree, gather_naive};
pub use glass::{Glass, Turn, Turns};
pub use intersect::{Hit, PlacedTriangle, Ray, nearest_hit};
pub use lights::{Emission, LightSample, choose_by_power, punctual, sample_emission, sample_incident};
pub use reflector::Reflector;
pub use renderer::Renderer;
pub use sampling::{cosine_direction, decode_direction, encode_direction};
pub use statistics::Statistics;
pub use surface::{Normals, Surface, offset_origin, surface_at};
pub use texture::{apply_textures, share_there};

use crate::config::RenderConfig;
use crate::layout::Settings;
use crate::packing::PackedScene;

/// A ray's limit where it has none; nothing lies so far, for the scene is 2 long.
const FAR: f64 = 1e30;

/// What rays read.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// Triangles, materials, lights.
    pub scene: &'a PackedScene,
    /// The camera.
    pub settings: &'a Settings,
    /// How it is rendered.
    pub config: &'a RenderConfig,
}
