//! Textures: images, and how materials look up values in them.

use std::sync::LazyLock;

use glam::{DVec2, DVec4, UVec2, dvec4};

use crate::layout::{CLAMP, MIRROR_REPEAT, NEAREST, SECOND_SET, SRGB, TextureLookup, WRAP_U, WRAP_V};

/// All textures of a scene, in the layout of the device.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Textures {
    /// The look-up of each texture.
    pub lookups: Vec<TextureLookup>,
    /// Texels of all images, RGBA bytes.
    pub texels: Vec<u32>,
}

impl Textures {
    /// The value of a texture, RGBA, linear; `sets` are the coordinates of both sets.
    pub fn value(&self, index: u32, sets: [DVec2; 2]) -> DVec4 {
        self.lookups[index as usize].value(&self.texels, sets)
    }
}

impl TextureLookup {
    /// The value of the texture, RGBA, linear; `sets` are the coordinates of both sets. There are no mip levels: a pixel averages
    /// many positions.
    pub fn value(&self, texels: &[u32], sets: [DVec2; 2]) -> DVec4 {
        // Beyond that, floats do not distinguish texels; NaN fails the comparison.
        let [u, v] = self
            .place(sets)
            .to_array()
            .map(|at| if at.abs() < 8_388_608.0 { at } else { 0.0 });
        let texel = |x: f64, y: f64| self.texel(texels, [x as i64, y as i64]);
        if self.flags & NEAREST != 0 {
            return texel(u.floor(), v.floor());
        }
        let (u, v) = (u - 0.5, v - 0.5);
        let (x, y) = (u.floor(), v.floor());
        let row = |y| texel(x, y).lerp(texel(x + 1.0, y), u - x);
        row(y).lerp(row(y + 1.0), v - y)
    }

    /// Position of the look-up, in texels.
    fn place(&self, sets: [DVec2; 2]) -> DVec2 {
        let set = sets[usize::from(self.flags & SECOND_SET != 0)];
        let place = |row: [f32; 3]| f64::from(row[0]) * set.x + f64::from(row[1]) * set.y + f64::from(row[2]);
        DVec2::new(place(self.row_u), place(self.row_v)) * self.size().as_dvec2()
    }

    /// Size of its image, in texels.
    fn size(&self) -> UVec2 {
        UVec2::new(self.size & 0xffff, self.size >> 16)
    }

    /// Linear RGBA; outside of the image by its wrap modes.
    fn texel(&self, texels: &[u32], [x, y]: [i64; 2]) -> DVec4 {
        let size = self.size();
        let column = wrap(x, size.x, self.flags >> WRAP_U);
        let row = wrap(y, size.y, self.flags >> WRAP_V);
        decode(
            texels[(self.first_texel + row * size.x + column) as usize],
            self.flags & SRGB != 0,
        )
    }

    /// Number of texels along the longest side of a triangle.
    pub(crate) fn texels_across(&self, corners: [[DVec2; 2]; 3]) -> f64 {
        let [a, b, c] = corners.map(|sets| self.place(sets));
        [b - a, c - b, a - c]
            .map(|way| way.abs().max_element())
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// The maximum of a function of texels over those that points of a triangle read, or 1 if there are many: an upper bound of
    /// its value at any point.
    pub(crate) fn most(&self, texels: &[u32], corners: [[DVec2; 2]; 3], value: impl Fn(DVec4) -> f64) -> f64 {
        const MOST_READ: f64 = 1024.0;
        let [a, b, c] = corners.map(|sets| self.place(sets));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // As rounded by a device.
        let off = 0.01 + 1e-6 * low.abs().max(high.abs());
        let beside = if self.flags & NEAREST != 0 { 0.0 } else { 0.5 };
        let (first, last) = ((low - off - beside).floor(), (high + off + beside).floor());
        let read = (last - first + 1.0).element_product();
        // NaN fails the comparison.
        if !(read <= MOST_READ && low.abs().max(high.abs()).max_element() < 4_194_304.0) {
            return 1.0;
        }
        let (first, last) = (first.as_i64vec2(), last.as_i64vec2());
        let places = (first.y..=last.y).flat_map(|y| (first.x..=last.x).map(move |x| [x, y]));
        places.map(|at| value(self.texel(texels, at))).fold(0.0, f64::max)
    }
}

/// The texel at a position along one side of an image.
fn wrap(place: i64, count: u32, mode: u32) -> u32 {
    let count = i64::from(count);
    (match mode & 3 {
        CLAMP => place.clamp(0, count - 1),
        MIRROR_REPEAT => {
            let place = place.rem_euclid(2 * count);
            place.min(2 * count - 1 - place)
        }
        _ => place.rem_euclid(count),
    }) as u32
}

fn decode(texel: u32, srgb: bool) -> DVec4 {
    let [r, g, b, a] = texel.to_le_bytes();
    let [plain, decoded] = &*LINEAR;
    let linear = |byte: u8| if srgb { decoded } else { plain }[usize::from(byte)];
    dvec4(linear(r), linear(g), linear(b), plain[usize::from(a)])
}

/// The value of a byte as linear and as sRGB: IEC 61966-2-1.
static LINEAR: LazyLock<[[f64; 256]; 2]> = LazyLock::new(|| {
    let plain = std::array::from_fn(|byte| byte as f64 / 255.0);
    let decoded = |value: f64| match value {
        dark if dark <= 0.040_45 => dark / 12.92,
        bright => ((bright + 0.055) / 1.055).powf(2.4),
    };
    [plain, plain.map(decoded)]
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::REPEAT;

    /// Two by two texels: black, red; green, white.
    fn checker(flags: u32) -> Textures {
        Textures {
            lookups: vec![TextureLookup {
                row_u: [1.0, 0.0, 0.0],
                first_texel: 0,
                row_v: [0.0, 1.0, 0.0],
                size: 2 | 2 << 16,
                flags,
                padding0: 0,
                padding1: 0,
                padding2: 0,
            }],
            texels: vec![0xff00_0000, 0xff00_00ff, 0xff00_ff00, 0xffff_ffff],
        }
    }

    fn at(textures: &Textures, u: f64, v: f64) -> [f64; 4] {
        textures.value(0, [DVec2::new(u, v), DVec2::ZERO]).to_array()
    }

    #[test]
    fn the_nearest_texel_is_taken_or_four_are_blended() {
        let nearest = checker(NEAREST);
        assert_eq!(at(&nearest, 0.1, 0.1), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&nearest, 0.9, 0.1), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&nearest, 0.1, 0.9), [0.0, 1.0, 0.0, 1.0]);
        let blended = checker(0);
        assert_eq!(at(&blended, 0.25, 0.25), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&blended, 0.5, 0.5), [0.5, 0.5, 0.25, 1.0]);
    }

    #[test]
    fn places_outside_wrap_as_the_sampler_says() {
        let with = |mode| checker(NEAREST | mode << WRAP_U | mode << WRAP_V);
        let red = [1.0, 0.0, 0.0, 1.0];
        // 1.25 is in the first texel again, in the last still, in the last once more.
        assert_eq!(at(&with(REPEAT), 1.25, 0.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&with(CLAMP), 1.25, 0.0), red);
        assert_eq!(at(&with(MIRROR_REPEAT), 1.25, 0.0), red);
        assert_eq!(at(&with(REPEAT), -0.25, 0.0), red);
        assert_eq!(at(&with(CLAMP), -7.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&with(MIRROR_REPEAT), -0.75, 0.0), red);
    }

    #[test]
    fn srgb_is_decoded_before_texels_are_blended() {
        let blended = at(&checker(SRGB), 0.5, 0.25);
        assert_eq!(blended[0], 0.5);
        let mut grey = checker(SRGB | NEAREST);
        grey.texels[0] = 0x80bc_bcbc;
        let [value, .., alpha] = at(&grey, 0.0, 0.0);
        assert!((value - 0.502_886).abs() < 1e-5, "{value}");
        assert!((alpha - 128.0 / 255.0).abs() < 1e-12, "{alpha}");
    }
}
