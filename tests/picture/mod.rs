//! Loading scenes and rendering pictures of them.

use std::path::{Path, PathBuf};

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::film::{Image, read_exr};
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::metrics::{Defects, defects};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::scene::Scene;

pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The picture in `tests/references` that another renderer made of the scene of this name.
pub fn reference(name: &str) -> Image {
    read_exr(&folder().join("tests/references").join(name).with_extension("exr")).expect("reference")
}

/// A square picture.
pub fn small(side: u32, photons: u32) -> RenderConfig {
    RenderConfig {
        resolution: [side, side],
        photons,
        ..RenderConfig::default()
    }
}

/// A scene that can be rendered.
pub struct Subject {
    pub scene: Scene,
    pub packed: PackedScene,
}

impl Subject {
    /// The file of that name in `scenes/`.
    pub fn named(name: &str) -> Self {
        Self::at(&folder().join("scenes").join(name).with_extension("gltf"))
    }

    pub fn at(path: &Path) -> Self {
        Self::of(Scene::load(path).unwrap_or_else(|error| panic!("{error}")))
    }

    pub fn of(scene: Scene) -> Self {
        let packed = PackedScene::new(&scene).expect("hierarchy");
        Self { scene, packed }
    }

    pub fn renderer(&self, config: RenderConfig) -> Renderer {
        let device = Device::open(None).expect("a Vulkan device");
        Renderer::new(device, &self.packed, &self.scene.cameras[0], config).expect("renderer")
    }

    /// A picture without NaN, infinity or negative value, of which no path was cut.
    pub fn render(&self, iterations: u32, config: RenderConfig) -> Image {
        let mut renderer = self.renderer(config);
        for _ in 0..iterations {
            renderer.iterate().expect("iteration");
        }
        self.clean_picture(&mut renderer)
    }

    /// The picture so far, of which the same holds.
    pub fn clean_picture(&self, renderer: &mut Renderer) -> Image {
        let name = &self.scene.name;
        let image = renderer.resolve().expect("picture");
        let counters = renderer.counters();
        assert_eq!(counters.non_finite, 0, "{name}: NaN or infinity in a stage");
        assert_eq!(counters.cut_paths, 0, "{name}: paths cut by the driver's loop limit");
        assert_eq!(defects(&image), Defects::default(), "{name}");
        image
    }
}
