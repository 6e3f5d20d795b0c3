//! What visible points want of photons: `glsl/shared/grid.glsl`, `demand.glsl` and their stages.

use std::f32::consts::PI;
use std::ops::RangeInclusive;

use bytemuck::Zeroable;
use glam::{IVec3, Vec3};

use super::Seen;
use super::resolve::share_of;
use super::vector::{mean, word, xyz};
use crate::layout::{
    CELLS_TO_RADIUS, COARSENING, Coverage, DEMAND_BITS, DirectSum, GridShape, MOST_CELLS, NO_OBJECT, SHELLS,
    SMALLEST_CELL, Settings, ShellRadii, Statistics, VisiblePoint,
};

/// What is wanted of photons at each place.
#[derive(Debug, Clone)]
pub struct Demand {
    /// Of each entry of the hashed table of cells; 0 where no visible point can accept a photon.
    pub entries: Vec<f32>,
    /// The gather's grids, whose cells these follow.
    pub grid: GridShape,
}

/// The shell around the camera that a point is in at this squared distance.
fn shell_at(distance2: f32) -> usize {
    let exponent = (distance2.to_bits() >> 23) as i32 - 127;
    ((exponent + 28) >> 2).clamp(0, SHELLS as i32 - 1) as usize
}

fn position_of(position_object: [f32; 4]) -> Vec3 {
    Vec3::from_slice(&position_object)
}

/// Rounded to f32 at each step as on the device, so that both put a point into the same shell.
fn shell_of(settings: &Settings, position: Vec3) -> usize {
    let d = position - position_of(settings.camera_position);
    shell_at(d.x * d.x + d.y * d.y + d.z * d.z)
}

/// Those that a ball reaches.
fn shells_of(settings: &Settings, position: Vec3, radius: f32) -> RangeInclusive<usize> {
    let distance = (position - position_of(settings.camera_position)).length();
    // More than both ends are rounded.
    let slack = 1e-6 * (distance + radius);
    let nearest = (distance - radius - slack).max(0.0);
    let farthest = distance + radius + slack;
    shell_at(nearest * nearest)..=shell_at(farthest * farthest)
}

/// What the device chooses the next grids from: of each photon map's shells, the mean logarithm of the radii (every
/// `step`-th), and the largest R².
pub fn shell_radii(settings: &Settings, visible_points: &[VisiblePoint], radii2: &[f32], step: u32) -> Vec<ShellRadii> {
    let mut shells = vec![ShellRadii::zeroed(); 2 * SHELLS];
    for (index, &radius2) in radii2.iter().enumerate() {
        let (map, slot) = (index / visible_points.len(), index % visible_points.len());
        let point = &visible_points[slot];
        if word(point.position_object) == NO_OBJECT {
            continue;
        }
        let position = position_of(point.position_object);
        for shell in shells_of(settings, position, radius2.sqrt()) {
            let largest = &mut shells[map * SHELLS + shell].largest;
            *largest = radius2.to_bits().max(*largest);
        }
        if (index as u32).is_multiple_of(step) {
            let shell = &mut shells[map * SHELLS + shell_of(settings, position)];
            shell.logs += (256.0 * (0.5 * f64::from(radius2).log2() + 64.0)).round() as u32;
            shell.count += 1;
        }
    }
    shells
}

/// The cell sizes that follow from that.
pub fn grid_shape(shells: &[ShellRadii]) -> GridShape {
    let inverse = |shell: &ShellRadii| {
        let balanced = if shell.count > 0 {
            let mean = f64::from(shell.logs) / f64::from(shell.count) / 256.0 - 64.0;
            CELLS_TO_RADIUS * mean.exp2() as f32
        } else {
            SMALLEST_CELL
        };
        let bounded = f32::from_bits(shell.largest).sqrt() / MOST_CELLS;
        1.0 / balanced.max(bounded).max(SMALLEST_CELL)
    };
    GridShape {
        inverse_cell_size: std::array::from_fn(|index| inverse(&shells[index])),
    }
}

fn cell_of(position: Vec3, inverse_cell_size: f32) -> IVec3 {
    (position * inverse_cell_size).floor().as_ivec3()
}

fn entry_of(cell: IVec3, of_shell: usize, object: u32) -> usize {
    let of_cell = [(cell.x, 0x9e37_79b1), (cell.y, 0x85eb_ca77), (cell.z, 0xc2b2_ae3d)];
    let hash = of_cell
        .iter()
        .fold(0, |hash, &(at, factor)| hash ^ (at as u32).wrapping_mul(factor));
    let hash = hash ^ (of_shell as u32 | object << 4).wrapping_mul(0x27d4_eb2f);
    let hash = (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d);
    ((hash ^ hash >> 13) >> (u32::BITS - DEMAND_BITS)) as usize
}

impl Demand {
    /// What is wanted of a photon of a map that lands there.
    pub(super) fn at(&self, settings: &Settings, position: Vec3, object: u32, map: usize) -> f32 {
        let of_shell = map * SHELLS + shell_of(settings, position);
        let cell = cell_of(position, self.grid.inverse_cell_size[of_shell] * (1.0 / COARSENING));
        self.entries[entry_of(cell, of_shell, object)]
    }
}

/// The state of a render that [`demand`] weighs.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// R², N and τ of each slot, for each photon map.
    pub statistics: &'a [Statistics],
    /// Of each slot, for each photon map.
    pub coverage: &'a [Coverage],
    /// Of each slot.
    pub direct_sums: &'a [DirectSum],
    /// Iterations done.
    pub iterations: u32,
    /// Photon paths of all of them.
    pub emitted: u64,
}

impl Progress<'_> {
    /// Of the picture so far, mean of the channels.
    fn radiance(&self, slot: usize) -> f64 {
        if self.iterations == 0 {
            return 0.0;
        }
        let direct = mean(xyz(self.direct_sums[slot].high)) / f64::from(self.iterations);
        let receivers = (slot..self.statistics.len()).step_by(self.direct_sums.len());
        let of_map = |receiver: usize| {
            let (statistics, coverage) = (&self.statistics[receiver], &self.coverage[receiver]);
            let area = f64::from(PI) * f64::from(statistics.radius2_high).max(1e-30) * share_of(coverage);
            mean(xyz(statistics.flux_high)) / self.emitted as f64 / area
        };
        direct + receivers.map(of_map).sum::<f64>()
    }
}

/// Enters what each visible point wants into the cells that its disc of `radii2` reaches.
pub fn demand(settings: &Settings, seen: &Seen, radii2: &[f32], progress: Progress<'_>, grid: GridShape) -> Demand {
    let mut entries = vec![0f32; 1 << DEMAND_BITS];
    for (index, &radius2) in radii2.iter().enumerate() {
        let (map, slot) = (index / seen.points.len(), index % seen.points.len());
        let point = &seen.points[slot];
        let object = word(point.position_object);
        if object == NO_OBJECT {
            continue;
        }
        let radius = radius2.sqrt();
        let footprint = f64::from(seen.footprints[slot].max(1e-3 * radius));
        let area = f64::from(PI) * f64::from(radius2);
        let of_one = mean(xyz(point.weight_normal)) / area;
        let reached = area / (footprint * footprint);
        let radiance2 = progress.radiance(slot).powi(2) + f64::from(settings.demand_floor2);
        let wanted = (of_one * of_one * reached / radiance2).clamp(1e-30, 1e30) as f32;
        let position = position_of(point.position_object);
        let reach = Vec3::splat(radius * 1.000_001 + 1e-7);
        for shell in shells_of(settings, position, radius) {
            let of_shell = map * SHELLS + shell;
            let inverse = grid.inverse_cell_size[of_shell] * (1.0 / COARSENING);
            let (low, high) = (cell_of(position - reach, inverse), cell_of(position + reach, inverse));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let entry = &mut entries[entry_of(IVec3::new(x, y, z), of_shell, object)];
                        *entry = entry.max(wanted);
                    }
                }
            }
        }
    }
    Demand { entries, grid }
}
