//! The paper's grid of each object: its bounding box, the longest axis split into a fixed number of pieces, whose length
//! is the side of all cubes.

use glam::Vec3;

use crate::layout::ObjectGrid;
use crate::scene::Scene;

/// Pieces of the longest axis.
const PIECES: u32 = 32;
/// Maximum number of cubes of all objects together; if there were more, axes are split into fewer pieces.
const MOST_CELLS: u64 = 1 << 21;

/// The grid of each object, and the total number of cubes.
pub fn object_grids(scene: &Scene) -> (Vec<ObjectGrid>, u32) {
    let mut boxes = vec![(Vec3::INFINITY, Vec3::NEG_INFINITY); scene.objects.len()];
    let own = scene.own_triangles();
    let own = own.map(|index| (scene.triangles[index as usize].object, scene.corners_of(index)));
    for (object, corners) in own.chain(scene.placed_triangles()) {
        let (low, high) = &mut boxes[object as usize];
        for corner in corners {
            *low = low.min(corner);
            *high = high.max(corner);
        }
    }
    let mut pieces = PIECES;
    loop {
        let (grids, cells) = split(&boxes, pieces);
        if cells <= MOST_CELLS || pieces == 1 {
            return (grids, cells as u32);
        }
        pieces /= 2;
    }
}

fn split(boxes: &[(Vec3, Vec3)], pieces: u32) -> (Vec<ObjectGrid>, u64) {
    let mut cells_before = 0u64;
    let grids = boxes
        .iter()
        .map(|&(low, high)| {
            let extent = high - low;
            let side = extent.max_element() / pieces as f32;
            // An object without triangles has no photons.
            let empty = !(side > 0.0 && side.is_finite());
            let cells = if empty {
                [1; 3]
            } else {
                (extent / side)
                    .to_array()
                    .map(|along| (along.ceil() as u32).clamp(1, pieces))
            };
            let grid = ObjectGrid {
                low: if empty { [0.0; 3] } else { low.to_array() },
                inverse_cell: if empty { 0.0 } else { 1.0 / side },
                cells,
                first_cell: cells_before as u32,
            };
            cells_before += cells.iter().map(|&count| u64::from(count)).product::<u64>();
            grid
        })
        .collect();
    (grids, cells_before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_axis_has_all_pieces_and_the_cubes_are_numbered_object_after_object() {
        let boxes = [
            (Vec3::ZERO, Vec3::new(1.0, 0.5, 0.0)),
            (Vec3::new(-1.0, 0.0, 0.0), Vec3::new(-0.5, 0.1, 0.25)),
        ];
        let (grids, cells) = split(&boxes, 8);
        assert_eq!((grids[0].cells, grids[0].first_cell), ([8, 4, 1], 0));
        assert_eq!((grids[1].cells, grids[1].first_cell), ([8, 2, 4], 32));
        assert_eq!(cells, 96);
    }

    #[test]
    fn an_object_without_triangles_has_one_cube() {
        let (grids, cells) = split(&[(Vec3::INFINITY, Vec3::NEG_INFINITY)], 8);
        assert_eq!((grids[0].cells, grids[0].inverse_cell, cells), ([1; 3], 0.0, 1));
    }
}
