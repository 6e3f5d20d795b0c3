//! A scene that sessions can render.

use std::path::Path;
use std::sync::Arc;

use super::layers::SceneNames;
use crate::config::RenderConfig;
use crate::error::{Error, Result};
use crate::gpu::DeviceSummary;
use crate::packing::PackedScene;
use crate::pipeline::Memory;
use crate::scene::Scene;

/// A scene with a hierarchy of its triangles, for any number of sessions.
#[derive(Debug, Clone)]
pub struct PreparedScene {
    name: String,
    names: Arc<SceneNames>,
    packed: PackedScene,
}

impl PreparedScene {
    /// Builds the hierarchy.
    ///
    /// # Errors
    /// [`Error::Scene`], if there are too many triangles, or too many materials for glass that overlaps.
    pub fn new(scene: &Scene) -> Result<Self> {
        let path = scene.files.first().map_or(Path::new(&scene.name), |file| file);
        Ok(Self {
            name: scene.name.clone(),
            names: Arc::new(SceneNames::from(scene)),
            packed: PackedScene::new(scene).map_err(|what| Error::scene(path, what))?,
        })
    }

    /// The scene's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of its objects and materials.
    pub(super) fn names(&self) -> Arc<SceneNames> {
        self.names.clone()
    }

    /// Remarks for the user, in addition to [`Scene::notes`].
    pub fn notes(&self) -> &[String] {
        &self.packed.notes
    }

    /// The features that the kernels are specialised for.
    pub fn features(&self) -> Vec<String> {
        self.packed.features.names()
    }

    /// Number of visible triangles: those of an instance count once for each instance.
    pub fn triangles(&self) -> u64 {
        self.packed.seen_triangles()
    }

    /// The device memory that a render takes.
    ///
    /// # Errors
    /// Rays are to be traced by ray queries and the device has none, or it cannot be opened.
    pub fn memory(&self, config: &RenderConfig, device: &DeviceSummary) -> Result<Memory> {
        Memory::of(&self.packed, config, device)
    }

    /// In the device's layout.
    #[doc(hidden)]
    pub fn packed(&self) -> &PackedScene {
        &self.packed
    }

    /// The same with another layout, for benches.
    #[doc(hidden)]
    #[must_use]
    pub fn with(&self, packed: PackedScene) -> Self {
        Self {
            name: self.name.clone(),
            names: self.names.clone(),
            packed,
        }
    }
}
