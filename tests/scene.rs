//! The scene loader: the results of valid files, and one clear line for each invalid one.

#[path = "scene/accessors.rs"]
mod accessors;
#[path = "scene/allocations.rs"]
mod allocations;
#[path = "scene/animation.rs"]
mod animation;
#[path = "scene/assets.rs"]
mod assets;
#[path = "scene/attributes.rs"]
mod attributes;
#[path = "scene/cameras.rs"]
mod cameras;
#[path = "scene/choices.rs"]
mod choices;
#[path = "scene/compressed.rs"]
mod compressed;
#[path = "scene/damaged.rs"]
mod damaged;
#[path = "scene/deformation.rs"]
mod deformation;
#[path = "scene/draco.rs"]
mod draco;
#[path = "scene/encoded.rs"]
mod encoded;
#[path = "scene/files.rs"]
mod files;
#[path = "scene/fixture.rs"]
mod fixture;
#[path = "scene/geometry.rs"]
mod geometry;
#[path = "scene/hierarchy.rs"]
mod hierarchy;
#[path = "scene/instancing.rs"]
mod instancing;
#[path = "scene/lights.rs"]
mod lights;
#[path = "scene/materials.rs"]
mod materials;
#[path = "scene/memory.rs"]
mod memory;
#[path = "scene/sharing.rs"]
mod sharing;
#[path = "scene/solid.rs"]
mod solid;
#[path = "scene/tangents.rs"]
mod tangents;
#[path = "scene/textures.rs"]
mod textures;
