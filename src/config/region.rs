//! The pixels of a picture that are rendered.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{Estimator, RenderConfig, pixel_of};
use crate::layout::TILE;

/// A rectangle of a picture's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// Its first pixel, from the picture's upper left corner.
    pub origin: [u32; 2],
    /// Pixels, width and height.
    pub size: [u32; 2],
}

impl Region {
    /// All pixels of a picture.
    pub fn whole(size: [u32; 2]) -> Self {
        Self { origin: [0, 0], size }
    }

    /// Number of its pixels.
    pub fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Slots for its pixels: whole tiles.
    pub fn slots(&self) -> u32 {
        let [width, height] = self.size;
        width.div_ceil(TILE) * height.div_ceil(TILE) * TILE * TILE
    }

    /// The parts of rows that belong to `inner`, which lies within.
    pub fn cut<T: Clone>(&self, inner: &Self, rows: Vec<T>) -> Vec<T> {
        if self == inner {
            return rows;
        }
        let [x, y] = [0, 1].map(|axis| (inner.origin[axis] - self.origin[axis]) as usize);
        let [width, height] = inner.size.map(|side| side as usize);
        let rows = rows.chunks_exact(self.size[0] as usize).skip(y).take(height);
        rows.flat_map(|row| &row[x..x + width]).cloned().collect()
    }

    /// Replaces in `all`, of this region, what belongs to `inner`, which lies within; `each` values a pixel.
    pub fn paste<T: Copy>(&self, inner: &Self, values: &[T], all: &mut [T], each: usize) {
        let [x, y] = [0, 1].map(|axis| (inner.origin[axis] - self.origin[axis]) as usize);
        let [row, length] = [self, inner].map(|region| region.size[0] as usize * each);
        let rows = all.chunks_exact_mut(row).skip(y);
        for (row, values) in rows.zip(values.chunks_exact(length)) {
            row[x * each..][..length].copy_from_slice(values);
        }
    }

    /// Crops of at most `side` pixels in width and height that cover it, row by row, of similar size.
    pub fn crops(&self, side: u32) -> Vec<Self> {
        let [columns, rows] = [0, 1].map(|axis| {
            let count = self.size[axis].div_ceil(side);
            let step = self.size[axis].div_ceil(count);
            (0..count).map(move |number| {
                let low = number * step;
                (self.origin[axis] + low, step.min(self.size[axis] - low))
            })
        });
        let row = |(y, height): (u32, u32)| {
            columns.clone().map(move |(x, width)| Self {
                origin: [x, y],
                size: [width, height],
            })
        };
        rows.flat_map(row).collect()
    }

    /// With `margin` more pixels on each side, and from a tile's first pixel on, within a picture of this size.
    fn widened(&self, margin: u32, resolution: [u32; 2]) -> Self {
        let low = self.origin.map(|low| low.saturating_sub(margin) / TILE * TILE);
        let size = std::array::from_fn(|axis| {
            let high = self.origin[axis] + self.size[axis] + margin;
            high.min(resolution[axis]) - low[axis]
        });
        Self { origin: low, size }
    }
}

impl fmt::Display for Region {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            origin: [x, y],
            size: [width, height],
        } = self;
        write!(text, "{x},{y},{width}x{height}")
    }
}

/// Maximum number of pixels of a picture all of whose pixels are guides.
const MOST_OF_WHOLE: u64 = 1 << 16;
/// Maximum number of guides of a larger picture.
const MOST_GUIDES: u32 = 1 << 14;
/// Pixels around a crop that are rendered too. A caustic disc's initial radius depends on those of the pixels around it, see
/// [`crate::radius::sharpen`]: R is 8 pixels at most and grows by a fifth of a pixel from one to the next, which makes 38.
const MARGIN: u32 = 40;

/// Pixels from which is learned what all pixels share: where photons start, the first radii, the cell sizes of grids. They cover
/// the whole picture evenly, also if a part of it is rendered, so that a crop has the bits of the whole. A small picture's guides
/// are all of its pixels. Those of a larger one are rendered in addition, into slots of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
pub struct GuidePixels {
    /// Pixels between neighbours.
    pub step: u32,
    /// Guides in a row, and rows; 0 if all pixels are guides.
    pub size: [u32; 2],
}

impl GuidePixels {
    fn of([width, height]: [u32; 2]) -> Self {
        let size = |step: u32| [width.div_euclid(step).max(1), height.div_euclid(step).max(1)];
        let fits = |step: &u32| size(*step).into_iter().product::<u32>() <= MOST_GUIDES;
        let step = (1..=width.max(height)).find(fits).unwrap_or(1);
        Self { step, size: size(step) }
    }

    /// Their slots: whole tiles.
    pub fn slots(&self) -> u32 {
        Region::whole(self.size).slots()
    }

    /// Whether one of [`GuidePixels::slots`] has a pixel.
    pub fn has(&self, slot: u32) -> bool {
        pixel_of(self.size, slot).is_some()
    }
}

impl RenderConfig {
    /// Width and height of what is shown: the crop, or the whole picture.
    pub fn shown(&self) -> Region {
        self.crop.unwrap_or(Region::whole(self.resolution))
    }

    /// Whether all of a picture's pixels are guides. The paper's estimator learns nothing from them.
    fn is_guided_by_all(&self) -> bool {
        self.estimator == Estimator::Ppm || Region::whole(self.resolution).pixels() <= MOST_OF_WHOLE
    }

    /// The pixels that are rendered, beside the guides: at least those that are shown.
    pub fn region(&self) -> Region {
        match self.crop {
            Some(crop) if !self.is_guided_by_all() => crop.widened(MARGIN, self.resolution),
            _ => Region::whole(self.resolution),
        }
    }

    /// The guides; without size if all pixels are guides.
    pub fn guides(&self) -> GuidePixels {
        if self.is_guided_by_all() {
            GuidePixels::default()
        } else {
            GuidePixels::of(self.resolution)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guides_cover_a_large_picture_evenly_and_are_few() {
        for resolution in [[1280, 720], [16384, 16384], [16384, 5], [7680, 4320], [257, 256]] {
            let GuidePixels { step, size } = GuidePixels::of(resolution);
            assert!(size[0] * size[1] <= MOST_GUIDES, "{resolution:?}: {size:?}");
            assert!(size[0] * size[1] > MOST_GUIDES / 4, "{resolution:?}: {size:?}");
            for axis in 0..2 {
                let last = (size[axis] - 1) * step + step / 2;
                let left = resolution[axis].saturating_sub(last + 1);
                assert!(left <= 2 * step, "{resolution:?}: {left} pixels behind the last guide");
                assert!(
                    last < resolution[axis] || size[axis] == 1,
                    "{resolution:?}: a guide outside"
                );
            }
        }
    }

    #[test]
    fn crops_cover_a_region_once() {
        let region = Region {
            origin: [3, 5],
            size: [101, 47],
        };
        let mut covered = vec![0; 101 * 47];
        for crop in region.crops(20) {
            assert!(crop.size.iter().all(|&side| (1..=20).contains(&side)), "{crop}");
            let ones: Vec<i32> = region
                .cut(&crop, covered.clone())
                .iter()
                .map(|count| count + 1)
                .collect();
            region.paste(&crop, &ones, &mut covered, 1);
        }
        assert!(covered.iter().all(|&count| count == 1), "{covered:?}");
        assert_eq!(region.crops(200), [region]);
    }

    #[test]
    fn a_crop_is_widened_to_tiles_within_the_picture() {
        let crop = Region {
            origin: [50, 3],
            size: [10, 20],
        };
        let widened = crop.widened(MARGIN, [1000, 40]);
        assert_eq!((widened.origin, widened.size), ([8, 0], [92, 40]));
        let rows: Vec<u32> = (0..92 * 40).collect();
        let cut = widened.cut(&crop, rows);
        assert_eq!((cut.len(), cut[0], cut[199]), (200, 3 * 92 + 42, 22 * 92 + 51));
    }
}
