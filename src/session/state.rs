//! The state of a render: what it has learned, and what it is a render of.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::PreparedScene;
use super::merge::{PictureOfPart, put_picture};
use super::rendered::About;
use crate::backend::{Backend, Resolved, settings};
use crate::config::{Accel, Part, RenderConfig};
use crate::error::{Error, Result};
use crate::gather::METHODS;
use crate::packing::PackedScene;
use crate::pipeline::scene_buffers;
use crate::scene::Camera;
use crate::state::{self, Blocks};

/// What a render is a render of.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Identity {
    version: String,
    renderer: String,
    /// Hash of what rays read, of the camera too.
    scene: String,
    /// Which part of several; number 0: several merged parts.
    pub part: Part,
    /// Names and values.
    settings: BTreeMap<String, String>,
}

impl Identity {
    pub fn of(scene: &PreparedScene, camera: &Camera, config: &RenderConfig, is_cpu: bool) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            renderer: if is_cpu { "cpu" } else { "vulkan" }.to_owned(),
            scene: hash_of(scene.packed(), camera, config),
            part: config.part,
            settings: named(config),
        }
    }

    /// The same of a render with motion blur between two times.
    pub fn between(&self, config: &RenderConfig, ends: &[(PackedScene, Camera); 2]) -> Self {
        let [opening, closing] = ends.each_ref().map(|(scene, camera)| hash_of(scene, camera, config));
        Self {
            scene: format!("{}, from {opening} to {closing}", self.scene),
            ..self.clone()
        }
    }

    /// The same of merged parts.
    pub fn merged(&self) -> Self {
        let part = Part { number: 0, ..self.part };
        Self { part, ..self.clone() }
    }

    /// Fails with what differs unless it is this one.
    pub fn check_is(&self, wanted: &Self) -> Result<()> {
        let differences = wanted.differences(self);
        if differences.is_empty() {
            return Ok(());
        }
        Err(Error::Config(format!(
            "the state is of another render: {}",
            differences.join(", ")
        )))
    }

    /// What of another one is different from this.
    fn differences(&self, other: &Self) -> Vec<String> {
        let mut differences = Vec::new();
        let mut compare = |name: &str, of: &str, wanted: &str| {
            if of != wanted {
                differences.push(format!("{name} is {of} instead of {wanted}"));
            }
        };
        compare("the program's version", &other.version, &self.version);
        compare("the renderer", &other.renderer, &self.renderer);
        compare("the part", &other.part.to_string(), &self.part.to_string());
        for (name, wanted) in &self.settings {
            compare(name, other.settings.get(name).map_or("missing", String::as_str), wanted);
        }
        if differences.is_empty() && self.scene != other.scene {
            differences.push("the scene, its environment or the camera is another".to_owned());
        }
        differences
    }
}

/// Hash of what rays read of a scene, and of the camera.
fn hash_of(scene: &PackedScene, camera: &Camera, config: &RenderConfig) -> String {
    let by_bvh = RenderConfig {
        accel: Accel::Bvh,
        ..config.clone()
    };
    let mut content = blake3::Hasher::new();
    for (id, bytes) in scene_buffers(scene, &by_bvh) {
        content.update(format!("{id:?} {}", bytes.len()).as_bytes());
        content.update(bytes);
    }
    // The same for all parts.
    let whole = RenderConfig {
        part: Part::WHOLE,
        ..config.clone()
    };
    content.update(bytemuck::bytes_of(&settings(&whole, scene, camera, 0)));
    content.finalize().to_hex().to_string()
}

/// The settings that a state depends on, by name.
fn named(config: &RenderConfig) -> BTreeMap<String, String> {
    // Every field: one that is added has to be considered here.
    let RenderConfig {
        resolution: [width, height],
        crop,
        photons,
        estimator,
        direct,
        alpha,
        radius,
        gather,
        cell_photons,
        accel,
        triangle_test,
        max_depth,
        drop_unwanted,
        emission,
        aims_anyway,
        sampler,
        seed,
        filter,
        layers,
        part: _, // part of the identity by itself
    } = config;
    let or_automatic = |value: Option<String>| value.unwrap_or_else(|| "automatic".to_owned());
    let settings = [
        ("resolution", format!("{width}x{height}")),
        ("crop", crop.map_or("none".to_owned(), |crop| crop.to_string())),
        ("photons", photons.to_string()),
        ("estimator", estimator.to_string()),
        ("direct", direct.to_string()),
        ("alpha", alpha.to_string()),
        ("radius", or_automatic(radius.map(|radius| radius.to_string()))),
        (
            "gather",
            or_automatic(gather.map(|index| METHODS[index].name.to_owned())),
        ),
        (
            "cell_photons",
            cell_photons.map_or("unlimited".to_owned(), |count| count.to_string()),
        ),
        ("accel", accel.to_string()),
        ("triangle_test", triangle_test.to_string()),
        ("max_depth", max_depth.to_string()),
        ("drop_unwanted", drop_unwanted.to_string()),
        ("emission", emission.to_string()),
        ("aims_anyway", aims_anyway.to_string()),
        ("sampler", sampler.to_string()),
        ("seed", seed.to_string()),
        ("filter", filter.to_string()),
        ("layers", layers.to_string()),
    ];
    settings.map(|(name, value)| (name.to_owned(), value)).into()
}

/// What a render has learned, for a file from which another process goes on.
#[derive(Debug, Clone)]
pub struct State {
    pub(super) of: Identity,
    pub(super) blocks: Blocks,
}

/// The block of the rendering time.
const SPENT: &str = "spent";

impl State {
    /// Of a render after this time; `picture` is its picture so far, which parts need.
    pub(super) fn of(
        about: &About,
        backend: &mut dyn Backend,
        picture: Option<&Resolved>,
        spent: Duration,
    ) -> Result<Self> {
        let mut blocks = backend.save()?;
        blocks.put(SPENT, &spent)?;
        if let Some(picture) = picture.filter(|_| !about.config.part.is_whole()) {
            let made = PictureOfPart {
                picture,
                counters: backend.counters(),
                totals: backend.totals(),
                seconds: spent.as_secs_f64(),
            };
            put_picture(&mut blocks, about, &made)?;
        }
        Ok(Self {
            of: about.identity.clone(),
            blocks,
        })
    }

    /// Rendering time so far.
    pub(super) fn spent(&self) -> Result<Duration> {
        self.blocks.get(SPENT)
    }

    /// Reads and checks a state's file.
    ///
    /// # Errors
    /// A file that can't be read, is no state, is cut short or damaged.
    pub fn read(path: &Path) -> Result<Self> {
        let (of, blocks) = state::read(path)?;
        let of = serde_json::from_value(of)
            .map_err(|error| Error::file(path, format!("is no state of a render of this program ({error})")))?;
        Ok(Self { of, blocks })
    }

    /// Writes it: the file is whole, or what it was before.
    ///
    /// # Errors
    /// A path that can't be written to, a full disk.
    pub fn write(&self, path: &Path) -> Result<()> {
        let of = serde_json::to_value(&self.of).map_err(|error| Error::Config(error.to_string()))?;
        state::write(path, &of, &self.blocks)
    }
}
