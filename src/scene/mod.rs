//! A scene as the renderer sees it: triangles in render space, materials, lights and cameras.
//!
//! *Render space* is world space recentred and rescaled in f64, so that the scene's bounds are centred on the origin
//! and their longest half axis is 1. Whatever the units and the place of the scene, f32 then has the same precision.

mod accessor;
mod animation;
mod attributes;
mod breaches;
mod budget;
mod buffer;
mod builder;
mod bvh;
mod camera;
mod coat;
mod contact;
mod curve;
mod diagnostic;
mod document;
mod doubled_lights;
mod draco;
mod elements;
mod environment;
mod facet;
mod features;
mod geometry;
mod glb;
mod graph;
mod image;
mod immersion;
mod instance;
mod instancing;
mod json;
mod ktx2;
mod light;
mod light_bounds;
mod light_sources;
mod light_table;
mod light_units;
mod load;
mod material;
mod meshopt;
mod morph;
mod near_lights;
mod nesting;
pub mod object_grid;
mod packed;
mod part;
mod placement;
mod primitive;
mod punctual;
mod scenes;
mod sharing;
mod shine;
mod skin;
mod solid;
mod sphere;
mod tangents;
mod texture;
mod variants;

pub use budget::MEMORY_LIMIT;
pub use features::SceneFeatures;
pub(crate) use immersion::IN_VACUUM;
pub use immersion::Immersion;
pub use light_sources::MOST_SOURCES;
#[cfg(test)]
pub(crate) use light_table::set_alias_table;
pub use light_units::LightUnits;
pub use load::LoadOptions;
pub use packed::PackedScene;
pub(crate) use part::Part;
pub use placement::Placement;
pub(crate) use sphere::Sphere;
pub use texture::Textures;

use std::path::PathBuf;

use glam::{DVec3, Vec2, Vec3, Vec4};

pub use environment::Environment;
pub use light::EmissiveTriangle;
pub use punctual::{Emission, PunctualLight};

/// The map from world space to render space: `render = (world − centre) · scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normalisation {
    /// Centre of the scene's bounds, in world units.
    pub centre: DVec3,
    /// Render units per world unit.
    pub scale: f64,
}

impl Normalisation {
    /// The point of render space that is `world` in world space.
    pub fn to_render(self, world: DVec3) -> Vec3 {
        ((world - self.centre) * self.scale).as_vec3()
    }
}

/// How a surface scatters light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Lambertian reflection with the material's base colour as albedo.
    Matte,
    /// Perfect mirror: Schlick's Fresnel with the base colour as reflectance at normal incidence.
    Mirror,
    /// Boundary of a dielectric.
    Dielectric(Dielectric),
    /// A Lambertian base under a boundary of microfacets: glTF 2.0, appendix B.
    Glossy(Gloss),
}

/// What passes light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dielectric {
    /// Index of refraction inside, relative to vacuum.
    pub ior: f32,
    /// Its square is GGX's α; 0 ..= 1.
    pub roughness: f32,
    /// Share of what is no metal that passes light, 0 ..= 1.
    pub transmission: f32,
    /// How the rest reflects.
    pub gloss: Gloss,
    /// A wall without an inside, which doesn't bend light.
    pub thin: bool,
    /// Absorption coefficient inside, linear RGB, 1/render unit.
    pub absorption: Vec3,
    /// 20 over the Abbe number; 0: the index is that of every wavelength.
    pub dispersion: f32,
}

impl Dielectric {
    /// Smooth and clear.
    pub fn clear(ior: f32) -> Self {
        Self {
            ior,
            roughness: 0.0,
            transmission: 1.0,
            gloss: Gloss::default(),
            thin: false,
            absorption: Vec3::ZERO,
            dispersion: 0.0,
        }
    }
}

/// How a boundary of microfacets reflects.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gloss {
    /// How far the surface is a metal, 0 ..= 1.
    pub metallic: f32,
    /// Its square is GGX's α; 0 ..= 1.
    pub roughness: f32,
    /// Reflectance at normal incidence where it is no metal, linear RGB.
    pub specular_f0: Vec3,
    /// Reflectance at grazing incidence where it is no metal.
    pub specular_f90: f32,
}

/// KHR_materials_clearcoat: a dielectric's reflection above all others.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Coat {
    /// How much of it there is, 0 ..= 1; 0 for none.
    pub factor: f32,
    /// Its square is GGX's α; 0 ..= 1.
    pub roughness: f32,
}

/// Where a surface is there at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Alpha {
    /// Everywhere.
    Opaque,
    /// Where alpha, with texture and corners' colours, is at least the cutoff.
    Mask {
        /// Factor.
        alpha: f32,
        /// The least.
        cutoff: f32,
    },
    /// With alpha as probability.
    Blend {
        /// Factor.
        alpha: f32,
    },
}

/// Indices into [`Textures::lookups`] of what a material's factors are multiplied with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MaterialTextures {
    /// Base colour, and alpha.
    pub base_color: Option<u32>,
    /// Roughness in green, metal in blue.
    pub metallic_roughness: Option<u32>,
    /// Normals, and how far they lean.
    pub normal: Option<(u32, f32)>,
    /// Emission.
    pub emission: Option<u32>,
    /// Transmission in red.
    pub transmission: Option<u32>,
    /// Reflectance at both angles in alpha.
    pub specular: Option<u32>,
    /// Reflectance at normal incidence.
    pub specular_color: Option<u32>,
    /// How much of a clear coat there is, in red.
    pub coat: Option<u32>,
    /// Its roughness, in green.
    pub coat_roughness: Option<u32>,
    /// Its normals, and how far they lean.
    pub coat_normal: Option<(u32, f32)>,
}

/// A glTF material, reduced to what is supported.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// How it scatters.
    pub surface: Surface,
    /// What lies above that.
    pub coat: Coat,
    /// Linear RGB albedo (matte), reflectance (mirror) or tint of each crossing (dielectric); each in 0 ..= 1.
    pub base_color: Vec3,
    /// Emitted radiance, linear RGB; zero for what isn't a light.
    pub emission: Vec3,
    /// Whether the back side emits as well. (Every surface scatters on both sides.)
    pub back_emits: bool,
    /// Whether a camera looks through the back side, as glTF 2.0 has it of surfaces with one side. It reflects light and throws
    /// shadows all the same, and mirrors and glass show it.
    pub back_hidden: bool,
    /// KHR_materials_unlit: it is seen as its emission, but lights nothing and reflects nothing.
    pub unlit: bool,
    /// Where it is there.
    pub alpha: Alpha,
    /// Its textures.
    pub textures: MaterialTextures,
}

/// One primitive of one mesh instance: the unit within which photons and visible points meet.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Name of the node or mesh.
    pub name: String,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Its triangles in [`Scene::triangles`].
    pub triangles: std::ops::Range<u32>,
    /// Where it puts them, if it shares them with other objects.
    pub placement: Option<Placement>,
}

impl Object {
    /// Where a corner of one of its triangles is, in render space.
    fn placed(&self, corner: Vec3) -> Vec3 {
        self.placement.map_or(corner, |placement| placement.point(corner))
    }
}

/// A triangle of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Triangle {
    /// Indices into [`Scene::positions`] and what else vertices have, counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// Index into [`Scene::objects`], or [`SHARED`].
    pub object: u32,
}

/// [`Triangle::object`] of triangles that objects share.
pub const SHARED: u32 = u32::MAX;

/// What a camera's picture shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// What lies within an angle.
    Perspective {
        /// Tangent of half the vertical angle of view.
        tan_half_fov: f32,
    },
    /// What lies within a height.
    Orthographic {
        /// Half of it, in render units.
        half_height: f32,
    },
}

/// What makes things out of focus blurred.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Its radius, in render units.
    pub radius: f32,
    /// Distance along the direction of view of what is in focus, in render units.
    pub focus: f32,
}

/// A camera in render space.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Centre of projection.
    pub position: Vec3,
    /// Unit vector to the picture's right.
    pub right: Vec3,
    /// Unit vector to the picture's top.
    pub up: Vec3,
    /// Unit vector into the picture.
    pub forward: Vec3,
    /// What it shows.
    pub projection: Projection,
    /// Width over height where the file gives it.
    pub aspect: Option<f32>,
    /// Its lens; a pinhole has none.
    pub lens: Option<Lens>,
    /// How far the film is moved to the right and up, in parts of its larger side.
    pub shift: Vec2,
}

/// A scene, ready to render.
#[derive(Debug, Clone)]
pub struct Scene {
    /// File name without its extension.
    pub name: String,
    /// Vertex positions in render space; those of shared triangles within −1 ..= 1 in a space of their own, as their
    /// normals and tangents are.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per position.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of the sets 0 and 1, one pair per position; none at all where no primitive has any. A set
    /// that a primitive lacks is zero.
    pub texcoords: Vec<[Vec2; 2]>,
    /// Linear RGBA factors of the base colour, one per position, white where a primitive has none; none at all where no
    /// primitive has any.
    pub colors: Vec<Vec4>,
    /// Unit tangents, and in w the sign of the bitangent w · normal × tangent, one per position, zero where a primitive
    /// has none; none at all where no primitive has any.
    pub tangents: Vec<Vec4>,
    /// Triangles, grouped by object.
    pub triangles: Vec<Triangle>,
    /// Objects.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Lights that are points or directions.
    pub lights: Vec<PunctualLight>,
    /// What shines from afar.
    pub environment: Option<Environment>,
    /// Their textures.
    pub textures: Textures,
    /// Cameras; at least one.
    pub cameras: Vec<Camera>,
    /// How render space lies in world space.
    pub normalisation: Normalisation,
    /// Triangles of zero area that were dropped.
    pub dropped_triangles: usize,
    /// The file that it is from, and those that this one refers to.
    pub files: Vec<PathBuf>,
    /// Names of the file's material variants.
    pub variants: Vec<String>,
    /// What the file asks for and the renderer doesn't do, one line each.
    pub warnings: Vec<String>,
    /// What was decided where a file leaves a choice, one line each.
    pub notes: Vec<String>,
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

    /// Triangles that aren't shared.
    pub(crate) fn own_triangles(&self) -> impl Iterator<Item = u32> {
        let all = (0..).zip(&self.triangles);
        all.filter(|(_, triangle)| triangle.object != SHARED)
            .map(|(index, _)| index)
    }

    /// Indices of the objects that share triangles, and corners of those where they put them, in render space.
    pub(crate) fn placed_triangles(&self) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let placed = (0..)
            .zip(&self.objects)
            .filter_map(|(index, object)| Some((index, object, object.placement?)));
        placed.flat_map(move |(index, object, placement)| {
            let triangles = object.triangles.clone();
            triangles.map(move |triangle| (index, self.corners_of(triangle).map(|corner| placement.point(corner))))
        })
    }

    /// Corners of a triangle in the space that it is in.
    pub(crate) fn corners_of(&self, triangle: u32) -> [Vec3; 3] {
        let corners = self.triangles[triangle as usize].vertices;
        corners.map(|vertex| self.positions[vertex as usize])
    }

    /// Area of the triangle with that index, which isn't shared, in square render units.
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
