//! Names of glTF extensions without a feature of the `gltf` crate.

use super::material::layers;

/// The program's own, for light sources that `KHR_lights_punctual` can't describe.
pub(crate) const LIGHT_SHAPE: &str = "PPMVK_light_shape";
pub(crate) const BASISU: &str = "KHR_texture_basisu";
pub(crate) const DRACO: &str = "KHR_draco_mesh_compression";
pub(crate) const MESHOPT: &str = "EXT_meshopt_compression";
pub(crate) const MESH_INSTANCING: &str = "EXT_mesh_gpu_instancing";
pub(crate) const QUANTIZATION: &str = "KHR_mesh_quantization";
pub(crate) const VARIANTS: &str = "KHR_materials_variants";
pub(crate) const WEBP: &str = "EXT_texture_webp";

/// Whether a file may list it as required.
pub(crate) fn is_supported(extension: &str) -> bool {
    SUPPORTED.contains(&extension) || layers::EXTENSIONS.contains(&extension)
}

/// Those beside [`layers::EXTENSIONS`]; those of materials are features of the `gltf` crate that `Cargo.toml` turns on.
const SUPPORTED: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_texture_transform",
    LIGHT_SHAPE,
    QUANTIZATION,
    DRACO,
    MESH_INSTANCING,
    BASISU,
    MESHOPT,
    WEBP,
    VARIANTS,
];
