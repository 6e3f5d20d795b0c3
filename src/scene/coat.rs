//! KHR_materials_clearcoat, which the `gltf` crate doesn't know.

use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;
use serde::Deserialize;

/// Its name.
pub(super) const EXTENSION: &str = "KHR_materials_clearcoat";

/// What a material says of its coat.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Clearcoat {
    pub clearcoat_factor: f32,
    pub clearcoat_texture: Option<Info>,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_roughness_texture: Option<Info>,
    pub clearcoat_normal_texture: Option<NormalTexture>,
}
