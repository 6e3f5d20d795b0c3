//! The triangles that a file shows.

use glam::{Vec2, Vec3, Vec4};

use crate::scene::{Normalisation, Object, Triangle};

/// The triangles of a scene in render space. Vertices have what the fields of the same names of a
/// [`Scene`](crate::scene::Scene) say.
pub(crate) struct Geometry {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub texcoords: Vec<[Vec2; 2]>,
    pub colors: Vec<Vec4>,
    pub tangents: Vec<Vec4>,
    pub triangles: Vec<Triangle>,
    pub objects: Vec<Object>,
    /// Of each object, the index of the node that shows it.
    pub nodes: Vec<usize>,
    pub normalisation: Normalisation,
    pub dropped_triangles: usize,
}

impl Geometry {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> u64 {
        let sizes = [
            size_of_val(&self.positions[..]) + size_of_val(&self.normals[..]),
            size_of_val(&self.texcoords[..]) + size_of_val(&self.colors[..]) + size_of_val(&self.tangents[..]),
            size_of_val(&self.triangles[..]),
        ];
        sizes.iter().sum::<usize>() as u64
    }
}
