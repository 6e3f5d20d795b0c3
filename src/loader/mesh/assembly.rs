//! Puts the primitives of all nodes into render space as one list of triangles.
//!
//! Positions are f64 until render space: world space may be far from the origin, where f32 is coarse.

use super::normalisation::normalise;
use crate::loader::extensions::MESH_INSTANCING;
use crate::loader::limits::{MAX_OBJECTS, MAX_TRIANGLES};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::rc::Rc;

use super::builder::Builder;
use super::geometry::Geometry;
use super::mesh_instance::MeshInstance;
use super::primitive::Primitive;
use super::skin::Skins;
use super::{instancing, morph, sharing};
use crate::loader::animation::Pose;
use crate::loader::diagnostic::{Check, Warnings, damaged, primitive_label};
use crate::loader::file::document::Document;
use crate::loader::graph::{PlacedNode, node_label};
use crate::scene::Normalisation;
use crate::text::{list, quote};

/// Maximum number of morph targets and sets of joints of all triangles together.
const MAX_DEFORMATIONS: usize = 1 << 28;

/// Opens the primitives of the nodes. The total is checked before anything of their size is allocated.
pub(crate) fn instances<'a>(
    document: &'a Document,
    nodes: &'a [PlacedNode<'a>],
    pose: &Pose<'_>,
    warnings: &mut Warnings,
) -> Check<Vec<MeshInstance<'a>>> {
    let mut instances = Vec::new();
    let mut opened: HashMap<(usize, usize), Option<Rc<Primitive<'a>>>> = HashMap::new();
    let mut skins = Skins::new(document, nodes);
    let mut deformations = 0usize;
    let mut primitives = 0;
    let mut triangles = 0;
    for placed in nodes {
        let Some(mesh_index) = placed.node.mesh else {
            continue;
        };
        let mesh_index = mesh_index.value();
        let meshes = &document.root.meshes;
        let mesh = meshes.get(mesh_index).ok_or_else(|| {
            damaged(format_args!(
                "{}: there is no mesh {mesh_index}, the file has {}",
                node_label(&document.root, placed.index),
                meshes.len()
            ))
        })?;
        let at_node = |what| format!("{}: {what}", node_label(&document.root, placed.index));
        let places = if placed.node.skin.is_some() && instancing::extension(placed).is_some() {
            warnings.push(at_node(format!(
                "it has a skin, which determines the position of its mesh; its {} is ignored",
                MESH_INSTANCING
            )));
            vec![placed.to_world]
        } else {
            instancing::places(document, placed).map_err(at_node)?
        };
        for (primitive_index, primitive) in mesh.primitives.iter().enumerate() {
            primitives += places.len();
            if primitives > MAX_OBJECTS {
                return Err(format!(
                    "its nodes show more than {MAX_OBJECTS} mesh primitives; join meshes or split the scene"
                ));
            }
            let opened = match opened.entry((mesh_index, primitive_index)) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => {
                    let label = primitive_label(mesh_index, mesh, primitive_index);
                    let primitive = Primitive::open(document, primitive, &label, warnings)
                        .map_err(|what| format!("{label}: {what}"))?;
                    entry.insert(primitive.map(Rc::new))
                }
            };
            let Some(primitive) = opened else {
                continue;
            };
            triangles = places
                .len()
                .saturating_mul(primitive.triangle_count())
                .saturating_add(triangles);
            if triangles > MAX_TRIANGLES {
                return Err(format!(
                    "its nodes show more than {MAX_TRIANGLES} triangles; simplify or split the scene"
                ));
            }
            let attributes = &primitive.attributes;
            if placed.node.skin.is_some() && !attributes.is_skinned() {
                let label = primitive_label(mesh_index, mesh, primitive_index);
                warnings.push(format!(
                    "{label}: it has no joints and weights for its skin; it follows its node, and may be misplaced"
                ));
            }
            let targets = attributes.morph_target_count();
            let morph = morph::weights(placed, pose, mesh.weights.as_deref(), targets).map_err(at_node)?;
            let skin = placed.node.skin.map(|skin| skins.matrices(skin.value()));
            let skin = skin.transpose().map_err(at_node)?;
            let shifts = places.len().saturating_mul(morph.len() + attributes.influence_sets());
            deformations = deformations.saturating_add(shifts.saturating_mul(primitive.triangle_count()));
            if deformations > MAX_DEFORMATIONS {
                return Err(format!(
                    "its morph targets and skins move triangles more than {MAX_DEFORMATIONS} times; \
                     apply them before exporting, or split the scene"
                ));
            }
            instances.extend(places.iter().map(|&to_world| {
                MeshInstance::new(
                    placed,
                    to_world,
                    mesh_index,
                    primitive_index,
                    primitive.clone(),
                    morph.clone(),
                    skin.clone(),
                )
            }));
        }
    }
    Ok(instances)
}

/// Builds the triangles of all instances in render space, except those without area. `normalisation`: `None` for that of their
/// bounds.
pub(crate) fn assemble(
    document: &Document,
    instances: &[MeshInstance<'_>],
    normalisation: Option<Normalisation>,
    warnings: &mut Warnings,
) -> Check<Geometry> {
    let root = &document.root;
    let normalisation = normalisation.map_or_else(|| normalise(root, instances), Ok)?;
    let mut builder = Builder::new(normalisation, sharing::sharing_pays(root, instances));
    let mut dropped: Vec<(String, usize)> = Vec::new();
    for instance in instances {
        document
            .budget
            .check(builder.bytes_with(instance), instance.label(root))?;
        let count = builder
            .add(root, instance)
            .map_err(|what| format!("{}: {what}", instance.label(root)))?;
        if count == 0 {
            continue;
        }
        let name = instance.name(root);
        match dropped.last_mut() {
            // Instances of one node are consecutive.
            Some((last, sum)) if *last == name => *sum += count,
            _ => dropped.push((name, count)),
        }
    }
    builder.complete_attributes();
    let geometry = builder.geometry;
    document.budget.take(geometry.bytes(), "the geometry of its meshes")?;
    // Shared triangles may remain that no object uses.
    if geometry.objects.is_empty() {
        return Err(
            "no triangles: all of them are too narrow to have an area in the scene's size; nothing is left to render"
                .into(),
        );
    }
    if !dropped.is_empty() {
        let dropped: Vec<String> = dropped
            .iter()
            .map(|(name, count)| format!("{} ({count})", quote(name)))
            .collect();
        warnings.push(format!(
            "dropped {} triangles of zero area, in {}; no ray could meet them, and nothing is missing",
            geometry.dropped_triangles,
            list(&dropped)
        ));
    }
    if builder.zero_normals > 0 {
        warnings.push(format!(
            "{} vertices have a normal of zero length; a triangle's own is used instead, so that edges may show there: recompute \
             normals",
            builder.zero_normals
        ));
    }
    if builder.not_finite > 0 {
        warnings.push(format!(
            "{} texture coordinates, colours or tangents of vertices aren't finite and are taken for 0, so that surfaces there may \
             have a wrong colour: export the file again",
            builder.not_finite
        ));
    }
    Ok(geometry)
}
