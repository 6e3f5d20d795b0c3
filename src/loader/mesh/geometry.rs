//! The triangles of a file's scene.

use glam::{Vec2, Vec3, Vec4};

use crate::scene::{Normalisation, Object, Triangle};

/// The triangles of a scene in render space. Vertex attributes are as in the fields of the same names of a
/// [`Scene`](crate::scene::Scene).
pub(crate) struct Geometry {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub texcoords: Vec<[Vec2; 2]>,
    pub colors: Vec<Vec4>,
    pub tangents: Vec<Vec4>,
    pub triangles: Vec<Triangle>,
    pub objects: Vec<Object>,
    /// For each object, the index of its node.
    pub nodes: Vec<usize>,
    pub normalisation: Normalisation,
    pub dropped_triangles: usize,
}

impl Geometry {
    /// Its size in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let sizes = [
            size_of_val(&self.positions[..]) + size_of_val(&self.normals[..]),
            size_of_val(&self.texcoords[..]) + size_of_val(&self.colors[..]) + size_of_val(&self.tangents[..]),
            size_of_val(&self.triangles[..]),
        ];
        sizes.iter().sum::<usize>() as u64
    }
}
