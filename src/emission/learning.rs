//! Learns cells and their probabilities from the values of paths.

mod cell;

use bytemuck::Zeroable;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::cell::{BINS, Cell, Counts, Cut, PRIOR};
use super::path_value::PathValue;
use super::strata::{Stratum, strata};
use super::table::{Chosen, DIMENSIONS, Table};
use super::targets::targets;
use crate::alias::alias_table;
use crate::config::RenderConfig;
use crate::layout::{EmissionCell, VisiblePoint};
use crate::packing::PackedScene;
use crate::radius;
use crate::random::Random;
use crate::sizes::MOST_EMISSION_CELLS;

/// Rounds of learning before the first iteration, each of a quarter of its paths.
const PILOT_ROUNDS: u32 = 4;
/// Maximum number of paths that are learned from, in one of the first iterations and in a later one: the distribution of demand
/// is found early, and rare paths with much flux need many paths to be found.
const COUNTED_PATHS: [u32; 2] = [1 << 16, 1 << 14];
/// The first of the later iterations.
const LATER: u32 = 16;
/// Minimum factor by which aimed paths have to be better than paths by power: they cost more than their rays.
const WORTH_IT: f64 = 2.5;
/// Maximum average number of rays per path, if paths by power take fewer. Paths that are aimed at glass take many: some of them
/// are not traced, and the others carry their flux.
const FEWEST_RAYS: f64 = 4.0;
/// Clamp of a path's value, as a multiple of the median of the positive values: rare paths with much flux would mask the others.
const MOST_VALUE: f64 = 1000.0;
/// Maximum factor by which an update changes the probability of a cell with many paths.
const LARGEST_CHANGE: f64 = 16.0;
/// Number of paths with which a cell may change by half of that.
const TRUSTED: f64 = 32.0;
/// Maximum number of successive splits of a cell in an update.
const CUT_ROUNDS: usize = 8;

/// The iteration whose random numbers a pilot round uses. No render gets that far, and the search for radii uses others.
fn pilot_iteration(round: u32) -> u32 {
    radius::PILOT - 1 - round
}

/// Whether paths of an iteration are learned from: in later blocks, few iterations are sufficient.
pub fn is_learned_from(config: &RenderConfig, iteration: u32) -> bool {
    iteration < 64 || iteration - config.block_of(iteration) < 4
}

/// Maximum number of paths of an iteration that are learned from.
pub fn counted_paths(iteration: u32) -> u32 {
    let later = (LATER..pilot_iteration(PILOT_ROUNDS)).contains(&iteration);
    COUNTED_PATHS[usize::from(later)]
}

/// Mean value and mean number of rays of paths.
#[derive(Debug, Clone, Copy, Default)]
struct Worth {
    value: f64,
    rays: f64,
}

impl Worth {
    fn add(&mut self, probability: f64, value: f64, rays: f64) {
        self.value += probability * value;
        self.rays += probability * rays;
    }

    /// Variance times cost.
    fn product(&self) -> f64 {
        self.value * self.rays
    }
}

/// The data of a counted path.
struct Counted {
    cell: usize,
    bins: [usize; DIMENSIONS],
    value: f64,
    rays: f64,
}

/// The emission table and the statistics from which it is learned.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Aim {
    strata: Vec<Stratum>,
    cells: Vec<Cell>,
    table: Table,
    /// Paths since the last update.
    has_learned: bool,
}

impl Aim {
    /// The initial state. `points`: the visible points of the first iteration.
    pub fn new(scene: &PackedScene, points: &[VisiblePoint]) -> Self {
        let targets = targets(scene, points);
        let spheres = targets.spheres.iter().map(|target| target.sphere.packed());
        Self::of_strata(strata(scene, &targets), spheres.collect(), targets.view)
    }

    /// Aims paths by pilot rounds; `trace` traces an iteration's paths that start by a table, and returns their values. `None` if
    /// aiming does not pay for its cost.
    ///
    /// # Errors
    /// The errors of `trace`.
    pub fn by_pilots<E>(
        config: &RenderConfig,
        scene: &PackedScene,
        points: &[VisiblePoint],
        mut trace: impl FnMut(&Table, u32) -> Result<Vec<u32>, E>,
    ) -> Result<Option<Self>, E> {
        let mut aim = Self::new(scene, points);
        for round in 0..PILOT_ROUNDS {
            // Without statistics, nothing changes.
            aim.update();
            let iteration = pilot_iteration(round);
            let values = trace(aim.table(), iteration)?;
            aim.learn(config, iteration, 0, &values);
        }
        let is_kept = config.aims_anyway || aim.aiming_pays();
        aim.update();
        Ok(is_kept.then_some(aim))
    }

    fn of_strata(strata: Vec<Stratum>, spheres: Vec<[f32; 4]>, view: Option<u32>) -> Self {
        let whole = |(stratum, probability): (usize, f64)| Cell {
            stratum,
            low: [0.0; DIMENSIONS],
            size: [1.0; DIMENSIONS],
            probability,
            density: probability,
            counts: Counts::default(),
        };
        let initial = strata.iter().map(|stratum| stratum.initial).enumerate();
        let mut aim = Self {
            cells: initial.map(whole).collect(),
            strata,
            table: Table {
                spheres,
                view,
                cells: Vec::new(),
            },
            has_learned: false,
        };
        aim.normalise();
        aim.cells.iter_mut().for_each(|cell| cell.density = cell.probability);
        aim
    }

    /// The table for the next paths.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// Adds paths that started by the current table: those of an iteration from `first_path` on, with their values,
    /// [`PathValue::packed`]. Uses [`counted_paths`] of them.
    pub fn learn(&mut self, config: &RenderConfig, iteration: u32, first_path: u32, values: &[u32]) {
        let table = &self.table;
        let count = |(number, &word): (usize, &u32)| {
            let mut random = Random::of_photon(config, first_path + number as u32, iteration);
            let (u, w) = (random.next4(), random.next4());
            let PathValue { value, rays } = PathValue::unpacked(word);
            let Chosen { cell, within } = table.choose(u, w);
            Counted {
                cell,
                bins: within.map(|coordinate| ((coordinate * BINS as f64) as usize).min(BINS - 1)),
                value: value.into(),
                rays: rays.into(),
            }
        };
        let values = &values[..values.len().min(counted_paths(iteration) as usize)];
        let counted: Vec<Counted> = values.par_iter().enumerate().with_min_len(1024).map(count).collect();
        self.has_learned = true;
        let mut useful: Vec<f64> = counted
            .iter()
            .map(|path| path.value)
            .filter(|&value| value > 0.0)
            .collect();
        let middle = useful.len() / 2;
        let most = if useful.is_empty() {
            0.0
        } else {
            MOST_VALUE * *useful.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        // In units of their mean, so that values relative to an earlier, darker picture have the same weight.
        let sum: f64 = useful.iter().map(|value| value.min(most)).sum();
        let unit = if sum > 0.0 { sum / counted.len() as f64 } else { 1.0 };
        for path in counted {
            let value = path.value.min(most) / unit;
            // The last cell represents paths that are not traced.
            let Some(cell) = self.cells.get_mut(path.cell) else {
                continue;
            };
            let counts = &mut cell.counts;
            counts.paths += 1.0;
            counts.value += value;
            counts.rays += path.rays;
            counts.squares += value * value;
            for (dimension, &bin) in path.bins.iter().enumerate() {
                counts.paths_in[dimension][bin] += 1.0;
                counts.value_in[dimension][bin] += value;
            }
        }
    }

    /// Updates the table: a path's value is the square of its contribution. For a given cost, the variance of the mean is minimal
    /// if the probability is proportional to the square root of the density of the squared contribution over the cost.
    pub fn update(&mut self) {
        let value: f64 = self.cells.iter().map(|cell| cell.counts.value).sum();
        let cost: f64 = self.cells.iter().map(|cell| cell.counts.cost()).sum();
        if !std::mem::take(&mut self.has_learned) || value == 0.0 {
            return;
        }
        let mean = value / cost;
        for cell in &mut self.cells {
            let counts = &cell.counts;
            let rate = (counts.value / mean + PRIOR) / (counts.cost() + PRIOR);
            let limit = 1.0 + (LARGEST_CHANGE - 1.0) * counts.paths / (counts.paths + TRUSTED);
            cell.probability *= rate.sqrt().clamp(1.0 / limit, limit);
        }
        for _ in 0..CUT_ROUNDS {
            self.cut();
        }
        self.normalise();
        for cell in &mut self.cells {
            // Previous statistics are halved, and treated as if the paths had started by the new density.
            let density = cell.probability / cell.volume();
            let factor = (cell.density / density).powi(2);
            cell.counts = cell.counts.part(0.5, 0.5).revalued(factor);
            cell.density = density;
        }
    }

    /// Splits cells whose halves differ, the most important ones first.
    fn cut(&mut self) {
        let cells = self.cells.iter().enumerate();
        let mut cuts: Vec<(usize, Cut)> = cells
            .filter_map(|(index, cell)| Some((index, cell.best_cut(self.usable_dimensions(cell))?)))
            .collect();
        let gain = |&(index, cut): &(usize, Cut)| self.cells[index].probability * cut.contrast;
        cuts.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        cuts.truncate(MOST_EMISSION_CELLS as usize - 1 - self.cells.len().min(MOST_EMISSION_CELLS as usize - 1));
        for (index, cut) in cuts {
            let [lower, upper] = self.cells[index].halves(cut);
            self.cells[index] = lower;
            self.cells.push(upper);
        }
    }

    /// The coordinates along which a cell can be split: the last one chooses among the lights of its source.
    fn usable_dimensions(&self, cell: &Cell) -> usize {
        let one_light = self.strata[cell.stratum].lights.len() == 1;
        if one_light { DIMENSIONS - 1 } else { DIMENSIONS }
    }

    /// Normalises the probabilities, each at least its floor, and builds the table.
    fn normalise(&mut self) {
        let strata = &self.strata;
        let floor = |cell: &Cell| strata[cell.stratum].floor * cell.volume();
        let floors: f64 = self.cells.iter().map(floor).sum();
        let sum: f64 = self.cells.iter().map(|cell| cell.probability).sum();
        for cell in &mut self.cells {
            cell.probability = floor(cell) + (1.0 - floors) * cell.probability / sum;
        }
        let traced = self.traced();
        let mut probabilities: Vec<f64> = self.cells.iter().map(|cell| traced * cell.probability).collect();
        probabilities.push(1.0 - traced);
        let alias = alias_table(&probabilities);
        let untraced = alias[self.cells.len()];
        let packed = self.cells.iter().zip(&alias).map(|(cell, entry)| {
            let stratum = &strata[cell.stratum];
            let [low @ .., low_light] = cell.low;
            let [size @ .., size_light] = cell.size;
            EmissionCell {
                low,
                size,
                low_light,
                size_light,
                weight: (cell.volume() / (traced * cell.probability)) as f32,
                accept: entry.accept,
                alias: entry.alias,
                first_light: stratum.lights.start,
                lights: stratum.lights.len() as u32,
                target: stratum.target,
            }
        });
        self.table.cells = packed.collect();
        self.table.cells.push(EmissionCell {
            size: [1.0; 4],
            size_light: 1.0,
            lights: 1,
            accept: untraced.accept,
            alias: untraced.alias,
            ..EmissionCell::zeroed()
        });
    }

    /// Whether aiming pays for its cost: compares the squared error of the picture for the same time with that of paths by power.
    /// In a closed room nearly every photon is useful, wherever it starts.
    pub fn aiming_pays(&self) -> bool {
        let (mut aimed, mut by_power) = (Worth::default(), Worth::default());
        for cell in self.cells.iter().filter(|cell| cell.counts.paths > 0.0) {
            let counts = &cell.counts;
            let [value, rays] = [counts.value, counts.rays].map(|sum| sum / counts.paths);
            let share = self.strata[cell.stratum].share * cell.volume();
            aimed.add(cell.probability, value, rays);
            // The flux of a path is inversely proportional to its density.
            by_power.add(share, value * (cell.probability / share).powi(2), rays);
        }
        aimed.value == 0.0 || by_power.product() > WORTH_IT * aimed.product()
    }

    /// The share of the paths that is traced, so that they take about as many rays as paths by power.
    fn traced(&self) -> f64 {
        let rays = |cell: &Cell| {
            let counts = &cell.counts;
            if counts.paths > 0.0 {
                counts.rays / counts.paths
            } else {
                1.0
            }
        };
        let cells = || self.cells.iter();
        let by_power: f64 = cells()
            .map(|cell| self.strata[cell.stratum].share * cell.volume() * rays(cell))
            .sum();
        let aimed: f64 = cells().map(|cell| cell.probability * rays(cell)).sum();
        (by_power.max(FEWEST_RAYS) / aimed.max(f64::MIN_POSITIVE)).min(1.0)
    }
}

#[cfg(test)]
mod tests;
