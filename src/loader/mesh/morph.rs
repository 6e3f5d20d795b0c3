//! Morph targets: weighted displacements of vertex attributes (glTF 2.0, section 3.7.2.2).

use gltf_json::mesh::Primitive;

use super::attributes::optional;
use crate::loader::animation::Pose;
use crate::loader::diagnostic::{Check, damaged};
use crate::loader::file::accessor::{DIRECTIONS, POSITIONS, Vectors};
use crate::loader::file::document::Document;
use crate::loader::graph::PlacedNode;

/// A morph target, opened.
pub(crate) struct MorphTarget<'a> {
    pub positions: Option<Vectors<'a, 3>>,
    pub normals: Option<Vectors<'a, 3>>,
    /// The sign of the bitangent does not change.
    pub tangents: Option<Vectors<'a, 3>>,
}

impl<'a> MorphTarget<'a> {
    /// Opens the morph targets of a primitive of `count` vertices.
    pub(crate) fn open_all(document: &'a Document, primitive: &Primitive, count: usize) -> Check<Vec<Self>> {
        let targets = primitive.targets.iter().flatten().enumerate();
        let opened = targets.map(|(index, target)| {
            let fail = |what| format!("morph target {index}: {what}");
            Ok(Self {
                positions: optional("POSITION", "shifts", count, target.positions, |index| {
                    Vectors::open(document, index, &POSITIONS)
                })
                .map_err(fail)?,
                normals: optional("NORMAL", "shifts", count, target.normals, |index| {
                    Vectors::open(document, index, &DIRECTIONS)
                })
                .map_err(fail)?,
                tangents: optional("TANGENT", "shifts", count, target.tangents, |index| {
                    Vectors::open(document, index, &DIRECTIONS)
                })
                .map_err(fail)?,
            })
        });
        opened.collect()
    }
}

/// The morph targets among `targets` with weights other than zero, from an animation, otherwise the node, otherwise the mesh.
pub(crate) fn weights(
    placed: &PlacedNode<'_>,
    pose: &Pose<'_>,
    mesh_weights: Option<&[f32]>,
    targets: usize,
) -> Check<Vec<(usize, f64)>> {
    let animated = pose.node(placed.index).and_then(|node| node.weights.as_ref());
    let given = placed.node.weights.as_deref().or(mesh_weights).unwrap_or(&[]);
    let mut weights = Vec::new();
    for target in 0..targets {
        let weight = match animated {
            Some(curve) => curve.value(target)?[0],
            None => given.get(target).copied().map_or(0.0, f64::from),
        };
        if !weight.is_finite() {
            return Err(damaged(format_args!(
                "the weight of morph target {target} isn't finite"
            )));
        }
        if weight != 0.0 {
            weights.push((target, weight));
        }
    }
    Ok(weights)
}
