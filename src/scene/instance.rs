//! A primitive as one node shows it.

use std::rc::Rc;

use glam::{DMat3, DVec3, DVec4, Vec4};
use gltf::json::Root;

use super::attributes::NotFinite;
use super::diagnostic::{Check, shorten};
use super::facet::normal_matrix;
use super::graph::PlacedNode;
use super::primitive::{Primitive, primitive_label};

/// A primitive, and where a node puts it.
pub(super) struct Instance<'a> {
    node: &'a PlacedNode<'a>,
    mesh: usize,
    primitive_index: usize,
    /// The primitive, in the node's space.
    pub primitive: Rc<Primitive<'a>>,
    /// Takes normals from the node's space to world space, up to their length.
    normal_matrix: DMat3,
    is_mirrored: bool,
}

/// A triangle in world space, counter-clockwise from the front.
pub(super) struct WorldTriangle {
    /// Vertices of the primitive.
    pub vertices: [usize; 3],
    /// Their positions.
    pub positions: [DVec3; 3],
}

impl<'a> Instance<'a> {
    /// The primitive as `node` shows it.
    pub(super) fn new(
        node: &'a PlacedNode<'a>,
        mesh: usize,
        primitive_index: usize,
        primitive: Rc<Primitive<'a>>,
    ) -> Self {
        let (normal_matrix, is_mirrored) = normal_matrix(node.to_world.matrix3);
        Self {
            node,
            mesh,
            primitive_index,
            primitive,
            normal_matrix,
            is_mirrored,
        }
    }

    /// Where it is in the file.
    pub(super) fn label(&self, root: &Root) -> String {
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

    /// A triangle in world space, checked to be finite.
    pub(super) fn triangle(&self, triangle: usize) -> Check<WorldTriangle> {
        let mut vertices = self.primitive.triangle(triangle)?;
        if self.is_mirrored {
            vertices.swap(1, 2);
        }
        let mut positions = [DVec3::ZERO; 3];
        for (position, vertex) in positions.iter_mut().zip(vertices) {
            let local = self.primitive.attributes.position(vertex)?;
            *position = self.node.to_world.transform_point3(local);
            if !position.is_finite() {
                return Err(format!(
                    "the world position of vertex {vertex} is out of floating-point range; correct the node's scale"
                ));
            }
        }
        Ok(WorldTriangle { vertices, positions })
    }

    /// Normal of a vertex in world space, up to its length; `None` where the file gives none.
    pub(super) fn normal(&self, vertex: usize) -> Check<Option<DVec3>> {
        let normal = self.primitive.attributes.normal(vertex)?;
        Ok(normal.map(|normal| self.normal_matrix * normal))
    }

    /// Unit tangent of a vertex in world space and the sign of its bitangent, zero where it has no direction; `None`
    /// where there is none.
    pub(super) fn tangent(&self, vertex: usize) -> Option<Result<Vec4, NotFinite>> {
        let tangent = self.primitive.attributes.tangent(vertex)?;
        Some(tangent.map(|tangent| self.world_tangent(tangent)))
    }

    /// A tangent follows the surface as its edges do. Mirroring turns normal × tangent round, but not the bitangent.
    fn world_tangent(&self, tangent: DVec4) -> Vec4 {
        let direction = self.node.to_world.matrix3 * tangent.truncate();
        let sign = if (tangent.w < 0.0) == self.is_mirrored {
            1.0
        } else {
            -1.0
        };
        match direction.try_normalize() {
            Some(direction) => direction.as_vec3().extend(sign),
            None => Vec4::ZERO,
        }
    }
}
