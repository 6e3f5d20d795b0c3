//! What the user asked for.

mod choice;
pub mod ranges;
mod tiles;

pub use choice::Choice;
pub(crate) use choice::choices;
pub use tiles::pixel_of;

use std::fmt::Display;

use ranges::Checked;

use crate::error::{Error, Result, Setting};
pub use crate::layout::SEQUENCES;
use crate::layout::{ASKS_EVERY, CONGRUENTIAL, COVERAGE_WHOLE, INDEPENDENT, SOBOL};

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
        /// Where paths were found to bring photons that the picture needs.
        Aimed => "aimed",
        /// In proportion to the lights' power, as in the paper.
        Power => "power",
    }
}

impl EmissionChoice {
    /// What an estimator uses where the user doesn't say.
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
        /// Scrambled Sobol' sequences: samples that spread evenly, over an iteration's photons and over a pixel's iterations.
        Sobol = SOBOL => "sobol",
        /// Independent numbers, from a hash.
        Independent = INDEPENDENT => "independent",
        /// A congruential generator for each path, as in the paper; neighbouring paths are correlated: for comparison alone.
        Congruential = CONGRUENTIAL => "congruential",
    }
}

impl Sampler {
    /// What an estimator uses where the user doesn't say: the paper's has independent numbers.
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
    /// Pixels, width and height.
    pub resolution: [u32; 2],
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
    /// Index into [`crate::gather::METHODS`]; the fastest of what renders if `None`.
    pub gather: Option<usize>,
    /// Photons that a cell of the method `cluster-grid` holds at the most; what is beyond is lost. Without it cells hold
    /// all.
    pub cell_photons: Option<u32>,
    /// How rays meet triangles.
    pub accel: Accel,
    /// How a ray is tested against a triangle.
    pub triangle_test: TriangleTest,
    /// Bounces of a path at the most.
    pub max_depth: u32,
    /// Whether photons that no visible point can accept are dropped where they land, by the estimator `sppm`.
    pub drop_unwanted: bool,
    /// How photon paths start.
    pub emission: EmissionChoice,
    /// Whether paths are aimed even where pilots say that it isn't worth its cost.
    pub aims_anyway: bool,
    /// Where the numbers of paths come from.
    pub sampler: Sampler,
    /// Seed of all random numbers.
    pub seed: u32,
}

impl Default for RenderConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Pixels of a picture's side at the most.
pub const MAX_SIDE: u32 = 16384;

/// How many of so many iterations are of a sequence.
pub fn iterations_of(sequence: u32, iterations: u32) -> u32 {
    iterations / SEQUENCES + u32::from(sequence < iterations % SEQUENCES)
}

/// Paths of a pixel in an iteration at the most: so many cost little beside as many photon paths.
const MOST_CAMERA_PATHS: u32 = 8;

fn in_range<T>(setting: Setting, value: impl Display, checked: Checked<T>) -> Result<()> {
    match checked {
        Ok(_) => Ok(()),
        Err(wrong) => Err(Error::setting(setting, format!("{value}: {wrong}"))),
    }
}

impl RenderConfig {
    /// What the user gets who says nothing; the arguments' defaults are these.
    pub const DEFAULT: Self = Self {
        resolution: [1280, 720],
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
        in_range(Setting::Alpha, self.alpha, ranges::alpha(self.alpha))?;
        in_range(Setting::Photons, self.photons, ranges::count(self.photons))?;
        in_range(Setting::MaxDepth, self.max_depth, ranges::count(self.max_depth))?;
        if let Some(radius) = self.radius {
            in_range(Setting::Radius, radius, ranges::positive(radius))?;
        }
        if let Some(count) = self.cell_photons {
            in_range(Setting::CellPhotons, count, ranges::count(count))?;
        }
        Ok(())
    }

    /// Whether photons that no visible point can accept are dropped where they land. The paper keeps all.
    pub fn drops_unwanted(&self) -> bool {
        self.drop_unwanted && self.estimator == Estimator::Sppm
    }

    /// First iteration of the block of `iteration`. With each block the photons' [`SEQUENCES`] begin anew, since they may be
    /// aimed anew. Blocks grow with the render, to the half of it.
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

    /// Whether photons' sequences begin anew with an iteration, so that they may be aimed anew.
    pub fn begins_sequences(&self, iteration: u32) -> bool {
        iteration - self.block_of(iteration) < if iteration < 2 * SEQUENCES { SEQUENCES } else { 1 }
    }

    /// Paths of a pixel in an iteration: about one for each photon path. All of them see what is lit directly, the first one's
    /// visible point gathers photons. The paper has one.
    pub fn camera_paths(&self) -> u32 {
        let pixels = self.resolution[0].saturating_mul(self.resolution[1]).max(1);
        match self.estimator {
            Estimator::Ppm => 1,
            Estimator::Sppm => (self.photons.saturating_add(pixels / 2) / pixels).clamp(1, MOST_CAMERA_PATHS),
        }
    }

    /// Points of the disc around each visible point that `coverage` asks in an iteration: many at first, since what few say
    /// is worse than nothing.
    pub fn coverage_points(&self, iteration: u32) -> u32 {
        COVERAGE_WHOLE >> iteration.saturating_add(1).ilog2().min(COVERAGE_WHOLE.ilog2())
    }

    /// Whether shadow rays that end on glass go on in an iteration to say what light lies behind it: in the first ones, and
    /// then now and then, since it takes more rays. Of the first ones, points that have photons take a part in the very first.
    pub fn asks_behind_glass(&self, iteration: u32) -> bool {
        iteration < 8 || iteration.is_multiple_of(ASKS_EVERY)
    }

    /// Photon paths of the block before `iteration` that are of its sequence.
    pub fn first_of_sequence(&self, iteration: u32) -> u32 {
        ((iteration - self.block_of(iteration)) / SEQUENCES).wrapping_mul(self.photons)
    }
}

/// How much has been rendered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Totals {
    /// Iterations.
    pub iterations: u32,
    /// Photon paths that were emitted in all of them.
    pub emitted: u64,
    /// Camera paths of each pixel in all of them.
    pub camera_paths: u32,
}

impl Totals {
    /// Adds what another part of a render has rendered.
    pub fn add(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.emitted += other.emitted;
        self.camera_paths += other.camera_paths;
    }

    /// What a picture is divided by, also where nothing has been rendered.
    pub fn at_least_one(self) -> Self {
        Self {
            iterations: self.iterations.max(1),
            emitted: self.emitted.max(1),
            camera_paths: self.camera_paths.max(1),
        }
    }
}
