//! A scene in the layout of the device.

mod bvh;
mod coincident_faces;
mod duplicate_lights;
mod emission_distribution;
mod emissive;
mod environment_table;
mod features;
mod immersion;
mod light_bounds;
mod light_sources;
mod light_table;
mod near_lights;
mod nesting;
pub mod object_grid;
mod part;
mod refit;
mod sphere;

pub use emissive::EmissiveTriangle;
pub use features::SceneFeatures;
pub(crate) use immersion::IN_VACUUM;
pub use immersion::Immersion;
pub use light_sources::MOST_SOURCES;
#[cfg(test)]
pub(crate) use light_table::set_alias_table;
pub(crate) use part::Part;
pub(crate) use sphere::Sphere;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use glam::{DVec3, Vec3, Vec4};

use self::bvh::Bvh;
use self::near_lights::NearLights;
use self::nesting::Nesting;
use self::object_grid::object_grids;
use crate::layout::{
    BACK_EMITS, BvhRecord, Corner, HavelTriangle, Instance, Light, LightSource, MIRRORED, Material, NO_LIGHT,
    ObjectGrid, RANK, SEE_THROUGH, SMOOTH_SHADED, ShadingTriangle, TEXTURED_TRIANGLE, TRIANGLE_LIGHT, TextureLookup,
};
use crate::scene::{Alpha, Environment, SHARED, Scene, area};

/// Maximum number of light sources of which each has a ray of its own at a visible point; of more, one is sampled.
const SAMPLED_ALL: usize = 4;

const COARSE_LIGHTS: &str = "textures of lamps have too many texels for a light each: the picture is correct, but if single \
                             texels emit, light is sampled by areas of several texels, which is noisier";

/// What the ray stages read, in the order of the BVH's leaves.
#[derive(Debug, Clone)]
pub struct PackedScene {
    /// Hierarchy, the root first.
    pub bvh: Vec<BvhRecord>,
    /// Triangles for the paper's intersection test.
    pub havel_triangles: Vec<HavelTriangle>,
    /// The same triangles for shading.
    pub shading_triangles: Vec<ShadingTriangle>,
    /// How many of them are in render space. They come first.
    pub own_triangles: u32,
    /// Where the others are.
    pub instances: Vec<Instance>,
    /// Materials.
    pub materials: Vec<Material>,
    /// What their corners have for textures, three to a triangle; none where nothing is textured.
    pub corners: Vec<Corner>,
    /// Textures.
    pub textures: Vec<TextureLookup>,
    /// Texels of their images, RGBA bytes; whole fours.
    pub texels: Vec<u32>,
    /// What the kernels need to know.
    pub features: SceneFeatures,
    /// Lights.
    pub lights: Vec<Light>,
    /// Ranges of [`PackedScene::lights`] that photon paths are aimed from: an object's triangles, another light, or several
    /// neighbours of such. [`MOST_SOURCES`] at the most.
    pub sources: Vec<Range<u32>>,
    /// What they emit together, mean of RGB.
    pub power: f64,
    /// Radiance from afar, and how directions are chosen from it.
    pub environment: Vec<[f32; 4]>,
    /// The paper's grid of each object.
    pub object_grids: Vec<ObjectGrid>,
    /// Cells of all of them.
    pub object_cells: u32,
    /// Index in [`Scene::triangles`] of each packed triangle.
    pub order: Vec<u32>,
    /// Ranges of shared triangles in that order, one for each primitive.
    pub shared: Vec<Range<u32>>,
    /// Render units per scene unit.
    pub scale: f64,
    /// Probability that direct light is sampled by a direction of the BSDF instead of a light's point, near a light.
    pub bsdf_sampling: f32,
    /// Where lights are near: centre and squared radius of spheres.
    pub near_lights: Vec<[f32; 4]>,
    /// Bounds of [`PackedScene::sources`].
    pub light_sources: Vec<LightSource>,
    /// What a point is in.
    pub immersion: Immersion,
    /// Of each light, the media that it is in: see [`Immersion::media_at`].
    pub media_of_lights: Vec<[u32; 4]>,
    /// What a user should know of it, beside [`Scene::notes`].
    pub notes: Vec<String>,
}

impl PackedScene {
    /// Builds the hierarchy and precomputes the triangles.
    ///
    /// # Errors
    /// A text, if there are too many triangles, or too many materials for glass that overlaps.
    pub fn new(scene: &Scene) -> Result<Self, String> {
        let shared = shared_triangles(scene);
        let bvh = bvh::build(scene, &shared.ranges, &shared.placed)?;
        Self::of(scene, shared, bvh)
    }

    /// The scene at another time of its animations: the hierarchy is refitted if it has the same triangles.
    ///
    /// # Errors
    /// As [`PackedScene::new`].
    pub fn moved(&self, scene: &Scene) -> Result<Self, String> {
        let shared = shared_triangles(scene);
        let is_alike = shared.placed.len() == self.instances.len()
            && refit::is_of(&self.order, &self.shared, scene, &shared.ranges);
        let bvh = if is_alike {
            let before = Bvh {
                records: self.bvh.clone(),
                order: self.order.clone(),
                shared: self.shared.clone(),
            };
            refit::refit(before, scene, &shared.placed)
        } else {
            bvh::build(scene, &shared.ranges, &shared.placed)?
        };
        Self::of(scene, shared, bvh)
    }

    fn of(scene: &Scene, shared: SharedTriangles, bvh: Bvh) -> Result<Self, String> {
        let SharedTriangles {
            materials: shared_materials,
            placed,
            ..
        } = shared;
        let corners: Vec<[Vec3; 3]> = bvh.order.iter().map(|&index| scene.corners_of(index)).collect();
        let light_table = light_table::lights(scene, &bvh.order);
        let own_triangles = bvh.shared.first().map_or(bvh.order.len() as u32, |shared| shared.start);
        let own = bvh.order[..own_triangles as usize].iter().map(|&index| {
            let object = scene.triangles[index as usize].object;
            (index, scene.objects[object as usize].material)
        });
        let shared = bvh
            .shared
            .iter()
            .zip(shared_materials)
            .flat_map(|(triangles, material)| {
                let order = &bvh.order[triangles.start as usize..triangles.end as usize];
                order.iter().map(move |&index| (index, material))
            });
        let mut shading_triangles: Vec<_> = own
            .chain(shared)
            .zip(&corners)
            .map(|((index, material), corners)| shading_triangle(scene, index, material, corners))
            .collect();
        let emissive = light_table
            .lights
            .iter()
            .enumerate()
            .filter(|(_, light)| light.kind == TRIANGLE_LIGHT && Part::of(light).number() == 0);
        for (index, light) in emissive {
            shading_triangles[light.triangle as usize].light = index as u32;
        }
        for &[double, light] in &light_table.doubles {
            shading_triangles[double as usize].light = shading_triangles[light as usize].light;
        }
        let materials: Vec<Material> = scene.materials.iter().map(crate::scene::Material::record).collect();
        let nesting = Nesting::of(scene)?;
        let instances = instances(scene, &placed, &bvh.shared, &nesting.ranks);
        let coincident = coincident_faces::coincident_faces(&bvh.records, &shading_triangles, &instances, &materials);
        for (triangle, flags) in shading_triangles.iter_mut().zip(coincident.flags) {
            triangle.flags |= flags;
            if triangle.object != SHARED {
                triangle.flags |= nesting.ranks[triangle.object as usize] << RANK;
            }
        }
        let mut features = SceneFeatures::of(&shading_triangles, &materials, &light_table.lights);
        features.instanced = !instances.is_empty();
        features.nested = nesting.overlaps;
        features.few_sources = (2..=SAMPLED_ALL).contains(&light_table.sources.len());
        features.many_sources = light_table.sources.len() > SAMPLED_ALL;
        features.coincident_faces |= features.coincident_interfaces || coincident.doubled;
        // Where a solid has no thickness, it is a thin wall.
        features.thin_walls |= features.coincident_interfaces && coincident.doubled;
        let mut texels = scene.textures.texels.clone();
        texels.resize(texels.len().next_multiple_of(4), 0);
        let (object_grids, object_cells) = object_grids(scene);
        let near_lights = NearLights {
            lights: &light_table.lights,
            powers: &light_table.powers,
            sources: &light_table.sources,
            corners: &corners,
            environment: scene.environment.as_ref(),
        };
        let two_sided = |triangle: u32| {
            let material = shading_triangles[triangle as usize].material;
            materials[material as usize].flags & BACK_EMITS != 0
        };
        let immersion = Immersion::new(scene, &nesting);
        let media_of_lights = immersion.of_lights(&light_table.lights, &corners);
        features.immersed = media_of_lights.iter().any(|media| *media != IN_VACUUM);
        let light_sources = light_bounds::light_sources(&light_table, &corners, two_sided, scene.environment.as_ref());
        Ok(Self {
            power: light_table.power,
            notes: if light_table.is_coarse {
                vec![COARSE_LIGHTS.to_owned()]
            } else {
                Vec::new()
            },
            corners: if features.textured {
                texture_corners(scene, &bvh.order)
            } else {
                Vec::new()
            },
            textures: scene.textures.lookups.clone(),
            texels,
            features,
            object_grids,
            object_cells,
            havel_triangles: corners.iter().map(havel_triangle).collect(),
            shading_triangles,
            own_triangles,
            instances,
            bsdf_sampling: near_lights.bsdf_sampling(area_of_all(scene)),
            near_lights: near_lights.spheres(),
            light_sources,
            immersion,
            media_of_lights,
            materials,
            lights: light_table.lights,
            sources: light_table.sources,
            environment: scene
                .environment
                .as_ref()
                .map_or_else(environment_table::no_table, Environment::table),
            bvh: bvh.records,
            order: bvh.order,
            shared: bvh.shared,
            scale: scene.normalisation.scale,
        })
    }

    /// Triangles, shared ones as often as they are seen.
    pub fn seen_triangles(&self) -> u64 {
        let shared = self.instances.iter().map(|instance| u64::from(instance.triangle_count));
        u64::from(self.own_triangles) + shared.sum::<u64>()
    }

    /// How many primitives instances share.
    pub fn shared_primitives(&self) -> usize {
        let firsts = self.instances.iter().map(|instance| instance.first_triangle);
        firsts.collect::<BTreeSet<_>>().len()
    }
}

/// What of a scene objects share.
struct SharedTriangles {
    /// In [`Scene::triangles`].
    ranges: Vec<Range<u32>>,
    materials: Vec<u32>,
    /// In the order of the objects.
    placed: Vec<bvh::PlacedMesh>,
}

fn shared_triangles(scene: &Scene) -> SharedTriangles {
    let mut found = SharedTriangles {
        ranges: Vec::new(),
        materials: Vec::new(),
        placed: Vec::new(),
    };
    let mut known = BTreeMap::new();
    for object in &scene.objects {
        let Some(placement) = object.placement else { continue };
        let shared = *known.entry(object.triangles.start).or_insert_with(|| {
            found.ranges.push(object.triangles.clone());
            found.materials.push(object.material);
            found.ranges.len() - 1
        });
        found.placed.push(bvh::PlacedMesh { shared, placement });
    }
    found
}

fn instances(scene: &Scene, placed: &[bvh::PlacedMesh], shared: &[Range<u32>], ranks: &[u32]) -> Vec<Instance> {
    let objects = (0..)
        .zip(&scene.objects)
        .filter(|(_, object)| object.placement.is_some());
    let instance = |((object, _), placed): ((u32, _), &bvh::PlacedMesh)| {
        let triangles = &shared[placed.shared];
        Instance {
            rows: placed.placement.rows,
            object,
            flags: if placed.placement.is_mirrored() { MIRRORED } else { 0 } | ranks[object as usize] << RANK,
            first_triangle: triangles.start,
            triangle_count: triangles.len() as u32,
        }
    };
    objects.zip(placed).map(instance).collect()
}

/// Havel and Herout, «Yet faster ray-triangle intersection (using SSE4)», 2010, with u and v for the second and the
/// third corner. In f64, since the planes of small triangles cancel.
pub fn havel_triangle(corners: &[Vec3; 3]) -> HavelTriangle {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (ab, ac) = (b - a, c - a);
    let n = ab.cross(ac);
    let n2 = n.length_squared();
    let n_u = ac.cross(n) / n2;
    let n_v = n.cross(ab) / n2;
    let plane = |n: DVec3, d: f64| [n.x as f32, n.y as f32, n.z as f32, d as f32];
    // The normal's length cancels in t = (d − o·n) / (r·n); scaled to 1 it keeps small triangles within f32's range.
    let unit = n / n2.sqrt();
    HavelTriangle {
        n0: plane(unit, unit.dot(a)),
        n1: plane(n_u, -n_u.dot(a)),
        n2: plane(n_v, -n_v.dot(a)),
    }
}

fn shading_triangle(scene: &Scene, index: u32, material_index: u32, corners: &[Vec3; 3]) -> ShadingTriangle {
    let triangle = scene.triangles[index as usize];
    let normals = triangle.vertices.map(|vertex| scene.normals[vertex as usize]);
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let geometric = (b - a).cross(c - a).normalize().as_vec3();
    // A placement may stretch the difference.
    let flat = if triangle.object == SHARED {
        1.0 - 1e-12
    } else {
        0.999_999
    };
    let smooth_shaded = normals
        .iter()
        .any(|normal| normal.as_dvec3().dot(geometric.as_dvec3()) < flat);
    let material = &scene.materials[material_index as usize];
    let colored = triangle.vertices.iter().any(|&vertex| {
        let color = scene.colors.get(vertex as usize);
        color.is_some_and(|color| *color != Vec4::ONE)
    });
    let textured = colored || material.needs_corners();
    ShadingTriangle {
        p0: corners[0].into(),
        n0: encode_direction(normals[0]),
        p1: corners[1].into(),
        n1: encode_direction(normals[1]),
        p2: corners[2].into(),
        n2: encode_direction(normals[2]),
        object: triangle.object,
        material: material_index,
        flags: if smooth_shaded { SMOOTH_SHADED } else { 0 }
            | if textured { TEXTURED_TRIANGLE } else { 0 }
            | if material.alpha == Alpha::Opaque {
                0
            } else {
                SEE_THROUGH
            },
        light: NO_LIGHT,
    }
}

fn texture_corners(scene: &Scene, order: &[u32]) -> Vec<Corner> {
    let vertices = order.iter().flat_map(|&index| scene.triangles[index as usize].vertices);
    let corner = |vertex: u32| {
        let vertex = vertex as usize;
        let [first, second] = scene.texcoords.get(vertex).copied().unwrap_or_default();
        let color = scene.colors.get(vertex).copied().unwrap_or(Vec4::ONE).to_array();
        let [r, g, b, a] = color.map(|value| u32::from(half::f16::from_f32(value.min(65_504.0)).to_bits()));
        let tangent = scene.tangents.get(vertex).copied().unwrap_or_default();
        let bitangent = if tangent.w == 0.0 { 0.0 } else { tangent.w.signum() };
        Corner {
            first: first.to_array(),
            second: second.to_array(),
            color: [r | g << 16, b | a << 16],
            tangent: if bitangent == 0.0 {
                0
            } else {
                encode_direction(tangent.truncate())
            },
            bitangent,
        }
    };
    vertices.map(corner).collect()
}

/// Area of all surfaces.
fn area_of_all(scene: &Scene) -> f64 {
    let own = scene.own_triangles().map(|triangle| scene.corners_of(triangle));
    let placed = scene.placed_triangles().map(|(_, corners)| corners);
    own.chain(placed).map(area).sum()
}

/// Unit vector to two 16-bit numbers, as `glsl/common/sampling.glsl` has it.
pub fn encode_direction(direction: Vec3) -> u32 {
    let length = direction.abs().element_sum();
    let (mut x, mut y) = (direction.x / length, direction.y / length);
    if direction.z < 0.0 {
        (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    }
    let quantise = |value: f32| u32::from((value.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    quantise(x) | quantise(y) << 16
}
