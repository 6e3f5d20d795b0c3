//! Extensions of materials that the `gltf` crate doesn't know: each with its reader, what it checks, and its textures.

use gltf_json::Material;
use gltf_json::material::NormalTexture;
use gltf_json::texture::Info;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::{Reader, color, linear, used_normals};
use crate::loader::diagnostic::{Check, damaged};
use crate::loader::texture::TextureUse;
use crate::scene::{Anisotropy, Coat, Layers, MaterialTextures, Sheen};

const CLEARCOAT: &str = "KHR_materials_clearcoat";
const SHEEN: &str = "KHR_materials_sheen";
const ANISOTROPY: &str = "KHR_materials_anisotropy";

/// Their names.
pub(crate) const EXTENSIONS: &[&str] = &[CLEARCOAT, SHEEN, ANISOTROPY];

/// What a material says of its coat.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Info>,
    clearcoat_normal_texture: Option<NormalTexture>,
}

/// What it says of its sheen.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct SheenExtension {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<Info>,
}

/// What it says of its anisotropy.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct AnisotropyExtension {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
    anisotropy_texture: Option<Info>,
}

/// An extension of a material; `None` where it has none.
fn extension<T: DeserializeOwned>(material: &Material, name: &str) -> Check<Option<T>> {
    let extensions = material.extensions.as_ref();
    let Some(extension) = extensions.and_then(|extensions| extensions.others.get(name)) else {
        return Ok(None);
    };
    let read = serde_json::from_value(extension.clone());
    read.map(Some)
        .map_err(|error| damaged(format_args!("its {name}: {error}")))
}

/// The texture whose coordinates tangents follow, of a material that needs some: its set, and its extensions.
fn tangent_texture(material: &Material) -> Option<NormalTexture> {
    let of_coat = || {
        extension::<Clearcoat>(material, CLEARCOAT)
            .ok()??
            .clearcoat_normal_texture
    };
    material.normal_texture.clone().or_else(of_coat)
}

/// The set of texture coordinates that a material's tangents follow, if it needs some: that of its normal texture, or else of the
/// coat's.
pub(crate) fn tangent_set(material: &Material) -> Option<usize> {
    let Some(texture) = tangent_texture(material) else {
        return anisotropy_set(material);
    };
    let extensions = texture.extensions.as_ref();
    let transform = extensions.and_then(|extensions| extensions.others.get("KHR_texture_transform"));
    let set = transform.and_then(|transform| transform.get("texCoord")?.as_u64());
    usize::try_from(set.unwrap_or(texture.tex_coord.into()))
        .ok()
        .filter(|&set| set < 2)
}

/// The same for anisotropy: that of its texture, or the first.
fn anisotropy_set(material: &Material) -> Option<usize> {
    let anisotropy = extension::<AnisotropyExtension>(material, ANISOTROPY).ok()??;
    let set = anisotropy.anisotropy_texture.as_ref().map_or(0, |info| {
        let texture = linear(info);
        texture.transform.and_then(|it| it.tex_coord).unwrap_or(texture.set)
    });
    (anisotropy.anisotropy_strength > 0.0 && set < 2).then_some(set as usize)
}

impl Reader<'_> {
    pub(super) fn layers(&mut self) -> Check<Layers> {
        Ok(Layers {
            coat: self.coat()?,
            sheen: self.sheen()?,
            anisotropy: self.anisotropy()?,
        })
    }

    /// Their textures, and where those belong.
    pub(super) fn layer_textures<'t>(
        &self,
        textures: &'t mut MaterialTextures,
    ) -> Check<Vec<(&'t mut Option<u32>, Option<TextureUse>)>> {
        let coat: Clearcoat = extension(self.json, CLEARCOAT)?.unwrap_or_default();
        let sheen: SheenExtension = extension(self.json, SHEEN)?.unwrap_or_default();
        let anisotropy: AnisotropyExtension = extension(self.json, ANISOTROPY)?.unwrap_or_default();
        let coat_normal = coat.clearcoat_normal_texture.as_ref();
        textures.coat_normal_scale = coat_normal.map_or(0.0, |texture| texture.scale);
        let coat_normal = coat_normal.map(|texture| used_normals("clearcoatNormalTexture", texture));
        Ok(vec![
            (&mut textures.coat, coat.clearcoat_texture.as_ref().map(linear)),
            (
                &mut textures.coat_roughness,
                coat.clearcoat_roughness_texture.as_ref().map(linear),
            ),
            (&mut textures.coat_normal, coat_normal.transpose()?),
            (&mut textures.sheen, sheen.sheen_color_texture.as_ref().map(color)),
            (
                &mut textures.sheen_roughness,
                sheen.sheen_roughness_texture.as_ref().map(linear),
            ),
            (
                &mut textures.anisotropy,
                anisotropy.anisotropy_texture.as_ref().map(linear),
            ),
        ])
    }

    fn coat(&mut self) -> Check<Coat> {
        let coat: Clearcoat = extension(self.json, CLEARCOAT)?.unwrap_or_default();
        let [factor] = self.fractions("clearcoatFactor", [coat.clearcoat_factor])?;
        let [roughness] = self.fractions("clearcoatRoughnessFactor", [coat.clearcoat_roughness_factor])?;
        Ok(Coat { factor, roughness })
    }

    fn anisotropy(&mut self) -> Check<Anisotropy> {
        let anisotropy: AnisotropyExtension = extension(self.json, ANISOTROPY)?.unwrap_or_default();
        let [strength] = self.fractions("anisotropyStrength", [anisotropy.anisotropy_strength])?;
        let rotation = anisotropy.anisotropy_rotation;
        if !rotation.is_finite() {
            return Err(format!(
                "its anisotropyRotation is {rotation}, but it must be finite; correct it in the file"
            ));
        }
        let transmits = self.extension(|extensions| extensions.transmission.as_ref());
        if strength > 0.0 && transmits.is_some_and(|it| it.transmission_factor.0 > 0.0) {
            self.warn(
                "its anisotropy applies only to the part of it that transmits no light, where its roughness is above 0.03; \
                 the rest is isotropic"
                    .into(),
            );
        }
        Ok(Anisotropy { strength, rotation })
    }

    fn sheen(&mut self) -> Check<Sheen> {
        let sheen: SheenExtension = extension(self.json, SHEEN)?.unwrap_or_default();
        let color = self.fractions("sheenColorFactor", sheen.sheen_color_factor)?;
        let [roughness] = self.fractions("sheenRoughnessFactor", [sheen.sheen_roughness_factor])?;
        let transmits = self.extension(|extensions| extensions.transmission.as_ref());
        if color != [0.0; 3] && transmits.is_some_and(|it| it.transmission_factor.0 > 0.0) {
            self.warn(
                "its sheen lies on the part of it alone that passes no light, which looks darker at grazing angles"
                    .into(),
            );
        }
        Ok(Sheen {
            color: color.into(),
            roughness,
        })
    }
}
