//! The table that aims photon paths: `glsl/lights/emission_table.glsl`.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::alias::{self, AliasCell};
use crate::layout::{EmissionCell, Light};

/// Coordinates of a start.
pub const DIMENSIONS: usize = 5;

/// In [0, 1), in steps of 2⁻²⁴ like random numbers.
const STEPS: f64 = 16_777_216.0;

/// The sampling table of photon paths.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Table {
    /// Targets, smaller ones first: centre, radius; render units.
    pub spheres: Vec<[f32; 4]>,
    /// Index of the target around most of the view.
    pub view: Option<u32>,
    /// Boxes of starts.
    #[serde(with = "crate::state::words")]
    pub cells: Vec<EmissionCell>,
}

/// A sampled cell, and a point in it.
#[derive(Debug, Clone, Copy)]
pub struct Chosen {
    /// Index of the cell.
    pub cell: usize,
    /// In [0, 1): position within the cell, along each coordinate.
    pub within: [f64; DIMENSIONS],
}

impl Table {
    /// Samples a cell and a point in it by the first eight numbers of a path.
    pub fn choose(&self, u: [f64; 4], w: [f64; 4]) -> Chosen {
        let chosen = alias::choose(self.cells.len(), u[0], [w[0], w[2]], |cell| AliasCell {
            accept: self.cells[cell].accept,
            alias: self.cells[cell].alias,
        });
        Chosen {
            cell: chosen.index,
            within: [chosen.rest, u[1], u[2], u[3], w[3]],
        }
    }

    /// The coordinates of a point in a cell.
    pub fn coordinates(&self, chosen: Chosen) -> [f64; DIMENSIONS] {
        let cell = &self.cells[chosen.cell];
        std::array::from_fn(|i| {
            let (low, size) = match i {
                4 => (cell.low_light, cell.size_light),
                _ => (cell.low[i], cell.size[i]),
            };
            let coordinate = f64::from(low) + f64::from(size) * chosen.within[i];
            (coordinate * STEPS).floor().min(STEPS - 1.0) / STEPS
        })
    }

    /// In the device's layout: the numbers of cells and spheres, the index of the view's sphere; the spheres; the cells. Texels
    /// of four words.
    pub fn texels(&self) -> Vec<[u32; 4]> {
        let targets = self.spheres.len() as u32;
        let head = [self.cells.len() as u32, targets, self.view.unwrap_or(targets), 0];
        let mut texels = vec![head];
        texels.extend(self.spheres.iter().map(|sphere| sphere.map(f32::to_bits)));
        texels.extend_from_slice(bytemuck::cast_slice(&self.cells));
        texels
    }
}

/// Samples a light of a source by a number in [0, 1); its index, and its probability within the source.
pub fn light_of(lights: &[Light], source: Range<u32>, number: f64) -> (usize, f64) {
    let first = source.start as usize;
    let of_source = &lights[first..source.end as usize];
    let chosen = of_source
        .partition_point(|light| f64::from(light.cumulative) <= number)
        .min(of_source.len() - 1);
    let before = if chosen == 0 {
        0.0
    } else {
        f64::from(of_source[chosen - 1].cumulative)
    };
    (first + chosen, f64::from(of_source[chosen].cumulative) - before)
}
