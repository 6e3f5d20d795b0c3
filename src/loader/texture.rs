//! Textures: images, and how materials look up values in them.

use crate::loader::extensions::{BASISU, WEBP};
use crate::scene::Textures;
use std::collections::HashMap;
use std::path::Path;

use gltf_json::extensions::texture::TextureTransform;
use gltf_json::texture::{MagFilter, WrappingMode};
use gltf_json::validation::Checked;

use super::diagnostic::{Check, damaged, label};
use super::file::document::Document;
use super::file::image::Pixels;
use crate::layout::{CLAMP, MIRROR_REPEAT, NEAREST, REPEAT, SECOND_SET, SRGB, TextureLookup, WRAP_U, WRAP_V};
use crate::text::list;

/// Source of a texture that names no image.
const NO_SOURCE: usize = u32::MAX as usize;

/// A material's reference to a texture, for any use.
#[derive(Debug, Clone)]
pub(crate) struct TextureUse {
    /// Index of the texture.
    pub texture: usize,
    /// Set of coordinates.
    pub set: u32,
    pub transform: Option<TextureTransform>,
    /// Whether its colours are sRGB.
    pub srgb: bool,
}

/// Collects the textures that materials use.
pub(crate) struct TextureReader<'a> {
    document: &'a Document,
    folder: &'a Path,
    textures: Textures,
    /// First texel and size of each image that has been read; `None` if it can't be.
    images: HashMap<usize, Option<[u32; 2]>>,
}

impl<'a> TextureReader<'a> {
    /// Reads textures of a file in `folder`.
    pub(crate) fn new(document: &'a Document, folder: &'a Path) -> Self {
        Self {
            document,
            folder,
            textures: Textures::default(),
            images: HashMap::new(),
        }
    }

    /// All textures that have been read.
    pub(crate) fn finish(self) -> Textures {
        self.textures
    }

    /// Index of a lookup; `None`, with a warning, for an image that can't be read.
    pub(crate) fn lookup(&mut self, wanted: &TextureUse, warnings: &mut Vec<String>) -> Check<Option<u32>> {
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
    /// First texel and size of a texture's image: the first one of its alternatives that can be read.
    fn image(
        &mut self,
        index: usize,
        texture: &gltf_json::Texture,
        warnings: &mut Vec<String>,
    ) -> Check<Option<[u32; 2]>> {
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
                        None => "its textures are left out, and materials have only their factors".to_owned(),
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

/// First texel of an image of this size, after the others. Kernels index texels by 32 bits.
fn first_texel(before: u64, count: u64) -> Check<u32> {
    let most = u64::from(u32::MAX);
    let fits = before.checked_add(count).is_some_and(|all| all <= most);
    u32::try_from(before).ok().filter(|_| fits).ok_or_else(|| {
        format!(
            "its images have {before} texels and {count} more, of which {most} at the most are read; make them smaller"
        )
    })
}

/// The images of a texture, in order of preference: those of extensions are better than the fallback for programs that do not
/// know them.
fn sources(texture: &gltf_json::Texture) -> Vec<usize> {
    let extensions = texture.extensions.as_ref();
    let of_extension = |name| {
        let source = extensions?.others.get(name)?.get("source")?.as_u64()?;
        Some(usize::try_from(source).unwrap_or(NO_SOURCE))
    };
    let plain = Some(texture.source.value()).filter(|&source| source != NO_SOURCE);
    [of_extension(WEBP), of_extension(BASISU), plain]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_beyond_what_32_bits_count_are_refused() {
        assert_eq!(first_texel(0, 1), Ok(0));
        assert_eq!(first_texel((1 << 32) - 5, 4), Ok(u32::MAX - 4));
        for (before, count) in [((1 << 32) - 5, 5), (1 << 32, 1), (1, u64::MAX), (u64::MAX, 1)] {
            let error = first_texel(before, count).expect_err("more than 32 bits count");
            assert!(error.contains("4294967295 at the most"), "{error}");
        }
    }
}
