//! The order of pixels in memory: `glsl/gather/visible_point.glsl`.

use crate::layout::TILE;

/// The pixel of a slot, `None` if it lies outside of the picture. Tiles lie row by row; within a tile the bits of the number
/// inside are, from the lowest, x0 x1 y0 x2 y1 y2.
pub fn pixel_of(resolution: [u32; 2], pixel_slot: u32) -> Option<[u32; 2]> {
    let tiles_across = resolution[0].div_ceil(TILE);
    let (tile, inside) = (pixel_slot / (TILE * TILE), pixel_slot % (TILE * TILE));
    let bit = |from: u32, to: u32| (inside >> from & 1) << to;
    let x = tile % tiles_across * TILE + (bit(0, 0) | bit(1, 1) | bit(3, 2));
    let y = tile / tiles_across * TILE + (bit(2, 0) | bit(4, 1) | bit(5, 2));
    let [width, height] = resolution;
    (x < width && y < height).then_some([x, y])
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_pixel_has_one_slot_in_its_tile() {
        let resolution = [19, 9];
        let slots = 3 * 2 * 64;
        let mut seen = HashSet::new();
        for slot in 0..slots {
            if let Some([x, y]) = pixel_of(resolution, slot) {
                assert_eq!(slot / 64, y / 8 * 3 + x / 8, "pixel {x}, {y} lies in another tile");
                assert!(seen.insert([x, y]), "pixel {x}, {y} has two slots");
            }
        }
        assert_eq!(seen.len(), 19 * 9);
    }
}
