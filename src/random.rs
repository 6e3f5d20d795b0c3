//! The random numbers of `glsl/common/random.glsl`, bit for bit. The host needs them to reconstruct the starts of photon paths.

mod sobol;

use crate::config::{Estimator, RenderConfig, SEQUENCES, Sampler, Totals};
use crate::layout::{CAMERA_PATH, COVERAGE_SAMPLE, LIGHT_SAMPLE, PHOTON_PATH};
use crate::shaders;

/// The kind of a path: mixed into the seed, so that kinds have different numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum PathKind {
    /// From the camera; its number is the pixel's, row by row.
    Camera = CAMERA_PATH,
    /// Of a photon; its number is that within the iteration.
    Photon = PHOTON_PATH,
    /// From a visible point to a light; its number is the slot.
    LightSample = LIGHT_SAMPLE,
    /// Of points around a visible point; its number is the slot.
    Coverage = COVERAGE_SAMPLE,
}

/// The camera path of a pixel in an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CameraTurn {
    /// The iteration.
    pub iteration: u32,
    /// Number of the path.
    pub path: u32,
    /// Total number of paths: [`RenderConfig::camera_paths`].
    pub paths: u32,
}

impl CameraTurn {
    /// The only path of the first iteration.
    pub const FIRST: Self = Self {
        iteration: 0,
        path: 0,
        paths: 1,
    };

    /// The path whose visible points gather photons.
    pub fn that_gathers(config: &RenderConfig, iteration: u32) -> Self {
        Self {
            iteration,
            path: 0,
            paths: config.camera_paths(),
        }
    }

    /// The other paths of its iteration.
    pub fn others(self) -> impl Iterator<Item = Self> {
        (1..self.paths).map(move |path| Self { path, ..self })
    }

    /// The last path of a render so far, whose visible points are still there; `None` before the first iteration. The paper's
    /// estimator has those of its first iteration.
    pub fn last(config: &RenderConfig, totals: Totals) -> Option<Self> {
        let last = totals.iterations.checked_sub(1)?;
        let iteration = match config.estimator {
            Estimator::Sppm => last,
            Estimator::Ppm => 0,
        };
        let gathers = Self::that_gathers(config, iteration);
        // A first iteration that was interrupted has one path only.
        let was_interrupted = last == 0 && totals.camera_paths == 1;
        let others = gathers.others().filter(|_| !was_interrupted);
        Some(others.last().unwrap_or(gathers))
    }
}

impl From<CameraTurn> for shaders::CameraTurnPush {
    fn from(turn: CameraTurn) -> Self {
        let CameraTurn { iteration, path, paths } = turn;
        Self { iteration, path, paths }
    }
}

/// The random numbers of one path in one iteration.
#[derive(Debug, Clone, Copy)]
pub struct Random {
    sampler: Sampler,
    path: u32,
    iteration: u32,
    /// The user's seed, mixed with the kind of path.
    seed: u32,
    /// How many quadruples have been drawn.
    dimension: u32,
    /// Low-discrepancy sequence: of a pixel, or of all photons.
    sequence: u32,
    /// Block of iterations whose numbers are one sequence.
    block: u32,
    /// Index in that sequence.
    index: u32,
    /// State of the congruential generator.
    state: u32,
}

impl Random {
    /// Independent random numbers of a path.
    pub fn new(kind: PathKind, path: u32, iteration: u32, seed: u32) -> Self {
        Self::with(Sampler::Independent, kind, path, iteration, seed)
    }

    /// The same with another generator; for Sobol' sequences, the first point.
    pub fn with(sampler: Sampler, kind: PathKind, path: u32, iteration: u32, seed: u32) -> Self {
        let seed = seed ^ kind as u32;
        Self {
            sampler,
            path,
            iteration,
            seed,
            dimension: 0,
            sequence: 0,
            block: 0,
            index: 0,
            state: seed
                .wrapping_add(iteration.wrapping_mul(0x9e37_79b1))
                .wrapping_add(path),
        }
    }

    /// The numbers of a pixel, or of another index that has one path in each turn.
    pub fn of_pixel(config: &RenderConfig, kind: PathKind, pixel: u32, turn: CameraTurn) -> Self {
        let CameraTurn { iteration, path, paths } = turn;
        Self {
            sequence: pixel,
            block: iteration % SEQUENCES,
            index: (iteration / SEQUENCES).wrapping_mul(paths).wrapping_add(path),
            ..Self::with(
                config.sampler,
                kind,
                pixel,
                iteration.wrapping_mul(paths).wrapping_add(path),
                config.random_seed(),
            )
        }
    }

    /// The numbers of several points of a disc: they are one set; later sets continue one sequence.
    pub fn of_disc(config: &RenderConfig, slot: u32, iteration: u32, points: u32) -> Self {
        let (block, index) = if points > 1 {
            (iteration, 0)
        } else {
            (u32::MAX, iteration)
        };
        Self {
            sequence: slot,
            block,
            index,
            ..Self::with(
                config.sampler,
                PathKind::Coverage,
                slot,
                iteration,
                config.random_seed(),
            )
        }
    }

    /// The numbers of one of several samples of the same kind in a path.
    pub fn sample_of(&self, number: u32, samples: u32) -> Self {
        Self {
            index: self.index.wrapping_mul(samples).wrapping_add(number),
            dimension: if self.sampler == Sampler::Sobol { 0 } else { number },
            // A stream of its own.
            state: self.state.wrapping_add(number.wrapping_mul(0x85eb_ca6b)),
            ..*self
        }
    }

    /// Skips the quadruples before this one.
    pub fn skip_to(&mut self, dimension: u32) {
        self.dimension = dimension;
    }

    /// The numbers of a photon path; `path` is its index in the iteration.
    pub fn of_photon(config: &RenderConfig, path: u32, iteration: u32) -> Self {
        Self {
            sequence: iteration % SEQUENCES,
            block: config.block_of(iteration),
            index: config.first_of_sequence(iteration).wrapping_add(path),
            ..Self::with(config.sampler, PathKind::Photon, path, iteration, config.random_seed())
        }
    }

    /// The number that decides whether a ray passes a partly transparent surface.
    pub fn number_of(&self, [first, second]: [u32; 2]) -> f64 {
        let [word, ..] = pcg4d([
            self.path ^ 0x616c_7068,
            self.iteration.wrapping_add(second.wrapping_mul(0x85eb_ca6b)),
            self.seed.wrapping_add(first.wrapping_mul(0x9e37_79b9)),
            self.dimension,
        ]);
        f64::from(word >> 8) / f64::from(1 << 24)
    }

    /// The next four numbers, uniform in [0, 1): multiples of 2⁻²⁴, so that an f32 holds each of them.
    pub fn next4(&mut self) -> [f64; 4] {
        let bits = match self.sampler {
            Sampler::Sobol => {
                let seed = pcg4d([self.sequence, self.block, !self.seed, self.dimension]);
                sobol::point(self.index, seed)
            }
            Sampler::Independent => pcg4d([self.path, self.iteration, self.seed, self.dimension]),
            Sampler::Congruential => [(); 4].map(|()| {
                self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                self.state
            }),
        };
        self.dimension = self.dimension.wrapping_add(1);
        bits.map(|word| f64::from(word >> 8) / f64::from(1 << 24))
    }
}

/// PCG 4D: Jarzynski and Olano, «Hash Functions for GPU Rendering», JCGT 9(3), 2020.
pub fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let mix = |[mut x, mut y, mut z, mut w]: [u32; 4]| {
        x = x.wrapping_add(y.wrapping_mul(w));
        y = y.wrapping_add(z.wrapping_mul(x));
        z = z.wrapping_add(x.wrapping_mul(y));
        w = w.wrapping_add(y.wrapping_mul(z));
        [x, y, z, w]
    };
    let v = v.map(|word| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mix(mix(v).map(|word| word ^ word >> 16))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_those_of_neighbouring_paths_independent() {
        let count = 1 << 16;
        let (mut sum, mut squares, mut products) = (0.0, 0.0, 0.0);
        for path in 0..count {
            let [x, ..] = Random::new(PathKind::Photon, path, 0, 0).next4();
            let [y, ..] = Random::new(PathKind::Photon, path + 1, 0, 0).next4();
            assert!((0.0..1.0).contains(&x), "{x} of path {path} isn't in [0, 1)");
            sum += x - 0.5;
            squares += (x - 0.5) * (x - 0.5);
            products += (x - 0.5) * (y - 0.5);
        }
        let n = f64::from(count);
        // Five standard deviations of each mean: 0.289, 0.0745 and 0.0833 over √n.
        assert!((sum / n).abs() < 5.0 * 0.289 / n.sqrt(), "mean {}", sum / n);
        assert!(
            (squares / n - 1.0 / 12.0).abs() < 5.0 * 0.0745 / n.sqrt(),
            "variance {}",
            squares / n
        );
        assert!(
            (products / n).abs() < 5.0 * 0.0833 / n.sqrt(),
            "covariance {}",
            products / n
        );
    }

    #[test]
    fn the_samples_of_a_path_differ_with_every_sampler() {
        for sampler in [Sampler::Sobol, Sampler::Independent, Sampler::Congruential] {
            let random = Random::with(sampler, PathKind::Coverage, 3, 5, 7);
            let mut samples: Vec<_> = (0..16)
                .map(|number| random.sample_of(number, 16).next4().map(f64::to_bits))
                .collect();
            samples.sort_unstable();
            samples.dedup();
            assert_eq!(samples.len(), 16, "{sampler:?}");
        }
    }

    #[test]
    fn kind_path_iteration_seed_and_dimension_all_matter() {
        let first = |kind, path, iteration, seed| Random::new(kind, path, iteration, seed).next4();
        let mut again = Random::new(PathKind::Camera, 1, 2, 3);
        let numbers = again.next4();
        assert_eq!(numbers, first(PathKind::Camera, 1, 2, 3));
        for other in [
            again.next4(),
            first(PathKind::Photon, 1, 2, 3),
            first(PathKind::Camera, 2, 2, 3),
            first(PathKind::Camera, 1, 3, 3),
            first(PathKind::Camera, 1, 2, 4),
        ] {
            assert_ne!(numbers, other);
        }
    }
}
