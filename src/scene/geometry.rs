//! Puts the primitives of all nodes into render space as one list of triangles.
//!
//! Positions stay f64 from the file to the end: world space may lie far from the origin, where f32 is coarse.

use glam::{DMat3, DVec3};
use gltf::json::Root;

use super::Normalisation;
use super::builder::{Builder, Geometry};
use super::diagnostic::{Check, Warnings, damaged, list, quote, shorten};
use super::document::Document;
use super::facet::{face_normal, normal_matrix};
use super::graph::{PlacedNode, node_label};
use super::primitive::{Primitive, primitive_label};

/// The most triangles that a scene may have. A few hundred bytes of instances of instances could ask for any number.
const MAX_TRIANGLES: usize = 1 << 25;

/// The most primitives of all nodes together.
const MAX_OBJECTS: usize = 1 << 20;

/// A primitive as one node shows it.
pub(super) struct Instance<'a> {
    node: &'a PlacedNode<'a>,
    mesh: usize,
    primitive_index: usize,
    /// The primitive, in the node's space.
    pub primitive: Primitive<'a>,
    /// Takes normals from the node's space to world space, up to their length.
    pub normal_matrix: DMat3,
    is_mirrored: bool,
}

/// Opens the primitives that the nodes show. Nothing of their size is allocated before the total is known.
pub(super) fn instances<'a>(
    document: &'a Document,
    nodes: &'a [PlacedNode<'a>],
    warnings: &mut Warnings,
) -> Check<Vec<Instance<'a>>> {
    let mut instances = Vec::new();
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
        let (normal_matrix, is_mirrored) = normal_matrix(placed.to_world.matrix3);
        for (primitive_index, primitive) in mesh.primitives.iter().enumerate() {
            primitives += 1;
            if primitives > MAX_OBJECTS {
                return Err(format!(
                    "its nodes show more than {MAX_OBJECTS} mesh primitives; join meshes or split the scene"
                ));
            }
            let label = primitive_label(mesh_index, mesh, primitive_index);
            let Some(primitive) = Primitive::open(document, mesh, primitive, &label, warnings)
                .map_err(|what| format!("{label}: {what}"))?
            else {
                continue;
            };
            triangles += primitive.triangle_count();
            if triangles > MAX_TRIANGLES {
                return Err(format!(
                    "its nodes show more than {MAX_TRIANGLES} triangles; simplify or split the scene"
                ));
            }
            instances.push(Instance {
                node: placed,
                mesh: mesh_index,
                primitive_index,
                primitive,
                normal_matrix,
                is_mirrored,
            });
        }
    }
    Ok(instances)
}

/// Builds the triangles of all instances in render space, without those that have no area.
pub(super) fn assemble(root: &Root, instances: &[Instance<'_>], warnings: &mut Warnings) -> Check<Geometry> {
    let normalisation = normalise(root, instances)?;
    let mut builder = Builder::new(normalisation);
    let mut dropped = Vec::new();
    for instance in instances {
        let count = builder
            .add(root, instance)
            .map_err(|what| format!("{}: {what}", instance.label(root)))?;
        if count > 0 {
            dropped.push(format!("{} ({count})", quote(&instance.name(root))));
        }
    }
    let geometry = builder.geometry;
    if !dropped.is_empty() {
        warnings.push(format!(
            "dropped {} triangles of zero area, in {}",
            geometry.dropped_triangles,
            list(&dropped)
        ));
    }
    if builder.zero_normals > 0 {
        warnings.push(format!(
            "{} vertices have a normal of zero length; a triangle's own is used instead",
            builder.zero_normals
        ));
    }
    Ok(geometry)
}

/// Finds render space from the bounds of all triangles that have an area.
fn normalise(root: &Root, instances: &[Instance<'_>]) -> Check<Normalisation> {
    let mut lower = DVec3::INFINITY;
    let mut upper = DVec3::NEG_INFINITY;
    for instance in instances {
        for triangle in 0..instance.primitive.triangle_count() {
            let (_, corners) = instance
                .world_triangle(triangle)
                .map_err(|what| format!("{}: {what}", instance.label(root)))?;
            if face_normal(corners).is_some() {
                for corner in corners {
                    lower = lower.min(corner);
                    upper = upper.max(corner);
                }
            }
        }
    }
    if lower.x > upper.x {
        let reason = match instances {
            [] => "the nodes of its scene show no mesh with triangles",
            _ => "all its triangles have zero area",
        };
        return Err(format!("no triangles: {reason}; there is nothing to render"));
    }
    // Halves first: the sum of two large coordinates may overflow where their mean doesn't.
    let centre = 0.5 * lower + 0.5 * upper;
    let scale = (0.5 * upper - 0.5 * lower).max_element().recip();
    if !scale.is_finite() || scale == 0.0 {
        return Err("its extent is out of floating-point range; correct the scales of its nodes".into());
    }
    Ok(Normalisation { centre, scale })
}

impl Instance<'_> {
    fn label(&self, root: &Root) -> String {
        primitive_label(self.mesh, &root.meshes[self.mesh], self.primitive_index)
    }

    /// Name of the node, or of the mesh, or the node's number.
    pub(super) fn name(&self, root: &Root) -> String {
        let mesh = &root.meshes[self.mesh];
        match self.node.node.name.as_deref().or(mesh.name.as_deref()) {
            Some(name) => shorten(name),
            None => format!("node {}", self.node.index),
        }
    }

    /// Vertices and world positions of a triangle, counter-clockwise from the front.
    pub(super) fn world_triangle(&self, triangle: usize) -> Check<([usize; 3], [DVec3; 3])> {
        let mut vertices = self.primitive.triangle(triangle)?;
        if self.is_mirrored {
            vertices.swap(1, 2);
        }
        let mut corners = [DVec3::ZERO; 3];
        for (corner, vertex) in corners.iter_mut().zip(vertices) {
            *corner = self.node.to_world.transform_point3(self.primitive.position(vertex)?);
            if !corner.is_finite() {
                return Err(format!(
                    "the world position of vertex {vertex} is out of floating-point range; correct the node's scale"
                ));
            }
        }
        Ok((vertices, corners))
    }
}
