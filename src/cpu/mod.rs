//! A plain progressive photon mapper in f64. It is the renderer of `--backend cpu`, the reference of the kernels' tests, and the
//! paper's CPU version (with its k-d tree).
//!
//! `sampling`, `reflector`, `glass`, `bsdf`, `lights`, `emission`, `environment`, `texture`, `intersect`, `interaction`, `gather` and
//! `statistics` (equations 2 to 4) are pure functions. Tests compare the kernels' functions with them through probes. `camera`,
//! `photons`, `direct` and `renderer` make the algorithm of them. It converges to the kernels' picture, without their
//! optimisations: learned emission tables, demand, separate estimates of reflections on glass, and a map for caustics.
//!
//! The result does not depend on the number of threads: no sum depends on an order.

mod bsdf;
mod camera;
mod coverage;
mod direct;
mod dispersion;
mod emission;
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
pub use emission::{Emission, choose_by_power, sample_emission};
pub use environment::{Environment, EnvironmentSample};
pub use gather::{DeviceReceivers, Gathered, Receiver, Receivers, gather_kd_tree, gather_naive};
pub use glass::{DielectricSample, DielectricSamples, Glass};
pub use intersect::{Hit, PlacedTriangle, Ray, nearest_hit};
pub use lights::{LightSample, punctual, sample_incident};
pub use reflector::Reflector;
pub use renderer::Renderer;
pub use sampling::{cosine_direction, decode_direction, encode_direction};
pub use statistics::Statistics;
pub use surface::{Normals, Surface, offset_origin, surface_at};
pub use texture::{apply_textures, opacity};

use crate::config::RenderConfig;
use crate::layout::Settings;
use crate::packing::PackedScene;

/// The end of unbounded rays. Scenes are 2 units long.
const FAR: f64 = 1e30;

/// What tracing functions read.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// Triangles, materials, lights.
    pub scene: &'a PackedScene,
    /// The camera.
    pub settings: &'a Settings,
    /// The render's configuration.
    pub config: &'a RenderConfig,
}
