//! The stages on the CPU: the oracle of the kernel tests, what `--backend cpu` renders with, and the paper's CPU
//! column.
//!
//! Each stage of `glsl/stages` has a plain function of its name here, which reads and writes the same structs of
//! [`crate::layout`] and draws the same random numbers. Where it decides, it works in f64 and rounds to f32 what it
//! stores: intersections, directions, Fresnel, sums, statistics. So it is an oracle and no copy of the kernels; for the
//! same reason gathering is left to a kd-tree here, and to no grid.
//!
//! Every function gives the same bits whatever the number of threads: paths are dealt to lanes, not to threads, and no
//! sum depends on an order.

mod boundary;
mod camera;
mod contact;
mod coverage;
mod demand;
mod direct;
mod dispersion;
mod emission;
mod environment;
mod gather;
mod glint;
mod gloss;
mod intersect;
mod light;
mod light_sources;
mod media;
mod photons;
mod primitives;
mod renderer;
mod resolve;
mod sampling;
mod surface;
mod texture;
mod tiles;
mod update;
mod vector;

use std::sync::atomic::{AtomicU64, Ordering};

pub use crate::random::{CameraTurn, PathKind, Random, pcg4d};
pub use camera::{Seen, SeenSlice, camera};
pub use coverage::coverage;
pub use demand::{Demand, Progress, demand, grid_shape, shell_radii};
pub use direct::direct;
pub use gather::{gather_kd_tree, gather_naive};
pub use gloss::Reflector;
pub use intersect::{Hit, PlacedTriangle, Ray, is_blocked, nearest_hit};
pub use photons::{Batch, Traced, compact, photons};
pub use primitives::{scan, sort};
pub use renderer::Renderer;
pub use resolve::{count_met, resolve, resolve_sequences};
pub use sampling::{decode_direction, encode_direction};
pub use tiles::pixel_of;
pub use update::{GatheredWith, fit_radius, radii, reset, update};

use crate::config::RenderConfig;
use crate::emission::Table;
use crate::layout::Settings;
use crate::packing::PackedScene;

/// A ray's limit where it has none; nothing lies so far, for the scene is 2 long.
const FAR: f64 = 1e30;

/// What the ray stages read.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// Triangles, materials, lights.
    pub scene: &'a PackedScene,
    /// What the kernels read as well.
    pub settings: &'a Settings,
    /// What the kernels are specialised for.
    pub config: &'a RenderConfig,
    /// What visible points want of photons; none where all are kept.
    pub demand: Option<&'a Demand>,
    /// Where photon paths are aimed; without it they start in proportion to the lights' power.
    pub emission: Option<&'a Table>,
}

/// What the stages count, as [`crate::layout::StatusCounters`] on a device.
#[derive(Debug, Default)]
pub struct Counts {
    truncated_paths: AtomicU64,
    non_finite: AtomicU64,
    landed: AtomicU64,
}

impl Counts {
    /// Paths that the bounce limit ended.
    pub fn truncated_paths(&self) -> u64 {
        self.truncated_paths.load(Ordering::Relaxed)
    }

    /// Values that were NaN or infinite and were left out.
    pub fn non_finite(&self) -> u64 {
        self.non_finite.load(Ordering::Relaxed)
    }

    /// Photons that landed where visible points could be, wanted or not.
    pub fn landed(&self) -> u64 {
        self.landed.load(Ordering::Relaxed)
    }

    fn add_landed(&self, photons: u64) {
        self.landed.fetch_add(photons, Ordering::Relaxed);
    }

    fn add_truncated(&self, paths: u64) {
        self.truncated_paths.fetch_add(paths, Ordering::Relaxed);
    }

    fn add_non_finite(&self, values: u64) {
        self.non_finite.fetch_add(values, Ordering::Relaxed);
    }
}
