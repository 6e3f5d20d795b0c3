//! What the vertices of a primitive have.

use glam::{DVec3, DVec4, Vec2, Vec4};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};

use super::accessor::{DIRECTIONS, POSITIONS, TEXCOORDS, Vectors};
use super::diagnostic::{Check, damaged};
use super::document::Document;

/// The attributes of a primitive's vertices, as many of each as there are positions.
pub(super) struct Attributes<'a> {
    positions: Vectors<'a, 3>,
    normals: Option<Vectors<'a, 3>>,
    tangents: Option<Vectors<'a, 4>>,
    texcoords: [Option<Vectors<'a, 2>>; 2],
    colors: Option<Vectors<'a, 4>>,
}

/// Something that isn't finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NotFinite;

impl<'a> Attributes<'a> {
    /// Opens the attributes of a primitive; `None` if it has no positions.
    pub(super) fn open(document: &'a Document, primitive: &Primitive) -> Check<Option<Self>> {
        let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = find(Semantic::Positions) else {
            return Ok(None);
        };
        let positions = Vectors::open(document, positions, &POSITIONS).map_err(|what| format!("POSITION, {what}"))?;
        let count = positions.len();
        let normals = optional("NORMAL", "normals", count, find(Semantic::Normals), |index| {
            Vectors::open(document, index, &DIRECTIONS)
        })?;
        let texcoords = |set| {
            let (name, index) = (format!("TEXCOORD_{set}"), find(Semantic::TexCoords(set)));
            optional(&name, "texture coordinates", count, index, |index| {
                Vectors::open(document, index, &TEXCOORDS)
            })
        };
        let texcoords = [texcoords(0)?, texcoords(1)?];
        let colors = optional("COLOR_0", "colours", count, find(Semantic::Colors(0)), |index| {
            Vectors::open_colors(document, index)
        })?;
        // glTF 2.0, section 3.7.2.1: without normals, tangents are to be ignored.
        let tangents = find(Semantic::Tangents).filter(|_| normals.is_some());
        let tangents = optional("TANGENT", "tangents", count, tangents, |index| {
            Vectors::open(document, index, &DIRECTIONS)
        })?;
        Ok(Some(Self {
            positions,
            normals,
            tangents,
            texcoords,
            colors,
        }))
    }

    /// Number of vertices.
    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether the file gives normals.
    pub(super) fn has_normals(&self) -> bool {
        self.normals.is_some()
    }

    /// Position of a vertex in the node's space, checked to be finite.
    pub(super) fn position(&self, vertex: usize) -> Check<DVec3> {
        let position = self.positions.finite(vertex);
        let position = position.ok_or_else(|| damaged(format_args!("the position of vertex {vertex} isn't finite")))?;
        Ok(position.into())
    }

    /// Normal of a vertex in the node's space as the file gives it, checked to be finite; `None` where it gives none.
    pub(super) fn normal(&self, vertex: usize) -> Check<Option<DVec3>> {
        let Some(normals) = self.normals else {
            return Ok(None);
        };
        let normal = normals.finite(vertex);
        let normal = normal.ok_or_else(|| damaged(format_args!("the normal of vertex {vertex} isn't finite")))?;
        Ok(Some(normal.into()))
    }

    /// Tangent of a vertex in the node's space as the file gives it; `None` where it gives none.
    pub(super) fn tangent(&self, vertex: usize) -> Option<Result<DVec4, NotFinite>> {
        let tangents = self.tangents?;
        Some(tangents.finite(vertex).map(DVec4::from).ok_or(NotFinite))
    }

    /// Texture coordinates of a vertex, those of a missing set zero; `None` where the file gives none.
    pub(super) fn texcoords(&self, vertex: usize) -> Option<Result<[Vec2; 2], NotFinite>> {
        if self.texcoords.iter().all(Option::is_none) {
            return None;
        }
        let pair = self.texcoords.map(|set| match set {
            None => Some(Vec2::ZERO),
            Some(set) => set
                .finite(vertex)
                .map(|pair| Vec2::from(pair.map(|value| value as f32))),
        });
        Some(match pair {
            [Some(first), Some(second)] => Ok([first, second]),
            _ => Err(NotFinite),
        })
    }

    /// Colour of a vertex, linear RGBA, not negative; `None` where the file gives none.
    pub(super) fn color(&self, vertex: usize) -> Option<Result<Vec4, NotFinite>> {
        let color = self.colors?.finite(vertex).ok_or(NotFinite);
        Some(color.map(|color| Vec4::from(color.map(|value| value as f32)).max(Vec4::ZERO)))
    }
}

/// Opens an attribute that a primitive may have, checked to be there `count` times.
fn optional<'a, const N: usize>(
    name: &str,
    plural: &str,
    count: usize,
    index: Option<Index<Accessor>>,
    open: impl Fn(Index<Accessor>) -> Check<Vectors<'a, N>>,
) -> Check<Option<Vectors<'a, N>>> {
    let Some(index) = index else {
        return Ok(None);
    };
    let vectors = open(index).map_err(|what| format!("{name}, {what}"))?;
    if vectors.len() != count {
        let what = format!("{} {plural} for {count} positions", vectors.len());
        return Err(damaged(what));
    }
    Ok(Some(vectors))
}
