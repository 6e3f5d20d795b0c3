//! A mesh primitive as a list of triangles, for any topology and index type.

use glam::Vec4;
use gltf_json::mesh;
use gltf_json::mesh::Mode;
use gltf_json::validation::Checked;

use super::attributes::Attributes;
use super::tangents::{MAX_AROUND, tangents};
use crate::loader::diagnostic::{Check, Warnings, damaged};
use crate::loader::file::accessor::Integers;
use crate::loader::file::document::Document;
use crate::loader::material::layers::tangent_set;

/// A primitive with checked accessors; its indices and vertices are checked when they are read.
pub(crate) struct Primitive<'a> {
    /// Index of the material, or one past the last for the default material.
    pub material: usize,
    /// Its vertex attributes.
    pub attributes: Attributes<'a>,
    topology: Topology,
    indices: Option<Integers<'a, 1>>,
    /// Tangents of the corners of each triangle, if the file has none and the material needs them.
    generated_tangents: Option<Vec<[Vec4; 3]>>,
}

/// A corner of a triangle of the primitive.
#[derive(Clone, Copy)]
pub(crate) struct FaceCorner {
    /// Index of the triangle.
    pub triangle: usize,
    /// Which of its corners it is in the file.
    pub place: usize,
    /// Index of the vertex.
    pub vertex: usize,
}

/// How a sequence of vertices forms triangles.
#[derive(Clone, Copy)]
enum Topology {
    List,
    Strip,
    Fan,
}

impl<'a> Primitive<'a> {
    /// Opens a primitive; `None` if it has no triangles. Unsupported parts are added to `warnings`.
    pub(crate) fn open(
        document: &'a Document,
        primitive: &mesh::Primitive,
        label: &str,
        warnings: &mut Warnings,
    ) -> Check<Option<Self>> {
        let topology = match primitive.mode {
            Checked::Valid(Mode::Triangles) => Topology::List,
            Checked::Valid(Mode::TriangleStrip) => Topology::Strip,
            Checked::Valid(Mode::TriangleFan) => Topology::Fan,
            Checked::Valid(mode) => {
                warnings.push(format!(
                    "{label}: its {mode:?} are skipped and missing in the picture: only triangles are rendered; convert them \
                     to tubes or spheres"
                ));
                return Ok(None);
            }
            Checked::Invalid => return Err(damaged("its mode is not one of 0 to 6")),
        };
        let Some(attributes) = Attributes::open(document, primitive)? else {
            warnings.push(format!(
                "{label}: it has no POSITION and is skipped, as other viewers do"
            ));
            return Ok(None);
        };
        let indices = primitive
            .indices
            .map(|index| Integers::open_indices(document, index))
            .transpose()
            .map_err(|what| format!("indices, {what}"))?;
        let materials = document.root.materials.len();
        let material = primitive.material.map_or(Ok(materials), |index| {
            if index.value() < materials {
                Ok(index.value())
            } else {
                Err(damaged(format_args!(
                    "there is no material {index}, the file has {materials}"
                )))
            }
        })?;

        let mut opened = Self {
            material,
            attributes,
            topology,
            indices,
            generated_tangents: None,
        };
        if !opened.attributes.has_tangents()
            && let Some(set) = document.root.materials.get(material).and_then(tangent_set)
        {
            let has_texcoords = opened.attributes.has_texcoords();
            if has_texcoords {
                let triangles = (0..opened.triangle_count()).map(|triangle| opened.triangle(triangle));
                opened.generated_tangents = tangents(&opened.attributes, triangles, set)?;
            }
            if opened.generated_tangents.is_none() {
                let why = if has_texcoords {
                    format!("more than {MAX_AROUND} of its triangles meet in a point")
                } else {
                    "it has no texture coordinates".to_owned()
                };
                warnings.push(format!(
                    "{label}: its material needs tangents, which can't be made: {why}; it is rendered without normal \
                     textures and anisotropy: export tangents"
                ));
            }
        }
        let excess = opened.sequence_length() % 3;
        if matches!(topology, Topology::List) && excess != 0 {
            warnings.push(format!(
                "{label}: its last {excess} indices form no triangle and are skipped; nothing else is missing"
            ));
        }
        Ok((opened.triangle_count() > 0).then_some(opened))
    }

    /// Number of triangles.
    pub(crate) fn triangle_count(&self) -> usize {
        match self.topology {
            Topology::List => self.sequence_length() / 3,
            Topology::Strip | Topology::Fan => self.sequence_length().saturating_sub(2),
        }
    }

    /// The vertices of a triangle, checked to exist, counter-clockwise from the front.
    pub(crate) fn triangle(&self, triangle: usize) -> Check<[usize; 3]> {
        let corners = match self.topology {
            Topology::List => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
            // Every second triangle of a strip is reversed, so that all face the same way.
            Topology::Strip => [triangle, triangle + 1 + triangle % 2, triangle + 2 - triangle % 2],
            Topology::Fan => [triangle + 1, triangle + 2, 0],
        };
        let mut vertices = [0; 3];
        for (vertex, corner) in vertices.iter_mut().zip(corners) {
            *vertex = self.indices.map_or(corner, |indices| indices.get(corner)[0] as usize);
            if *vertex >= self.attributes.len() {
                return Err(damaged(format_args!(
                    "its index {corner} is vertex {vertex}, but it has {} vertices",
                    self.attributes.len()
                )));
            }
        }
        Ok(vertices)
    }

    /// Whether the corners that share a vertex may have different tangents.
    pub(crate) fn splits_vertices(&self) -> bool {
        self.generated_tangents.is_some()
    }

    /// The generated tangent at a corner, in the mesh's space.
    pub(crate) fn generated_tangent(&self, corner: FaceCorner) -> Option<Vec4> {
        let tangents = self.generated_tangents.as_ref()?;
        Some(tangents[corner.triangle][corner.place])
    }

    fn sequence_length(&self) -> usize {
        self.indices.map_or(self.attributes.len(), |indices| indices.len())
    }
}
