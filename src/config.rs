//! Settings of a render.

mod choice;
mod filter;
mod layers;
mod part;
pub mod ranges;
mod region;
mod tiles;

pub use choice::Choice;
pub(crate) use choice::choices;
pub use filter::PixelFilter;
pub use layers::{Layer, Layers};
pub use part::Part;
pub use region::{GuidePixels, Region};
pub use tiles::pixel_of;

use std::fmt::Display;

use ranges::Checked;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, Setting};
pub use crate::layout::SEQUENCES;
use crate::layout::{BEHIND_GLASS_EVERY, CONGRUENTIAL, COVERAGE_WHOLE, INDEPENDENT, SOBOL};

choices! {
    /// Which visible points an iteration uses.
    pub enum Estimator {
        /// Stochastic progressive photon mapping: new visible points each iteration, statistics shared by the pixel.
        Sppm => "sppm",
        /// Progressive photon mapping as in the paper: visible points found once.
        Ppm => "ppm",
    }
}

choices! {
    /// Where direct light comes from.
    pub enum Direct {
        /// A shadow ray to a point of a light.
        Light => "light",
        /// Photons, as in the paper.
        Photons => "photons",
    }
}

choices! {
    /// How rays meet triangles.
    pub enum Accel {
        /// `ray-query` on a GPU that has it, `bvh` elsewhere.
        Auto => "auto",
        /// A bounding volume hierarchy.
        Bvh => "bvh",
        /// The device's own ray tracing (VK_KHR_ray_query).
        RayQuery => "ray-query",
        /// Every triangle, as in the paper.
        Brute => "brute",
    }
}

choices! {
    /// How a ray is tested against a triangle.
    pub enum TriangleTest {
        /// From the triangle's corners: no ray passes between triangles that share an edge or a corner (Woop and others).
        Watertight => "watertight",
        /// From precomputed planes, as in the paper (Havel and Herout): some rays pass between neighbours.
        Havel => "havel",
    }
}

choices! {
    /// How photon paths start.
    pub enum EmissionChoice {
        /// Where photons that the picture needs were found to start.
        Aimed => "aimed",
        /// In proportion to the lights' power, as in the paper.
        Power => "power",
    }
}

impl EmissionChoice {
    /// The default of an estimator.
    pub const fn of(estimator: Estimator) -> Self {
        match estimator {
            Estimator::Sppm => Self::Aimed,
            Estimator::Ppm => Self::Power,
        }
    }
}

choices! {
    /// Where the numbers of paths come from.
    #[repr(u32)]
    pub enum Sampler {
        /// Scrambled Sobol' sequences: samples with low discrepancy, over an iteration's photons and over a pixel's iterations.
        Sobol = SOBOL => "sobol",
        /// Independent numbers, from a hash.
        Independent = INDEPENDENT => "independent",
        /// A congruential generator for each path, as in the paper; neighbouring paths are correlated: only for comparison.
        Congruential = CONGRUENTIAL => "congruential",
    }
}

impl Sampler {
    /// The default of an estimator: the paper's has independent numbers.
    pub const fn of(estimator: Estimator) -> Self {
        match estimator {
            Estimator::Sppm => Self::Sobol,
            Estimator::Ppm => Self::Independent,
        }
    }
}

/// A render's settings.
#[derive(Debug, Clone)]
pub struct RenderConfig {
    /// Pixels of the whole picture, width and height.
    pub resolution: [u32; 2],
    /// The part of it that is rendered, with the same bits as in the whole; all of it if `None`.
    pub crop: Option<Region>,
    /// Photon paths emitted in an iteration.
    pub photons: u32,
    /// Which visible points an iteration uses.
    pub estimator: Estimator,
    /// Where direct light comes from.
    pub direct: Direct,
    /// Eq. 2's α, between 0 and 1.
    pub alpha: f32,
    /// Initial radius in scene units; automatic if `None`.
    pub radius: Option<f64>,
    /// Index into [`crate::gather::METHODS`]; the fastest one if `None`.
    pub gather: Option<usize>,
    /// Maximum number of photons in a cell of the method `cluster-grid`; photons beyond it are lost. Unlimited if `None`.
    pub cell_photons: Option<u32>,
    /// How rays meet triangles.
    pub accel: Accel,
    /// How a ray is tested against a triangle.
    pub triangle_test: TriangleTest,
    /// Maximum number of bounces of a path.
    pub max_depth: u32,
    /// Whether photons that no visible point can accept are dropped where they land, by the estimator `sppm`.
    pub drop_unwanted: bool,
    /// How photon paths start.
    pub emission: EmissionChoice,
    /// Whether paths are aimed even if pilots find that it does not pay for its cost.
    pub aims_anyway: bool,
    /// Where the numbers of paths come from.
    pub sampler: Sampler,
    /// Seed of all random numbers.
    pub seed: u32,
    /// How a pixel weighs the film around its centre, by the estimator `sppm`; `ppm` has the centre alone.
    pub filter: PixelFilter,
    /// What the picture's file has beside the colours.
    pub layers: Layers,
    /// Which of several independent parts it renders.
    pub part: Part,
}

impl Default for RenderConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Maximum number of pixels of a picture's side.
pub const MAX_SIDE: u32 = 16384;

/// Number of the first `iterations` iterations that belong to a sequence.
pub fn iterations_of(sequence: u32, iterations: u32) -> u32 {
    iterations / SEQUENCES + u32::from(sequence < iterations % SEQUENCES)
}

/// The iterations of each of [`SEQUENCES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SequenceIterations(pub [u32; SEQUENCES as usize]);

impl From<u32> for SequenceIterations {
    /// Those of a render of this number of iterations.
    fn from(iterations: u32) -> Self {
        Self(std::array::from_fn(|sequence| {
            iterations_of(sequence as u32, iterations)
        }))
    }
}

impl SequenceIterations {
    /// Of all sequences.
    pub fn total(self) -> f64 {
        self.0.into_iter().map(f64::from).sum()
    }
}

/// Maximum number of camera paths of a pixel in an iteration: that many are cheap compared with the photon paths.
const MOST_CAMERA_PATHS: u32 = 8;

fn in_range<T>(setting: Setting, value: impl Display, checked: Checked<T>) -> Result<()> {
    match checked {
        Ok(_) => Ok(()),
        Err(wrong) => Err(Error::setting(setting, format!("{value}: {wrong}"))),
    }
}

impl RenderConfig {
    /// The defaults, also of the program's arguments.
    pub const DEFAULT: Self = Self {
        resolution: [1280, 720],
        crop: None,
        photons: 100_000,
        estimator: Estimator::Sppm,
        direct: Direct::Light,
        alpha: 2.0 / 3.0,
        radius: None,
        gather: None,
        cell_photons: None,
        accel: Accel::Auto,
        triangle_test: TriangleTest::Watertight,
        max_depth: 64,
        drop_unwanted: true,
        emission: EmissionChoice::of(Estimator::Sppm),
        aims_anyway: false,
        sampler: Sampler::of(Estimator::Sppm),
        seed: 0,
        filter: PixelFilter::Box,
        layers: Layers::NONE,
        part: Part::WHOLE,
    };

    /// Checks every range.
    ///
    /// # Errors
    /// The first setting outside its range.
    pub fn check(&self) -> Result<()> {
        let [width, height] = self.resolution;
        in_range(
            Setting::Resolution,
            format!("{width}x{height}"),
            ranges::resolution(self.resolution),
        )?;
        if let Some(crop) = self.crop {
            in_range(Setting::Crop, crop, ranges::crop(crop, self.resolution))?;
        }
        in_range(Setting::Alpha, self.alpha, ranges::alpha(self.alpha))?;
        in_range(Setting::Photons, self.photons, ranges::count(self.photons))?;
        in_range(Setting::MaxDepth, self.max_depth, ranges::count(self.max_depth))?;
        in_range(Setting::Part, self.part, ranges::part(self.part))?;
        if let Some(radius) = self.radius {
            in_range(Setting::Radius, radius, ranges::positive(radius))?;
        }
        if let Some(count) = self.cell_photons {
            in_range(Setting::CellPhotons, count, ranges::count(count))?;
        }
        Ok(())
    }

    /// Seed of the kernels' random numbers: each part has its own.
    pub fn random_seed(&self) -> u32 {
        self.part.seed(self.seed)
    }

    /// Whether an iteration finds visible points: those of the paper are found once.
    pub fn finds_visible_points(&self, iteration: u32) -> bool {
        iteration == 0 || self.estimator == Estimator::Sppm
    }

    /// Whether photons that no visible point can accept are dropped where they land. The paper keeps all photons.
    pub fn drops_unwanted(&self) -> bool {
        self.drop_unwanted && self.estimator == Estimator::Sppm
    }

    /// First iteration of the block of `iteration`. With each block the photons' [`SEQUENCES`] restart, because the emission
    /// table may change then. Blocks grow with the render, up to half of it.
    pub fn block_of(&self, iteration: u32) -> u32 {
        let octave = if iteration < 2 * SEQUENCES {
            iteration / SEQUENCES * SEQUENCES
        } else {
            1 << iteration.ilog2()
        };
        // A sequence has 2³² points.
        let most = SEQUENCES.saturating_mul(1 << (u32::MAX / self.photons.max(1)).max(1).ilog2());
        octave.max(iteration / most * most)
    }

    /// Whether photons' sequences restart with an iteration, so that the emission table may change.
    pub fn begins_sequences(&self, iteration: u32) -> bool {
        iteration - self.block_of(iteration) < if iteration < 2 * SEQUENCES { SEQUENCES } else { 1 }
    }

    /// Camera paths of a pixel in an iteration: about one for each photon path. All of them sample direct light, the visible
    /// point of the first one gathers photons. The paper has one.
    pub fn camera_paths(&self) -> u32 {
        let pixels = self.resolution[0].saturating_mul(self.resolution[1]).max(1);
        match self.estimator {
            Estimator::Ppm => 1,
            Estimator::Sppm => (self.photons.saturating_add(pixels / 2) / pixels).clamp(1, MOST_CAMERA_PATHS),
        }
    }

    /// Number of points of each disc that `coverage` tests in an iteration: many at first, because a correction by few points is
    /// worse than none.
    pub fn coverage_points(&self, iteration: u32) -> u32 {
        COVERAGE_WHOLE >> iteration.saturating_add(1).ilog2().min(COVERAGE_WHOLE.ilog2())
    }

    /// Whether shadow rays that end on glass continue in an iteration to estimate the light behind it: in the first iterations,
    /// then rarely, because it takes more rays. Points that have photons do so only in the very first one of them.
    pub fn samples_behind_glass(&self, iteration: u32) -> bool {
        iteration < 8 || iteration.is_multiple_of(BEHIND_GLASS_EVERY)
    }

    /// Number of photon paths of the block before `iteration` that belong to its sequence.
    pub fn first_of_sequence(&self, iteration: u32) -> u32 {
        ((iteration - self.block_of(iteration)) / SEQUENCES).wrapping_mul(self.photons)
    }
}

/// Totals of a render.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Totals {
    /// Iterations.
    pub iterations: u32,
    /// Photon paths that were emitted in all of them.
    pub emitted: u64,
    /// Camera paths of each pixel in all of them.
    pub camera_paths: u32,
}

impl Totals {
    /// Adds the totals of another part of the render.
    pub fn add(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.emitted += other.emitted;
        self.camera_paths += other.camera_paths;
    }

    /// Divisors of a picture, also if nothing has been rendered.
    pub fn at_least_one(self) -> Self {
        Self {
            iterations: self.iterations.max(1),
            emitted: self.emitted.max(1),
            camera_paths: self.camera_paths.max(1),
        }
    }
}
