//! Loads a glTF file as a [`Scene`].

mod animation;
mod camera;
mod curve;
mod diagnostic;
mod extensions;
mod file;
mod graph;
mod light;
mod light_units;
mod limits;
mod material;
mod mesh;
mod scenes;
mod texture;
mod variants;

pub use self::file::budget::MEMORY_LIMIT;
pub use self::light_units::LightUnits;

use std::path::{Path, PathBuf};

use glam::Vec3;

use self::animation::Pose;
use self::diagnostic::{Check, Warnings};
use self::file::budget::{Budget, FirstRefusal};
use self::file::buffer::referred_files;
use self::file::document::Document;
use self::graph::place_nodes;
use self::light::punctual_lights;
use self::mesh::{assembly, solid};
use self::texture::TextureReader;
use crate::error::{Error, Result};
use crate::scene::{Environment, LoadChoice, Material, Normalisation, Remark, Scene, Surface, Textures, framed_on};
use crate::text::{quote, shorten};

/// Options for loading a scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadOptions {
    /// The time that the file's animations are applied at, in seconds. `None`: nodes and morph targets are at rest.
    pub frame_time: Option<f64>,
    /// Environment lighting. `None`: none, or white light if the scene has no light at all, with a note.
    pub environment: Option<Environment>,
    /// Maximum memory of the scene while it is read, in bytes: buffers, decompressed data, geometry, images, environment.
    /// `None`: [`MEMORY_LIMIT`].
    pub memory_limit: Option<u64>,
    /// The material variant (KHR_materials_variants) with that name. `None`: primitives have their own materials.
    pub variant: Option<String>,
    /// The scene of the file, by name or index. `None`: its default one.
    pub scene: Option<String>,
    /// Units of punctual lights.
    pub light_units: LightUnits,
    /// Whether glass without a volume is solid if its mesh is closed, instead of a thin wall.
    pub solid_glass: bool,
    /// The angle that directional lights subtend, in degrees, 0 ..= 180; 0: their rays are parallel.
    pub sun_angle: f64,
    /// Radius of points and spots, in scene units; 0: they have no extent.
    pub light_radius: f64,
}

impl Scene {
    /// Reads a glTF 2.0 file, `.gltf` or `.glb`, with the buffers that it refers to.
    ///
    /// Unsupported features of the file are listed in [`Scene::warnings`].
    ///
    /// # Errors
    ///
    /// [`Error::Scene`], one line, if the file or one of its buffers can't be read or is damaged, if it requires an
    /// extension that isn't supported, or if it shows no triangle; [`Error::Memory`] if it needs too much memory.
    pub fn load(path: &Path) -> Result<Self> {
        Self::load_with(path, LoadOptions::default())
    }

    /// The same with options.
    ///
    /// # Errors
    ///
    /// As [`Scene::load`].
    pub fn load_with(path: &Path, options: LoadOptions) -> Result<Self> {
        let time = options.frame_time;
        SceneFile::open(path, options)?.at(time, None)
    }
}

/// A scene's file, to be read at several times of its animations.
pub struct SceneFile {
    path: PathBuf,
    document: Document,
    /// Names of its material variants.
    variants: Vec<String>,
    options: LoadOptions,
    /// What there was to say when it was opened.
    warnings: Vec<Remark>,
    refused: FirstRefusal,
    surfaces: Option<Surfaces>,
}

/// Materials of a file and their textures, which no animation changes.
struct Surfaces {
    /// Which materials objects have.
    used: Vec<bool>,
    materials: Vec<Material>,
    textures: Textures,
}

impl SceneFile {
    /// Opens a glTF file, with the buffers that it refers to.
    ///
    /// # Errors
    ///
    /// As [`Scene::load`].
    pub fn open(path: &Path, options: LoadOptions) -> Result<Self> {
        let budget = Budget::new(options.memory_limit.unwrap_or(MEMORY_LIMIT));
        let refused = budget.refused();
        open(path, options, budget).map_err(|what| failure(path, what, &refused))
    }

    /// The scene at a time of its animations, in seconds, or at rest. `render_space`: that of another time of the file, or `None` for
    /// one that fits its bounds.
    ///
    /// # Errors
    ///
    /// As [`Scene::load`].
    pub fn at(&mut self, time: Option<f64>, render_space: Option<Normalisation>) -> Result<Scene> {
        let scene = scene_at(self, time, render_space);
        scene.map_err(|what| failure(&self.path, what, &self.refused))
    }
}

/// A failure: out of memory, or another one.
fn failure(path: &Path, what: String, refused: &FirstRefusal) -> Error {
    match refused.get() {
        Some(refusal) if what.contains(&refusal.what) => Error::Memory {
            path: path.to_owned(),
            what,
            needed: refusal.needed,
        },
        _ => Error::scene(path, what),
    }
}

fn open(path: &Path, options: LoadOptions, budget: Budget) -> Check<SceneFile> {
    let mut warnings = Warnings::default();
    let refused = budget.refused();
    if let Some(environment) = &options.environment {
        budget.take(environment.bytes(), "the environment")?;
    }
    let mut document = Document::read(path, budget, &mut warnings)?;
    let variants = variants::names(&document.root)?;
    if let Some(wanted) = &options.variant {
        variants::choose(&mut document.root, &variants, wanted)?;
    }
    Ok(SceneFile {
        path: path.to_owned(),
        document,
        variants,
        options,
        warnings: warnings.into_lines(),
        refused,
        surfaces: None,
    })
}

fn scene_at(file: &mut SceneFile, time: Option<f64>, render_space: Option<Normalisation>) -> Check<Scene> {
    let SceneFile {
        path,
        document,
        variants,
        options,
        warnings: of_file,
        surfaces,
        ..
    } = file;
    let mut warnings = Warnings::default();
    for warning in of_file.iter() {
        warnings.add(warning.clone());
    }
    let mut notes = Vec::new();
    let root = &document.root;
    let pose = match time {
        Some(time) => Pose::at(document, time, &mut warnings)?,
        None => Pose::default(),
    };
    let nodes = place_nodes(root, &pose, options.scene.as_deref(), &mut notes)?;
    warn_of_ignored(document, time, &mut warnings);

    let instances = assembly::instances(document, &nodes, &pose, &mut warnings)?;
    let mut geometry = assembly::assemble(document, &instances, render_space, &mut warnings)?;

    let mut used = vec![false; root.materials.len() + 1];
    for object in &geometry.objects {
        used[object.material as usize] = true;
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let known = surfaces.take().filter(|surfaces| surfaces.used == used);
    let surfaces = match known {
        Some(known) => surfaces.insert(known),
        None => {
            let mut textures = TextureReader::new(document, folder);
            let materials = material::materials(root, &used, &mut textures, &mut warnings)?;
            surfaces.insert(Surfaces {
                used: used.clone(),
                materials,
                textures: textures.finish(),
            })
        }
    };
    let mut materials = surfaces.materials.clone();
    document.budget.settle()?;
    // For another time.
    document.budget.give_back(geometry.bytes());
    if used.last() == Some(&false) {
        materials.pop();
    }
    let thin = solid::thin_glass(&materials, &used);
    if options.solid_glass {
        notes.extend(solid::make_solid(root, &mut geometry, &mut materials, &thin)?);
    } else {
        notes.extend(solid::note(root, &thin));
    }
    for material in &mut materials {
        if let Surface::Dielectric(glass) = &mut material.surface {
            glass.absorption /= geometry.normalisation.scale as f32;
        }
    }

    let cameras = camera::cameras(root, &nodes, geometry.normalisation, &mut warnings)?;
    let lights = punctual_lights(root, &nodes, geometry.normalisation, options, &mut warnings)?;
    if !lights.is_empty() {
        notes.extend(options.light_units.note(root));
    }
    let mut scene = Scene {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        positions: geometry.positions,
        normals: geometry.normals,
        texcoords: geometry.texcoords,
        colors: geometry.colors,
        tangents: geometry.tangents,
        triangles: geometry.triangles,
        objects: geometry.objects,
        materials,
        lights,
        environment: options.environment.clone(),
        textures: surfaces.textures.clone(),
        cameras,
        normalisation: geometry.normalisation,
        dropped_triangles: geometry.dropped_triangles,
        files: std::iter::once(path.clone())
            .chain(referred_files(root, folder))
            .collect(),
        variants: variants.iter().map(|name| shorten(name)).collect(),
        notes,
        warnings: Vec::new(),
    };
    if scene.cameras.is_empty() {
        let elsewhere = root.nodes.iter().any(|node| node.camera.is_some());
        let of_scene = if elsewhere {
            "the scene that is rendered has no camera, though the file has"
        } else {
            "it has no camera"
        };
        warnings.push(format!("{of_scene}; a camera framed on its bounds is used"));
        scene.cameras.push(framed_on(scene.bounds()));
    }
    if scene.environment.is_none() && scene.lights.is_empty() && !scene.has_emissive_triangles() {
        warnings.add(Remark::with(
            LoadChoice::Environment,
            "it has no light; it is rendered in an environment of radiance 1",
        ));
        scene.environment = Some(Environment::constant(Vec3::ONE));
    }
    for warning in scene.environment.iter().flat_map(Environment::warnings) {
        warnings.push(warning);
    }
    scene.warnings = warnings.into_lines();
    Ok(scene)
}

/// Warns of what applies to the file as a whole.
fn warn_of_ignored(document: &Document, time: Option<f64>, warnings: &mut Warnings) {
    let root = &document.root;
    for extension in &root.extensions_used {
        if !extensions::is_supported(extension) {
            warnings.push(format!(
                "the extension {} isn't supported and is ignored, so that what it describes looks as it does without it, as in other \
                 viewers that don't know it",
                quote(extension)
            ));
        }
    }
    if !root.animations.is_empty() && time.is_none() {
        warnings.add(Remark::with(
            LoadChoice::FrameTime,
            "its animations need a time; everything is rendered at rest",
        ));
    }
}
