//! Collects triangles in render space.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4};
use gltf_json::Root;

use super::attributes::NotFinite;
use super::facet::{face_normal, spans_area};
use super::geometry::Geometry;
use super::mesh_instance::{MeshInstance, WorldTriangle};
use super::normalisation::normalise;
use super::primitive::FaceCorner;
use super::sharing::{placed, shareable, stays_whole};
use crate::loader::diagnostic::Check;
use crate::scene::{Normalisation, Object, Placement, SHARED, Triangle};
use std::ops::Range;

/// Mark of a vertex that no triangle has used yet.
const UNSEEN: u32 = u32::MAX;

/// The triangles of a shared primitive.
pub(crate) struct Shared {
    /// From the mesh's space to the triangles'.
    space: Normalisation,
    /// In [`Geometry::triangles`].
    triangles: Range<u32>,
    /// Triangles of zero area that were dropped.
    dropped: usize,
}

/// The shared part of an instance.
struct Placed {
    triangles: Range<u32>,
    placement: Placement,
    dropped: usize,
}

/// Grows a [`Geometry`] by one instance after another.
pub(crate) struct Builder {
    /// The geometry so far.
    pub geometry: Geometry,
    /// Vertices whose normal had no length and was replaced.
    pub zero_normals: usize,
    /// Texture coordinates, colours and tangents that were not finite and were left out.
    pub not_finite: usize,
    /// Whether instances share triangles.
    pub shares: bool,
    /// Triangles that they share, by mesh and primitive.
    pub shared: HashMap<(usize, usize), Shared>,
    /// For each vertex of the current primitive, its index in the scene, or [`UNSEEN`]. Reused for all primitives, and cleared
    /// only where it was written: many primitives may use small parts of one large accessor.
    scene_vertices: Vec<u32>,
    /// The written elements of `scene_vertices`.
    seen: Vec<usize>,
}

impl Builder {
    /// An empty builder.
    pub(crate) fn new(normalisation: Normalisation, shares: bool) -> Self {
        Self {
            geometry: Geometry {
                positions: Vec::new(),
                normals: Vec::new(),
                texcoords: Vec::new(),
                colors: Vec::new(),
                tangents: Vec::new(),
                triangles: Vec::new(),
                objects: Vec::new(),
                nodes: Vec::new(),
                normalisation,
                dropped_triangles: 0,
            },
            zero_normals: 0,
            not_finite: 0,
            shares,
            shared: HashMap::new(),
            scene_vertices: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Size of the geometry so far, plus the minimum for another instance, in bytes.
    pub(crate) fn bytes_with(&self, instance: &MeshInstance<'_>) -> u64 {
        let more = if self.shared.contains_key(&instance.key()) {
            0
        } else {
            let (vertices, triangles) = (instance.primitive.attributes.len(), instance.primitive.triangle_count());
            let used = vertices.min(3 * triangles);
            size_of::<u32>() * vertices + 2 * size_of::<Vec3>() * used + size_of::<Triangle>() * triangles
        };
        self.geometry.bytes() + more as u64
    }

    /// Adds an instance as an object, unless it has no triangles left. Returns the number of dropped triangles.
    pub(crate) fn add(&mut self, root: &Root, instance: &MeshInstance<'_>) -> Check<usize> {
        let object = |triangles, placement| Object {
            name: instance.name(root),
            material: instance.primitive.material as u32,
            triangles,
            placement,
        };
        let shared = self.share(root, instance)?;
        let (object, dropped) = if let Some(Placed {
            triangles,
            placement,
            dropped,
        }) = shared
        {
            (object(triangles, Some(placement)), dropped)
        } else {
            let first = self.geometry.triangles.len() as u32;
            let index = self.geometry.objects.len() as u32;
            let dropped = self.add_triangles(instance, self.geometry.normalisation, index)?;
            (object(first..self.geometry.triangles.len() as u32, None), dropped)
        };
        self.geometry.dropped_triangles += dropped;
        if !object.triangles.is_empty() {
            self.geometry.objects.push(object);
            self.geometry.nodes.push(instance.node_index());
        }
        Ok(dropped)
    }

    /// Places the shared triangles of an instance's primitive by its node; `None` if it needs its own triangles: emissive ones
    /// are lights, skins and morph targets differ between nodes, and nearly flat or tiny instances would be lost by rounding.
    fn share(&mut self, root: &Root, instance: &MeshInstance<'_>) -> Check<Option<Placed>> {
        let Some(to_world) = shareable(root, instance).filter(|_| self.shares) else {
            return Ok(None);
        };
        let unplaced = instance.unplaced();
        let known = self.shared.get(&instance.key());
        let space = match known.map_or_else(
            || normalise(root, std::slice::from_ref(&unplaced)),
            |shared| Ok(shared.space),
        ) {
            Ok(space) => space,
            Err(_) => return Ok(None),
        };
        let Some(placement) = Placement::new(placed(space, to_world, self.geometry.normalisation)) else {
            return Ok(None);
        };
        if known.is_none() {
            let first = self.geometry.triangles.len() as u32;
            let dropped = self.add_triangles(&unplaced, space, SHARED)?;
            let shared = Shared {
                space,
                triangles: first..self.geometry.triangles.len() as u32,
                dropped,
            };
            self.shared.insert(instance.key(), shared);
        }
        let Shared { triangles, dropped, .. } = &self.shared[&instance.key()];
        let is_whole = !triangles.is_empty() && stays_whole(&self.geometry, triangles, placement);
        Ok(is_whole.then(|| Placed {
            triangles: triangles.clone(),
            placement,
            dropped: *dropped,
        }))
    }

    /// Adds the triangles of an object in a space. Returns the number of dropped ones.
    pub(crate) fn add_triangles(
        &mut self,
        instance: &MeshInstance<'_>,
        space: Normalisation,
        object: u32,
    ) -> Check<usize> {
        let primitive = &instance.primitive;
        let mut dropped = 0;
        if self.scene_vertices.len() < primitive.attributes.len() {
            self.scene_vertices.resize(primitive.attributes.len(), UNSEEN);
        }
        for triangle in 0..primitive.triangle_count() {
            let WorldTriangle { corners, positions } = instance.triangle(triangle)?;
            let rounded = positions.map(|position| space.to_render(position));
            let Some(face_normal) = face_normal(positions).filter(|_| spans_area(rounded)) else {
                dropped += 1;
                continue;
            };
            let mut scene_vertices = [0; 3];
            for ((scene_vertex, corner), position) in scene_vertices.iter_mut().zip(corners).zip(rounded) {
                *scene_vertex = self.vertex(instance, corner, position, face_normal)?;
            }
            self.geometry.triangles.push(Triangle {
                vertices: scene_vertices,
                object,
            });
        }
        for vertex in self.seen.drain(..) {
            self.scene_vertices[vertex] = UNSEEN;
        }
        Ok(dropped)
    }

    /// Gives the vertices of the last objects the attributes that only earlier ones have.
    pub(crate) fn complete_attributes(&mut self) {
        let Geometry {
            positions,
            texcoords,
            colors,
            tangents,
            ..
        } = &mut self.geometry;
        pad(texcoords, positions.len(), NO_TEXCOORDS);
        pad(colors, positions.len(), NO_COLOR);
        pad(tangents, positions.len(), NO_TANGENT);
    }

    /// The scene's vertex for a vertex of the current primitive. The first triangle that uses it adds it.
    fn vertex(
        &mut self,
        instance: &MeshInstance<'_>,
        corner: FaceCorner,
        position: Vec3,
        face_normal: DVec3,
    ) -> Check<u32> {
        let vertex = corner.vertex;
        let known = self.scene_vertices[vertex];
        if known != UNSEEN && !instance.primitive.splits_vertices() {
            return Ok(known);
        }
        let tangent = self.or_left_out(instance.tangent(corner)?, NO_TANGENT);
        // A seam of the texture gives a vertex several tangents.
        if known != UNSEEN && tangent == self.geometry.tangents.get(known as usize).copied() {
            return Ok(known);
        }
        let normal = match instance.normal(vertex)? {
            // Flat shading: a vertex that two triangles share would have two normals.
            None => face_normal,
            Some(normal) => {
                self.scene_vertices[vertex] = self.geometry.positions.len() as u32;
                self.seen.push(vertex);
                normal.try_normalize().unwrap_or_else(|| {
                    self.zero_normals += 1;
                    face_normal
                })
            }
        };
        let attributes = &instance.primitive.attributes;
        let texcoords = self.or_left_out(attributes.texcoords(vertex), NO_TEXCOORDS);
        let color = self.or_left_out(attributes.color(vertex), NO_COLOR);
        let geometry = &mut self.geometry;
        let index = geometry.positions.len();
        push(&mut geometry.texcoords, index, texcoords, NO_TEXCOORDS);
        push(&mut geometry.colors, index, color, NO_COLOR);
        push(&mut geometry.tangents, index, tangent, NO_TANGENT);
        geometry.positions.push(position);
        geometry.normals.push(normal.as_vec3());
        Ok(index as u32)
    }

    /// An attribute, or its replacement if it is not finite.
    fn or_left_out<T>(&mut self, attribute: Option<Result<T, NotFinite>>, absent: T) -> Option<T> {
        attribute.map(|value| {
            value.unwrap_or_else(|NotFinite| {
                self.not_finite += 1;
                absent
            })
        })
    }
}

/// Default attributes of vertices in a scene where other vertices have them.
const NO_TEXCOORDS: [Vec2; 2] = [Vec2::ZERO; 2];
const NO_COLOR: Vec4 = Vec4::ONE;
const NO_TANGENT: Vec4 = Vec4::ZERO;

/// Sets an attribute of the vertex at `index`, which is new. As long as no vertex has it, nothing is stored.
fn push<T: Copy>(attribute: &mut Vec<T>, index: usize, value: Option<T>, absent: T) {
    if let Some(value) = value {
        attribute.resize(index, absent);
        attribute.push(value);
    }
}

/// Fills an attribute that any vertex has up to `count`.
fn pad<T: Copy>(attribute: &mut Vec<T>, count: usize, absent: T) {
    if !attribute.is_empty() {
        attribute.resize(count, absent);
    }
}
