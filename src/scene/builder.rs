//! Collects triangles in render space.

use glam::{DVec3, Vec3};
use gltf::json::Root;

use super::diagnostic::Check;
use super::facet::{face_normal, spans_area};
use super::geometry::Instance;
use super::{Normalisation, Object, Triangle};

/// Mark of a vertex that no triangle has used yet.
const UNSEEN: u32 = u32::MAX;

/// The triangles of a scene in render space.
pub(super) struct Geometry {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub triangles: Vec<Triangle>,
    pub objects: Vec<Object>,
    pub normalisation: Normalisation,
    pub dropped_triangles: usize,
}

/// Grows a [`Geometry`] by one instance after another.
pub(super) struct Builder {
    /// What there is so far.
    pub geometry: Geometry,
    /// Vertices whose normal had no length and was replaced.
    pub zero_normals: usize,
    /// For each vertex of the primitive in hand, its index in the scene, or [`UNSEEN`]. Kept between primitives, and
    /// cleared only where it was written: many primitives may use small parts of one large accessor.
    scene_vertices: Vec<u32>,
    /// Where `scene_vertices` was written.
    seen: Vec<usize>,
}

impl Builder {
    /// A builder that has no objects yet.
    pub(super) fn new(normalisation: Normalisation) -> Self {
        Self {
            geometry: Geometry {
                positions: Vec::new(),
                normals: Vec::new(),
                triangles: Vec::new(),
                objects: Vec::new(),
                normalisation,
                dropped_triangles: 0,
            },
            zero_normals: 0,
            scene_vertices: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Adds an instance as an object, unless nothing of it is left. Returns how many triangles were dropped.
    pub(super) fn add(&mut self, root: &Root, instance: &Instance<'_>) -> Check<usize> {
        let primitive = &instance.primitive;
        let first = self.geometry.triangles.len();
        let object = self.geometry.objects.len() as u32;
        let mut dropped = 0;
        if self.scene_vertices.len() < primitive.vertex_count() {
            self.scene_vertices.resize(primitive.vertex_count(), UNSEEN);
        }
        for triangle in 0..primitive.triangle_count() {
            let (vertices, corners) = instance.world_triangle(triangle)?;
            let normalisation = self.geometry.normalisation;
            let positions = corners.map(|corner| normalisation.to_render(corner));
            let Some(face_normal) = face_normal(corners).filter(|_| spans_area(positions)) else {
                dropped += 1;
                continue;
            };
            let mut scene_vertices = [0; 3];
            for ((scene_vertex, vertex), position) in scene_vertices.iter_mut().zip(vertices).zip(positions) {
                *scene_vertex = match primitive.normal(vertex)? {
                    Some(normal) => self.shared_vertex(vertex, position, instance.normal_matrix * normal, face_normal),
                    // Flat shading: a vertex that two triangles share would have two normals.
                    None => self.push_vertex(position, face_normal),
                };
            }
            self.geometry.triangles.push(Triangle {
                vertices: scene_vertices,
                object,
            });
        }
        for vertex in self.seen.drain(..) {
            self.scene_vertices[vertex] = UNSEEN;
        }
        self.geometry.dropped_triangles += dropped;
        let last = self.geometry.triangles.len();
        if last > first {
            self.geometry.objects.push(Object {
                name: instance.name(root),
                material: primitive.material as u32,
                triangles: first as u32..last as u32,
            });
        }
        Ok(dropped)
    }

    /// The scene's vertex for a vertex of the primitive in hand. The first triangle that uses it adds it.
    fn shared_vertex(&mut self, vertex: usize, position: Vec3, normal: DVec3, face_normal: DVec3) -> u32 {
        if self.scene_vertices[vertex] == UNSEEN {
            let normal = normal.try_normalize().unwrap_or_else(|| {
                self.zero_normals += 1;
                face_normal
            });
            self.scene_vertices[vertex] = self.push_vertex(position, normal);
            self.seen.push(vertex);
        }
        self.scene_vertices[vertex]
    }

    fn push_vertex(&mut self, position: Vec3, normal: DVec3) -> u32 {
        self.geometry.positions.push(position);
        self.geometry.normals.push(normal.as_vec3());
        (self.geometry.positions.len() - 1) as u32
    }
}
