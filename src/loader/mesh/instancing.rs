//! `EXT_mesh_gpu_instancing`: nodes with many instances of their mesh.

use crate::loader::extensions::MESH_INSTANCING;
use std::collections::BTreeMap;

use glam::{DAffine3, DQuat, DVec3};
use gltf_json::{Accessor, Index};
use serde::Deserialize;

use crate::loader::diagnostic::{Check, damaged};
use crate::loader::file::accessor::{FLOATS, INSTANCE_ROTATIONS, Vectors};
use crate::loader::file::document::Document;
use crate::loader::graph::PlacedNode;
use crate::loader::limits::MAX_OBJECTS;

/// The extension's object.
#[derive(Deserialize)]
struct Instancing {
    /// Accessors by the attribute's name.
    attributes: BTreeMap<String, u32>,
}

/// The transforms of a node's mesh to world space: that of the node, or those of its instances.
pub(crate) fn places(document: &Document, placed: &PlacedNode<'_>) -> Check<Vec<DAffine3>> {
    let Some(extension) = extension(placed) else {
        return Ok(vec![placed.to_world]);
    };
    let places = Instancing::deserialize(extension)
        .map_err(|error| damaged(error.to_string()))
        .and_then(|instancing| instancing.places(document, placed.to_world));
    places.map_err(|what| format!("{MESH_INSTANCING}: {what}"))
}

/// The extension's object of a node.
pub(crate) fn extension<'a>(placed: &PlacedNode<'a>) -> Option<&'a serde_json::Value> {
    placed.node.extensions.as_ref()?.others.get(MESH_INSTANCING)
}

impl Instancing {
    fn places(&self, document: &Document, to_world: DAffine3) -> Check<Vec<DAffine3>> {
        let find = |name: &str| self.attributes.get(name).map(|&index| Index::<Accessor>::new(index));
        let vectors = |name: &str| {
            let opened = find(name).map(|index| Vectors::<3>::open(document, index, &FLOATS));
            opened.transpose().map_err(|what| format!("{name}, {what}"))
        };
        let (translations, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let rotations = find("ROTATION").map(|index| Vectors::<4>::open(document, index, &INSTANCE_ROTATIONS));
        let rotations = rotations.transpose().map_err(|what| format!("ROTATION, {what}"))?;
        let counts = [
            translations.map(|vectors| vectors.len()),
            rotations.map(|vectors| vectors.len()),
            scales.map(|vectors| vectors.len()),
        ];
        let mut counts = counts.into_iter().flatten();
        let Some(count) = counts.next() else {
            // It has no attribute that places instances.
            return Ok(vec![to_world]);
        };
        if let Some(other) = counts.find(|&other| other != count) {
            return Err(damaged(format_args!(
                "it has {count} of one attribute and {other} of another"
            )));
        }
        if count > MAX_OBJECTS {
            return Err(format!(
                "it has {count} instances, more than the {MAX_OBJECTS} that are rendered; split the scene"
            ));
        }
        let not_finite = |what: &str, index| damaged(format_args!("the {what} of instance {index} isn't finite"));
        let place = |index| {
            let vector = |vectors: Option<Vectors<'_, 3>>, absent: DVec3, what| match vectors {
                Some(vectors) => vectors
                    .finite(index)
                    .map(DVec3::from)
                    .ok_or_else(|| not_finite(what, index)),
                None => Ok(absent),
            };
            let rotation = match rotations {
                Some(rotations) => rotations.finite(index).ok_or_else(|| not_finite("rotation", index))?,
                None => DQuat::IDENTITY.to_array(),
            };
            let rotation = DQuat::from_array(rotation);
            if rotation.length_squared() == 0.0 {
                return Err(damaged(format_args!(
                    "the rotation of instance {index} is the quaternion 0 0 0 0"
                )));
            }
            let place = DAffine3::from_scale_rotation_translation(
                vector(scales, DVec3::ONE, "scale")?,
                rotation.normalize(),
                vector(translations, DVec3::ZERO, "translation")?,
            );
            Ok(to_world * place)
        };
        (0..count).map(place).collect()
    }
}
