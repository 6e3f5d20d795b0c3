//! Loading scenes and rendering pictures of them.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Once;

use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::film::{Image, Look, read_exr, write_png};
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::metrics::{Defects, defects};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::scene::Scene;

pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The reference picture of this scene by another renderer, from `tests/references`.
pub fn reference(name: &str) -> Image {
    let image = read_exr(&folder().join("tests/references").join(name).with_extension("exr")).expect("reference");
    remember(&format!("{name}-reference"), &image);
    image
}

/// Number of pictures that a test keeps.
const REMEMBERED: usize = 6;

thread_local! {
    /// The last pictures that the test of this thread rendered or read.
    static PICTURES: RefCell<VecDeque<(String, Image)>> = const { RefCell::new(VecDeque::new()) };
}

/// Writes a picture if its test fails: into `failed-pictures` in cargo's folder for test output, as PNG, named after the test and
/// the picture.
pub fn remember(name: &str, image: &Image) {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            before(info);
            write_remembered();
        }));
    });
    PICTURES.with_borrow_mut(|pictures| {
        if pictures.len() == REMEMBERED {
            pictures.pop_front();
        }
        pictures.push_back((name.to_owned(), image.clone()));
    });
}

fn write_remembered() {
    let test = std::thread::current().name().unwrap_or("test").replace("::", "-");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("failed-pictures");
    // A panic during a panic would abort the process: errors are printed.
    let pictures = PICTURES.try_with(|pictures| pictures.try_borrow_mut().map(|mut it| std::mem::take(&mut *it)));
    let pictures = pictures.ok().and_then(Result::ok).unwrap_or_default();
    for (number, (name, image)) in pictures.iter().enumerate() {
        let path = folder.join(format!("{test}-{number}-{name}.png"));
        let written = std::fs::create_dir_all(&folder)
            .map_err(|error| error.to_string())
            .and_then(|()| write_png(image, &path, Look::default()).map_err(|error| error.to_string()));
        match written {
            Ok(()) => eprintln!("picture: {}", path.display()),
            Err(error) => eprintln!("{}: {error}", path.display()),
        }
    }
}

/// A square picture.
pub fn small(side: u32, photons: u32) -> RenderConfig {
    RenderConfig {
        resolution: [side, side],
        photons,
        ..RenderConfig::default()
    }
}

/// A scene prepared for rendering.
pub struct Subject {
    pub scene: Scene,
    pub packed: PackedScene,
}

impl Subject {
    /// The file of this name in `scenes/`.
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

    /// A picture without NaN, infinity or negative values, without cut paths.
    pub fn render(&self, iterations: u32, config: RenderConfig) -> Image {
        let mut renderer = self.renderer(config);
        for _ in 0..iterations {
            renderer.iterate().expect("iteration");
        }
        self.clean_picture(&mut renderer)
    }

    /// The current picture, with the same checks.
    pub fn clean_picture(&self, renderer: &mut Renderer) -> Image {
        let name = &self.scene.name;
        let image = renderer.resolve().expect("picture");
        remember(name, &image);
        let counters = renderer.counters();
        assert_eq!(counters.non_finite, 0, "{name}: NaN or infinity in a stage");
        assert_eq!(counters.cut_paths, 0, "{name}: paths cut by the driver's loop limit");
        assert_eq!(defects(&image), Defects::default(), "{name}");
        image
    }
}
