//! Vertex attributes of a primitive.

use glam::{DVec3, DVec4, Vec2, Vec4};
use gltf_json::mesh::{Primitive, Semantic};
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index};

use super::morph::MorphTarget;
use crate::loader::diagnostic::{Check, damaged};
use crate::loader::file::accessor::{DIRECTIONS, FRACTIONS, Integers, POSITIONS, TEXCOORDS, Vectors};
use crate::loader::file::document::Document;

/// The attributes of a primitive's vertices, one of each per position.
pub(crate) struct Attributes<'a> {
    positions: Vectors<'a, 3>,
    normals: Option<Vectors<'a, 3>>,
    tangents: Option<Vectors<'a, 4>>,
    texcoords: [Option<Vectors<'a, 2>>; 2],
    colors: Option<Vectors<'a, 4>>,
    /// Joints and their weights, four to a set.
    influences: Vec<(Integers<'a, 4>, Vectors<'a, 4>)>,
    morph_targets: Vec<MorphTarget<'a>>,
}

/// A value that is not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotFinite;

impl<'a> Attributes<'a> {
    /// Opens the attributes of a primitive; `None` if it has no positions.
    pub(crate) fn open(document: &'a Document, primitive: &Primitive) -> Check<Option<Self>> {
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
            influences: influences(document, primitive, count)?,
            morph_targets: MorphTarget::open_all(document, primitive, count)?,
        }))
    }

    /// Number of vertices.
    pub(crate) fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether the vertices follow joints.
    pub(crate) fn is_skinned(&self) -> bool {
        !self.influences.is_empty()
    }

    /// Number of sets of four joints that each vertex follows.
    pub(crate) fn influence_sets(&self) -> usize {
        self.influences.len()
    }

    /// Joints that a vertex follows, with their weights.
    pub(crate) fn influences(&self, vertex: usize) -> impl Iterator<Item = (u32, f64)> {
        let sets = self.influences.iter();
        sets.flat_map(move |(joints, weights)| joints.get(vertex).into_iter().zip(weights.get(vertex)))
    }

    /// Number of morph targets.
    pub(crate) fn morph_target_count(&self) -> usize {
        self.morph_targets.len()
    }

    /// Position of a vertex in the mesh's space, morphed by targets with weights, checked to be finite.
    pub(crate) fn position(&self, vertex: usize, morph: &[(usize, f64)]) -> Check<DVec3> {
        let shift = self.shift(vertex, morph, |target| target.positions);
        let position = DVec3::from(self.positions.get(vertex)) + shift;
        if position.is_finite() {
            return Ok(position);
        }
        Err(damaged(format_args!("the position of vertex {vertex} isn't finite")))
    }

    /// Normal of a vertex in the mesh's space from the file, morphed and checked to be finite; `None` if the file has none.
    pub(crate) fn normal(&self, vertex: usize, morph: &[(usize, f64)]) -> Check<Option<DVec3>> {
        let Some(normals) = self.normals else {
            return Ok(None);
        };
        let shift = self.shift(vertex, morph, |target| target.normals);
        let normal = DVec3::from(normals.get(vertex)) + shift;
        if normal.is_finite() {
            return Ok(Some(normal));
        }
        Err(damaged(format_args!("the normal of vertex {vertex} isn't finite")))
    }

    /// Whether the file gives texture coordinates of any set.
    pub(crate) fn has_texcoords(&self) -> bool {
        self.texcoords.iter().any(Option::is_some)
    }

    /// Whether the file gives tangents.
    pub(crate) fn has_tangents(&self) -> bool {
        self.tangents.is_some()
    }

    /// Tangent of a vertex in the mesh's space from the file, morphed; `None` if the file has none.
    pub(crate) fn tangent(&self, vertex: usize, morph: &[(usize, f64)]) -> Option<Result<DVec4, NotFinite>> {
        let tangent = DVec4::from(self.tangents?.get(vertex));
        let shift = self.shift(vertex, morph, |target| target.tangents);
        let tangent = tangent + shift.extend(0.0);
        Some(if tangent.is_finite() {
            Ok(tangent)
        } else {
            Err(NotFinite)
        })
    }

    /// Texture coordinates of a vertex, zero for a missing set; `None` if the file has none.
    pub(crate) fn texcoords(&self, vertex: usize) -> Option<Result<[Vec2; 2], NotFinite>> {
        if !self.has_texcoords() {
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

    /// Colour of a vertex, linear RGBA, not negative; `None` if the file has none.
    pub(crate) fn color(&self, vertex: usize) -> Option<Result<Vec4, NotFinite>> {
        let color = self.colors?.finite(vertex).ok_or(NotFinite);
        Some(color.map(|color| Vec4::from(color.map(|value| value as f32)).max(Vec4::ZERO)))
    }

    /// Weighted sum of the morph targets' displacements of a vertex attribute.
    fn shift(
        &self,
        vertex: usize,
        morph: &[(usize, f64)],
        attribute: impl Fn(&MorphTarget<'a>) -> Option<Vectors<'a, 3>>,
    ) -> DVec3 {
        let shifts = morph.iter().filter_map(|&(target, weight)| {
            let shift = attribute(&self.morph_targets[target])?;
            Some(weight * DVec3::from(shift.get(vertex)))
        });
        shifts.sum()
    }
}

/// Opens the joints and weights of a primitive, set by set.
fn influences<'a>(
    document: &'a Document,
    primitive: &Primitive,
    count: usize,
) -> Check<Vec<(Integers<'a, 4>, Vectors<'a, 4>)>> {
    let find = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let mut sets = Vec::new();
    for set in 0.. {
        let (Some(joints), Some(weights)) = (find(Semantic::Joints(set)), find(Semantic::Weights(set))) else {
            break;
        };
        let joints = Integers::open_joints(document, joints).map_err(|what| format!("JOINTS_{set}, {what}"))?;
        let weights = Vectors::open(document, weights, &FRACTIONS).map_err(|what| format!("WEIGHTS_{set}, {what}"))?;
        if joints.len() != count || weights.len() != count {
            let (joints, weights) = (joints.len(), weights.len());
            return Err(damaged(format_args!(
                "{joints} joints and {weights} weights for {count} positions"
            )));
        }
        sets.push((joints, weights));
    }
    Ok(sets)
}

/// Opens an optional attribute of a primitive, checked to have `count` elements.
pub(crate) fn optional<'a, const N: usize>(
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
