//! Tangents by MikkTSpace, if a file has none and a normal texture needs them (glTF 2.0, section 3.7.2.1).

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::attributes::Attributes;
use super::facet::face_normal;
use crate::loader::diagnostic::Check;

/// Maximum number of triangles around one vertex: the algorithm visits them recursively.
pub(crate) const MAX_AROUND: u32 = 4096;

/// The triangles of a primitive, for the algorithm.
struct Corners {
    positions: Vec<[Vec3; 3]>,
    normals: Vec<[Vec3; 3]>,
    texcoords: Vec<[Vec2; 3]>,
    tangents: Vec<[Vec4; 3]>,
}

/// Tangents of the corners of triangles, given by their vertices, for the texture coordinates of a set, in the file's convention;
/// zero if undefined. `None` if more than [`MAX_AROUND`] triangles share a point.
pub(crate) fn tangents(
    attributes: &Attributes<'_>,
    triangles: impl ExactSizeIterator<Item = Check<[usize; 3]>>,
    set: usize,
) -> Check<Option<Vec<[Vec4; 3]>>> {
    let mut corners = Corners {
        positions: Vec::new(),
        normals: Vec::new(),
        texcoords: Vec::new(),
        tangents: vec![[Vec4::ZERO; 3]; triangles.len()],
    };
    let mut around: HashMap<[u32; 3], u32> = HashMap::new();
    for vertices in triangles {
        let vertices = vertices?;
        let mut positions = [DVec3::ZERO; 3];
        let mut normals = [DVec3::ZERO; 3];
        let mut texcoords = [Vec2::ZERO; 3];
        for (corner, &vertex) in vertices.iter().enumerate() {
            positions[corner] = attributes.position(vertex, &[])?;
            if let Some(Ok(sets)) = attributes.texcoords(vertex) {
                texcoords[corner] = sets[set];
            }
        }
        let flat = face_normal(positions).unwrap_or(DVec3::Z);
        for (normal, &vertex) in normals.iter_mut().zip(&vertices) {
            let given = attributes.normal(vertex, &[])?;
            *normal = given.and_then(DVec3::try_normalize).unwrap_or(flat);
        }
        let positions = positions.map(|position| position.as_vec3());
        for position in positions {
            let count = around.entry(position.to_array().map(f32::to_bits)).or_default();
            *count += 1;
            if *count > MAX_AROUND {
                return Ok(None);
            }
        }
        corners.positions.push(positions);
        corners.normals.push(normals.map(|normal| normal.as_vec3()));
        corners.texcoords.push(texcoords);
    }
    corners.scale_to_1();
    // It cannot fail at present; otherwise there are no tangents.
    Ok(generate_tangents(&mut corners).ok().map(|()| corners.tangents))
}

impl Corners {
    /// Scales positions and texture coordinates, which changes no direction, so that products stay within f32's range.
    fn scale_to_1(&mut self) {
        let positions = self.positions.as_flattened_mut();
        let largest = positions.iter().map(|position| position.abs().max_element());
        let largest = largest.fold(f32::MIN_POSITIVE, f32::max);
        positions.iter_mut().for_each(|position| *position /= largest);
        let texcoords = self.texcoords.as_flattened_mut();
        let largest = texcoords.iter().map(|texcoord| texcoord.abs().max_element());
        let largest = largest.fold(f32::MIN_POSITIVE, f32::max);
        texcoords.iter_mut().for_each(|texcoord| *texcoord /= largest);
    }
}

impl Geometry for Corners {
    fn num_faces(&self) -> usize {
        self.positions.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.positions[face][vert].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.normals[face][vert].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.texcoords[face][vert].to_array()
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        let Some(space) = tangent_space else {
            return;
        };
        let [x, y, z, sign] = space.tangent_encoded();
        // glTF's v points down in the picture, but the green of its normal textures points up: the bitangent is reversed.
        let tangent = Vec4::new(x, y, z, -sign);
        if tangent.is_finite() {
            self.tangents[face][vert] = tangent;
        }
    }
}
