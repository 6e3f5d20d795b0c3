//! A primitive at a node: morphed, then transformed to world space by the node or by the joints of its skin.

use super::primitive::FaceCorner;
use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3, DVec4, Vec4};
use gltf_json::Root;

use super::attributes::NotFinite;
use super::facet::normal_matrix;
use super::primitive::Primitive;
use super::skin::JointMatrices;
use crate::loader::diagnostic::{Check, damaged, primitive_label};
use crate::loader::graph::PlacedNode;
use crate::text::shorten;

/// A primitive, and its transform by a node.
#[derive(Clone)]
pub(crate) struct MeshInstance<'a> {
    node: &'a PlacedNode<'a>,
    mesh: usize,
    primitive_index: usize,
    /// The primitive, in the mesh's space.
    pub primitive: Rc<Primitive<'a>>,
    /// Morph targets with weights other than zero.
    morph: Vec<(usize, f64)>,
    deformation: Deformation,
}

#[derive(Clone)]
enum Deformation {
    Rigid(Map),
    Skinned(JointMatrices),
}

/// From the mesh's space to world space.
#[derive(Clone, Copy)]
struct Map {
    to_world: DAffine3,
    /// The matrix for normals, up to their length.
    normal_matrix: DMat3,
    is_mirrored: bool,
}

impl Map {
    fn new(to_world: DAffine3) -> Self {
        let (normal_matrix, is_mirrored) = normal_matrix(to_world.matrix3);
        Self {
            to_world,
            normal_matrix,
            is_mirrored,
        }
    }
}

/// A triangle in world space, counter-clockwise from the front.
pub(crate) struct WorldTriangle {
    /// Its corners.
    pub corners: [FaceCorner; 3],
    /// Their positions.
    pub positions: [DVec3; 3],
}

impl<'a> MeshInstance<'a> {
    /// The primitive of `node` with a transform to world space, or with the skin's matrices if the node has a skin.
    pub(crate) fn new(
        node: &'a PlacedNode<'a>,
        to_world: DAffine3,
        mesh: usize,
        primitive_index: usize,
        primitive: Rc<Primitive<'a>>,
        morph: Vec<(usize, f64)>,
        skin: Option<JointMatrices>,
    ) -> Self {
        let deformation = match skin {
            Some(matrices) if primitive.attributes.is_skinned() => Deformation::Skinned(matrices),
            _ => Deformation::Rigid(Map::new(to_world)),
        };
        Self {
            node,
            mesh,
            primitive_index,
            primitive,
            morph,
            deformation,
        }
    }

    /// Mesh and primitive.
    pub(crate) fn key(&self) -> (usize, usize) {
        (self.mesh, self.primitive_index)
    }

    /// Index of its node.
    pub(crate) fn node_index(&self) -> usize {
        self.node.index
    }

    /// Whether other nodes have the primitive too.
    pub(crate) fn is_repeated(&self) -> bool {
        Rc::strong_count(&self.primitive) > 1
    }

    /// Its transform to world space, if it has neither skin nor morph targets.
    pub(crate) fn node_alone(&self) -> Option<DAffine3> {
        match &self.deformation {
            Deformation::Rigid(map) if self.morph.is_empty() => Some(map.to_world),
            _ => None,
        }
    }

    /// The same in the mesh's space.
    pub(crate) fn unplaced(&self) -> Self {
        Self {
            deformation: Deformation::Rigid(Map::new(DAffine3::IDENTITY)),
            ..self.clone()
        }
    }

    /// Its location in the file.
    pub(crate) fn label(&self, root: &Root) -> String {
        primitive_label(self.mesh, &root.meshes[self.mesh], self.primitive_index)
    }

    /// Name of the node, or of the mesh, or the node's number.
    pub(crate) fn name(&self, root: &Root) -> String {
        let mesh = &root.meshes[self.mesh];
        match self.node.node.name.as_deref().or(mesh.name.as_deref()) {
            Some(name) => shorten(name),
            None => format!("node {}", self.node.index),
        }
    }

    /// A triangle in world space, checked to be finite.
    pub(crate) fn triangle(&self, triangle: usize) -> Check<WorldTriangle> {
        let vertices = self.primitive.triangle(triangle)?;
        let mut corners = [0, 1, 2].map(|place| FaceCorner {
            triangle,
            place,
            vertex: vertices[place],
        });
        let is_mirrored = match &self.deformation {
            Deformation::Rigid(map) => map.is_mirrored,
            Deformation::Skinned(_) => self.map(vertices[0])?.is_mirrored,
        };
        if is_mirrored {
            corners.swap(1, 2);
        }
        let mut positions = [DVec3::ZERO; 3];
        for (position, corner) in positions.iter_mut().zip(corners) {
            let local = self.primitive.attributes.position(corner.vertex, &self.morph)?;
            *position = self.to_world(corner.vertex)?.transform_point3(local);
            if !position.is_finite() {
                return Err(format!(
                    "the world position of vertex {} is out of floating-point range; correct the node's scale",
                    corner.vertex
                ));
            }
        }
        Ok(WorldTriangle { corners, positions })
    }

    /// Normal of a vertex in world space, up to its length; `None` if the file has none.
    pub(crate) fn normal(&self, vertex: usize) -> Check<Option<DVec3>> {
        match self.primitive.attributes.normal(vertex, &self.morph)? {
            Some(normal) => Ok(Some(self.map(vertex)?.normal_matrix * normal)),
            None => Ok(None),
        }
    }

    /// Unit tangent at a corner in world space and the sign of its bitangent, zero if it has no direction; `None` without
    /// tangents.
    pub(crate) fn tangent(&self, corner: FaceCorner) -> Check<Option<Result<Vec4, NotFinite>>> {
        let tangent = match self.primitive.generated_tangent(corner) {
            Some(tangent) => Some(Ok(tangent.as_dvec4())),
            None => self.primitive.attributes.tangent(corner.vertex, &self.morph),
        };
        let Some(tangent) = tangent else {
            return Ok(None);
        };
        let map = self.map(corner.vertex)?;
        Ok(Some(tangent.map(|tangent| world_tangent(map, tangent))))
    }

    fn map(&self, vertex: usize) -> Check<Map> {
        match &self.deformation {
            Deformation::Rigid(map) => Ok(*map),
            Deformation::Skinned(_) => Ok(Map::new(self.to_world(vertex)?)),
        }
    }

    fn to_world(&self, vertex: usize) -> Check<DAffine3> {
        match &self.deformation {
            Deformation::Rigid(map) => Ok(map.to_world),
            Deformation::Skinned(matrices) => self.blend(matrices, vertex),
        }
    }

    /// The mean of the matrices of a vertex's joints by its weights, which need not add up to 1 exactly. A vertex
    /// without any weight follows its first joint.
    fn blend(&self, matrices: &[DAffine3], vertex: usize) -> Check<DAffine3> {
        let joint = |joint: u32| {
            matrices.get(joint as usize).copied().ok_or_else(|| {
                let joints = matrices.len();
                damaged(format_args!(
                    "vertex {vertex} follows joint {joint}, but the skin has {joints}"
                ))
            })
        };
        let mut sum = DAffine3::ZERO;
        let mut total = 0.0;
        let mut first = None;
        for (index, weight) in self.primitive.attributes.influences(vertex) {
            first = first.or(Some(index));
            if !weight.is_finite() {
                return Err(damaged(format_args!("a weight of vertex {vertex} isn't finite")));
            }
            if weight > 0.0 {
                let matrix = joint(index)?;
                sum.matrix3 += matrix.matrix3 * weight;
                sum.translation += matrix.translation * weight;
                total += weight;
            }
        }
        match first {
            Some(first) if total == 0.0 => joint(first),
            _ => Ok(DAffine3 {
                matrix3: sum.matrix3 * total.recip(),
                translation: sum.translation / total,
            }),
        }
    }
}

/// A tangent is transformed like the edges of the surface. Mirroring reverses normal × tangent, but not the bitangent.
fn world_tangent(map: Map, tangent: DVec4) -> Vec4 {
    let direction = map.to_world.matrix3 * tangent.truncate();
    let sign = if (tangent.w < 0.0) == map.is_mirrored {
        1.0
    } else {
        -1.0
    };
    match direction.try_normalize() {
        Some(direction) => direction.as_vec3().extend(sign),
        None => Vec4::ZERO,
    }
}
