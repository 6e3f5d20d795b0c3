//! Textures: which places of which images a material looks its values up at.

use std::collections::HashMap;
use std::path::Path;
use std::sync::LazyLock;

use glam::{DVec2, DVec4, UVec2, dvec4};
use gltf::json;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;

use super::diagnostic::{Check, damaged, label, list};
use super::document::Document;
use super::image::Pixels;
use super::ktx2;
use crate::layout::{CLAMP, MIRROR_REPEAT, NEAREST, REPEAT, SECOND_SET, SRGB, TextureLookup, WRAP_U, WRAP_V};

/// Allows textures to be WebP.
pub(super) const WEBP: &str = "EXT_texture_webp";

/// Source of a texture that names no image.
const NO_SOURCE: usize = u32::MAX as usize;

/// All textures of a scene, in the layout of the device.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Textures {
    /// How each is looked up.
    pub lookups: Vec<TextureLookup>,
    /// Texels of all images, RGBA bytes.
    pub texels: Vec<u32>,
}

/// What a material says of one of its textures, whatever it is for.
#[derive(Debug, Clone)]
pub(super) struct TextureUse {
    /// Index of the texture.
    pub texture: usize,
    /// Set of coordinates.
    pub set: u32,
    pub transform: Option<TextureTransform>,
    /// Whether its colours are sRGB.
    pub srgb: bool,
}

/// Collects the textures that materials use.
pub(super) struct TextureReader<'a> {
    document: &'a Document,
    folder: &'a Path,
    textures: Textures,
    /// First texel and size of each image that has been read; `None` of one that can't be.
    images: HashMap<usize, Option<[u32; 2]>>,
}

impl<'a> TextureReader<'a> {
    /// Reads textures of a file in `folder`.
    pub(super) fn new(document: &'a Document, folder: &'a Path) -> Self {
        Self {
            document,
            folder,
            textures: Textures::default(),
            images: HashMap::new(),
        }
    }

    /// All that have been read.
    pub(super) fn finish(self) -> Textures {
        self.textures
    }

    /// Index of a lookup; `None`, with a warning, for an image that can't be read.
    pub(super) fn lookup(&mut self, wanted: &TextureUse, warnings: &mut Vec<String>) -> Check<Option<u32>> {
        let root = &self.document.root;
        let textures = &root.textures;
        let texture = textures.get(wanted.texture).ok_or_else(|| {
            damaged(format_args!(
                "there is no texture {}, the file has {}",
                wanted.texture,
                textures.len()
            ))
        })?;
        let Some([first_texel, size]) = self.image(wanted.texture, texture, warnings)? else {
            return Ok(None);
        };
        let sampler = texture.sampler.map(|sampler| {
            root.samplers.get(sampler.value()).ok_or_else(|| {
                damaged(format_args!(
                    "there is no sampler {sampler}, the file has {}",
                    root.samplers.len()
                ))
            })
        });
        let sampler = sampler.transpose()?;
        let wrap = |mode: Option<&Checked<WrappingMode>>| match mode {
            Some(Checked::Valid(WrappingMode::ClampToEdge)) => CLAMP,
            Some(Checked::Valid(WrappingMode::MirroredRepeat)) => MIRROR_REPEAT,
            _ => REPEAT,
        };
        let nearest = sampler.is_some_and(|sampler| sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest)));
        let transform = wanted.transform.as_ref();
        let set = transform
            .and_then(|transform| transform.tex_coord)
            .unwrap_or(wanted.set);
        if set > 1 {
            warnings.push(format!(
                "its TEXCOORD_{set} isn't read, only sets 0 and 1 are; set 0 is used, and the texture lies elsewhere than meant: export \
                 it with set 0 or 1"
            ));
        }
        let [row_u, row_v] = rows(transform)?;
        let lookup = TextureLookup {
            row_u,
            first_texel,
            row_v,
            size,
            flags: if set == 1 { SECOND_SET } else { 0 }
                | if wanted.srgb { SRGB } else { 0 }
                | if nearest { NEAREST } else { 0 }
                | wrap(sampler.map(|sampler| &sampler.wrap_s)) << WRAP_U
                | wrap(sampler.map(|sampler| &sampler.wrap_t)) << WRAP_V,
            padding0: 0,
            padding1: 0,
            padding2: 0,
        };
        let lookups = &mut self.textures.lookups;
        let known = lookups.iter().position(|known| *known == lookup);
        Ok(Some(known.unwrap_or_else(|| {
            lookups.push(lookup);
            lookups.len() - 1
        }) as u32))
    }
}

impl TextureReader<'_> {
    /// First texel and size of the image of a texture: the first one that can be read of those that it names.
    fn image(&mut self, index: usize, texture: &json::Texture, warnings: &mut Vec<String>) -> Check<Option<[u32; 2]>> {
        let images = &self.document.root.images;
        let named = sources(texture);
        if named.is_empty() {
            let extensions = texture.extensions.as_ref();
            let extensions: Vec<String> =
                extensions.map_or(Vec::new(), |extensions| extensions.others.keys().cloned().collect());
            warnings.push(format!(
                "texture {index} has no image but by {}, which isn't supported; it is left out",
                if extensions.is_empty() {
                    "nothing".to_owned()
                } else {
                    list(&extensions)
                }
            ));
        }
        for (place, &source) in named.iter().enumerate() {
            let image = images.get(source).ok_or_else(|| {
                damaged(format_args!(
                    "there is no image {source}, the file has {}",
                    images.len()
                ))
            })?;
            if let Some(known) = self.images.get(&source) {
                if known.is_some() {
                    return Ok(*known);
                }
                continue;
            }
            match Pixels::read(self.document, image, self.folder) {
                Ok(pixels) => {
                    let added = Some(self.add(&pixels)?);
                    self.images.insert(source, added);
                    return Ok(added);
                }
                Err(what) => {
                    self.images.insert(source, None);
                    let instead = match named.get(place + 1) {
                        Some(fallback) => format!("image {fallback} stands for it"),
                        None => "its textures are left out, and materials have their factors alone".to_owned(),
                    };
                    let label = label("image", source, image.name.as_deref());
                    warnings.push(format!("{label}: {what}; {instead}"));
                }
            }
        }
        Ok(None)
    }

    /// Adds an image; returns its first texel and its size.
    fn add(&mut self, pixels: &Pixels) -> Check<[u32; 2]> {
        let texels = &mut self.textures.texels;
        let first = first_texel(texels.len() as u64, pixels.rgba.len() as u64)?;
        texels.extend(pixels.rgba.iter().map(|rgba| u32::from_le_bytes(*rgba)));
        Ok([first, pixels.width | pixels.height << 16])
    }
}

/// Where an image of so many texels begins after those of the others. Kernels count texels in 32 bits.
fn first_texel(before: u64, count: u64) -> Check<u32> {
    let most = u64::from(u32::MAX);
    let fits = before.checked_add(count).is_some_and(|all| all <= most);
    u32::try_from(before).ok().filter(|_| fits).ok_or_else(|| {
        format!(
            "its images have {before} texels and {count} more, of which {most} at the most are read; make them smaller"
        )
    })
}

/// The images that a texture names, each to stand for those before it: what extensions name is better than what is there for
/// programs that don't know them.
fn sources(texture: &json::Texture) -> Vec<usize> {
    let extensions = texture.extensions.as_ref();
    let of_extension = |name| {
        let source = extensions?.others.get(name)?.get("source")?.as_u64()?;
        Some(usize::try_from(source).unwrap_or(NO_SOURCE))
    };
    let plain = Some(texture.source.value()).filter(|&source| source != NO_SOURCE);
    [of_extension(WEBP), of_extension(ktx2::EXTENSION), plain]
        .into_iter()
        .flatten()
        .collect()
}

/// KHR_texture_transform: offset · rotation · scale.
fn rows(transform: Option<&TextureTransform>) -> Check<[[f32; 3]; 2]> {
    let Some(transform) = transform else {
        return Ok([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    };
    let ([x, y], [w, h]) = (transform.offset.0, transform.scale.0);
    let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
    let (sin, cos) = (sin as f32, cos as f32);
    let rows = [[cos * w, sin * h, x], [-sin * w, cos * h, y]];
    if rows.as_flattened().iter().all(|value| value.is_finite()) {
        Ok(rows)
    } else {
        Err(damaged("its KHR_texture_transform isn't finite"))
    }
}

impl Textures {
    /// The value of a texture, RGBA, linear; `sets` are the coordinates of both sets.
    pub fn value(&self, index: u32, sets: [DVec2; 2]) -> DVec4 {
        self.lookups[index as usize].value(&self.texels, sets)
    }
}

impl TextureLookup {
    /// The value of the texture, RGBA, linear; `sets` are the coordinates of both sets. There are no mip levels: a pixel is
    /// the mean of many places.
    pub fn value(&self, texels: &[u32], sets: [DVec2; 2]) -> DVec4 {
        // Past that, floats have no texels apart; NaN fails the comparison.
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

    /// Where it is looked up, in texels.
    fn place(&self, sets: [DVec2; 2]) -> DVec2 {
        let set = sets[usize::from(self.flags & SECOND_SET != 0)];
        let place = |row: [f32; 3]| f64::from(row[0]) * set.x + f64::from(row[1]) * set.y + f64::from(row[2]);
        DVec2::new(place(self.row_u), place(self.row_v)) * self.size().as_dvec2()
    }

    /// Of its image, in texels.
    fn size(&self) -> UVec2 {
        UVec2::new(self.size & 0xffff, self.size >> 16)
    }

    /// Linear RGBA; where the image doesn't reach, what its wraps say.
    fn texel(&self, texels: &[u32], [x, y]: [i64; 2]) -> DVec4 {
        let size = self.size();
        let column = wrap(x, size.x, self.flags >> WRAP_U);
        let row = wrap(y, size.y, self.flags >> WRAP_V);
        decode(
            texels[(self.first_texel + row * size.x + column) as usize],
            self.flags & SRGB != 0,
        )
    }

    /// Texels along the longest way across a triangle.
    pub(super) fn texels_across(&self, corners: [[DVec2; 2]; 3]) -> f64 {
        let [a, b, c] = corners.map(|sets| self.place(sets));
        [b - a, c - b, a - c]
            .map(|way| way.abs().max_element())
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// The largest value that a function of texels has among those that places of a triangle read, or 1 where they are many: at no
    /// place the texture's is above that.
    pub(super) fn most(&self, texels: &[u32], corners: [[DVec2; 2]; 3], value: impl Fn(DVec4) -> f64) -> f64 {
        const MOST_READ: f64 = 1024.0;
        let [a, b, c] = corners.map(|sets| self.place(sets));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Where a device has rounded them to.
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

/// The texel of an image of so many along one side that stands at a place.
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

/// What a byte means as it is, and as sRGB: IEC 61966-2-1.
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
    fn images_beyond_what_32_bits_count_are_refused() {
        assert_eq!(first_texel(0, 1), Ok(0));
        assert_eq!(first_texel((1 << 32) - 5, 4), Ok(u32::MAX - 4));
        for (before, count) in [((1 << 32) - 5, 5), (1 << 32, 1), (1, u64::MAX), (u64::MAX, 1)] {
            let error = first_texel(before, count).expect_err("more than 32 bits count");
            assert!(error.contains("4294967295 at the most"), "{error}");
        }
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
