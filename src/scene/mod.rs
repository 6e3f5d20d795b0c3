//! Scenes: triangles in render space, materials, lights and cameras.
//!
//! *Render space* is world space recentred and rescaled in f64, so that the scene's bounds are centred on the origin and their
//! longest half axis is 1. So f32 has the same precision for any units and position of the scene.

mod camera;
mod environment;
mod light;
mod material;
mod placement;
mod remark;
mod texture;

pub use camera::{Camera, Lens, Projection};
pub(crate) use camera::{frame, framed_on};
pub use environment::Environment;
pub use light::{LightKind, PunctualLight};
pub(crate) use material::material_features;
pub(crate) use material::normal_reflectance;
pub use material::*;
pub use placement::Placement;
pub use remark::{LoadChoice, Remark};
pub use texture::Textures;

use std::path::PathBuf;

use glam::{DVec3, Vec2, Vec3, Vec4};

/// What moves may be a little farther away at times between those that are known.
const MARGIN: f64 = 1.0 + 1.0 / 16.0;

/// The map from world space to render space: `render = (world − centre) · scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normalisation {
    /// Centre of the scene's bounds, in world units.
    pub centre: DVec3,
    /// Render units per world unit.
    pub scale: f64,
}

impl Default for Normalisation {
    /// Render space is world space.
    fn default() -> Self {
        Self {
            centre: DVec3::ZERO,
            scale: 1.0,
        }
    }
}

impl Normalisation {
    /// One in whose render space all scenes lie that lie in those of `all`, and a little more if these are several.
    pub fn around(all: &[Self]) -> Self {
        let first = all.first().copied().unwrap_or_default();
        if all.iter().all(|other| *other == first) {
            return first;
        }
        let half = |normalisation: &Self| DVec3::splat(normalisation.scale.recip());
        let lower = all
            .iter()
            .map(|one| one.centre - half(one))
            .fold(DVec3::INFINITY, DVec3::min);
        let upper = all
            .iter()
            .map(|one| one.centre + half(one))
            .fold(DVec3::NEG_INFINITY, DVec3::max);
        Self {
            centre: 0.5 * lower + 0.5 * upper,
            scale: (0.5 * upper - 0.5 * lower).max_element().recip() / MARGIN,
        }
    }

    /// The point of render space that is `world` in world space.
    pub fn to_render(self, world: DVec3) -> Vec3 {
        ((world - self.centre) * self.scale).as_vec3()
    }
}

/// One primitive of one mesh instance: visible points accept photons of their own object only.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Name of the node or mesh.
    pub name: String,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Its triangles in [`Scene::triangles`].
    pub triangles: std::ops::Range<u32>,
    /// The placement of its triangles, if it shares them with other objects.
    pub placement: Option<Placement>,
}

impl Object {
    /// Position of a corner of one of its triangles, in render space.
    pub(crate) fn placed(&self, corner: Vec3) -> Vec3 {
        self.placement.map_or(corner, |placement| placement.point(corner))
    }
}

/// A triangle of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Triangle {
    /// Indices into [`Scene::positions`] and the other vertex attributes, counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// Index into [`Scene::objects`], or [`SHARED`].
    pub object: u32,
}

/// [`Triangle::object`] of triangles that objects share.
pub const SHARED: u32 = u32::MAX;

/// A scene, ready to render.
#[derive(Debug, Clone)]
pub struct Scene {
    /// File name without its extension.
    pub name: String,
    /// Vertex positions in render space; those of shared triangles within −1 ..= 1 in a space of their own, like their normals
    /// and tangents.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per position.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of the sets 0 and 1, one pair per position; empty if no primitive has any. A set that a primitive
    /// lacks is zero.
    pub texcoords: Vec<[Vec2; 2]>,
    /// Linear RGBA factors of the base colour, one per position, white if a primitive has none; empty if no primitive has any.
    pub colors: Vec<Vec4>,
    /// Unit tangents, and in w the sign of the bitangent w · normal × tangent, one per position, zero if a primitive has none;
    /// empty if no primitive has any.
    pub tangents: Vec<Vec4>,
    /// Triangles, grouped by object.
    pub triangles: Vec<Triangle>,
    /// Objects.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Punctual lights.
    pub lights: Vec<PunctualLight>,
    /// Environment lighting.
    pub environment: Option<Environment>,
    /// Textures of the materials.
    pub textures: Textures,
    /// Cameras; at least one.
    pub cameras: Vec<Camera>,
    /// The map from world space to render space.
    pub normalisation: Normalisation,
    /// Triangles of zero area that were dropped.
    pub dropped_triangles: usize,
    /// The file that it was read from, and the files that it refers to.
    pub files: Vec<PathBuf>,
    /// Names of the file's material variants.
    pub variants: Vec<String>,
    /// Features of the file that the renderer does not support, one line each.
    pub warnings: Vec<Remark>,
    /// Decisions where the file leaves a choice, one line each.
    pub notes: Vec<Remark>,
}

impl Scene {
    /// Lower and upper corner of the bounds of all triangles, in render space.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.corners()
            .fold(start, |(lower, upper), corner| (lower.min(corner), upper.max(corner)))
    }

    /// Corners of all triangles of all objects, in render space.
    pub(crate) fn corners(&self) -> impl Iterator<Item = Vec3> {
        let own = self.own_triangles().flat_map(|triangle| self.corners_of(triangle));
        own.chain(self.placed_triangles().flat_map(|(_, corners)| corners))
    }

    /// Triangles that are not shared.
    pub(crate) fn own_triangles(&self) -> impl Iterator<Item = u32> {
        let all = (0..).zip(&self.triangles);
        all.filter(|(_, triangle)| triangle.object != SHARED)
            .map(|(index, _)| index)
    }

    /// Indices of the objects that share triangles, and the corners of their placed triangles, in render space.
    pub(crate) fn placed_triangles(&self) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let placed = (0..)
            .zip(&self.objects)
            .filter_map(|(index, object)| Some((index, object, object.placement?)));
        placed.flat_map(move |(index, object, placement)| {
            let triangles = object.triangles.clone();
            triangles.map(move |triangle| (index, self.corners_of(triangle).map(|corner| placement.point(corner))))
        })
    }

    /// Corners of a triangle in its own space.
    pub(crate) fn corners_of(&self, triangle: u32) -> [Vec3; 3] {
        let corners = self.triangles[triangle as usize].vertices;
        corners.map(|vertex| self.positions[vertex as usize])
    }

    /// Area of the triangle with that index, which must not be shared, in square render units.
    pub fn triangle_area(&self, triangle: u32) -> f64 {
        area(self.corners_of(triangle))
    }

    /// Area of the object with that index, in square render units.
    pub fn object_area(&self, object: u32) -> f64 {
        let object = &self.objects[object as usize];
        let placed = |triangle: u32| self.corners_of(triangle).map(|corner| object.placed(corner));
        object.triangles.clone().map(placed).map(area).sum()
    }
}

/// Area of a triangle.
pub(crate) fn area(corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    0.5 * (b - a).cross(c - a).length()
}
