//! `KHR_materials_variants`: other materials for the same primitives, chosen by name.

use crate::loader::extensions::VARIANTS;
use gltf_json::{Index, Root};
use serde::Deserialize;

use super::diagnostic::{Check, damaged};
use crate::text::{list, quote};

/// The extension's object of the file.
#[derive(Deserialize)]
struct Variants {
    variants: Vec<Variant>,
}

#[derive(Deserialize)]
struct Variant {
    name: String,
}

/// The extension's object of a primitive.
#[derive(Deserialize)]
struct Mappings {
    mappings: Vec<Mapping>,
}

#[derive(Deserialize)]
struct Mapping {
    variants: Vec<usize>,
    material: u32,
}

/// The names of a file's variants.
pub(crate) fn names(root: &Root) -> Check<Vec<String>> {
    let extensions = root.extensions.as_ref();
    let Some(extension) = extensions.and_then(|extensions| extensions.others.get(VARIANTS)) else {
        return Ok(Vec::new());
    };
    let Variants { variants } =
        Variants::deserialize(extension).map_err(|error| damaged(format_args!("{VARIANTS}: {error}")))?;
    Ok(variants.into_iter().map(|variant| variant.name).collect())
}

/// Sets the primitives' materials to those of the variant with that name, one of `names`.
pub(crate) fn choose(root: &mut Root, names: &[String], wanted: &str) -> Check<()> {
    let Some(chosen) = names.iter().position(|name| name == wanted) else {
        let there_are = match names {
            [] => "the file has none; ask for none".to_owned(),
            names => {
                let names: Vec<String> = names.iter().map(|name| quote(name)).collect();
                format!("the file has {}", list(&names))
            }
        };
        return Err(format!("no material variant {}: {there_are}", quote(wanted)));
    };
    for (index, mesh) in root.meshes.iter_mut().enumerate() {
        for primitive in &mut mesh.primitives {
            let extensions = primitive.extensions.as_ref();
            let Some(extension) = extensions.and_then(|extensions| extensions.others.get(VARIANTS)) else {
                continue;
            };
            let Mappings { mappings } = Mappings::deserialize(extension)
                .map_err(|error| damaged(format_args!("mesh {index}, {VARIANTS}: {error}")))?;
            let mapping = mappings.iter().find(|mapping| mapping.variants.contains(&chosen));
            if let Some(mapping) = mapping {
                primitive.material = Some(Index::new(mapping.material));
            }
        }
    }
    Ok(())
}
