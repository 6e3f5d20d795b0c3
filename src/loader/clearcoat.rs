//! KHR_materials_clearcoat, which the `gltf` crate doesn't know.

use crate::loader::extensions::CLEARCOAT;
use gltf_json::Material;
use gltf_json::material::NormalTexture;
use gltf_json::texture::Info;
use serde::Deserialize;

/// What a material says of its coat.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Clearcoat {
    pub clearcoat_factor: f32,
    pub clearcoat_texture: Option<Info>,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_roughness_texture: Option<Info>,
    pub clearcoat_normal_texture: Option<NormalTexture>,
}

impl Clearcoat {
    /// A material's; `None` where it has none.
    pub(crate) fn of(material: &Material) -> Option<serde_json::Result<Self>> {
        let extension = material.extensions.as_ref()?.others.get(CLEARCOAT)?;
        Some(serde_json::from_value(extension.clone()))
    }
}
