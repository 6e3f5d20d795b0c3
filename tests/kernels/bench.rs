//! A scene on the device, whose buffers are read and written between stages.

use std::path::Path;

use bytemuck::Zeroable;
use glam::{DVec3, Vec2, Vec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::cpu::{self, DeviceReceivers};
use ppm_vk::internals::film::Image;
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::layout::{
    CAUSTIC, NEAREST, NO_OBJECT, PackedBsdf, Photon, Settings, TextureLookup, VisiblePoint,
};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::random::{PathKind, Random};
use ppm_vk::internals::scene::{Camera, Environment, LightKind, PunctualLight, Scene};
use ppm_vk::internals::stage::BufferId;

/// Suffix of scenes with an additional light of every kind.
const LIT: &str = ", lit";
/// The same with lights that have an extent.
const SOFTLY_LIT: &str = ", softly lit";
/// The same with patterned emissive surfaces.
const PATTERNED: &str = ", patterned";
/// The same where all materials are anisotropic.
const BRUSHED: &str = ", brushed";

/// A scene of `scenes/`; with lights of every kind if the name ends in [`LIT`] or [`SOFTLY_LIT`], with patterned lamps if it ends
/// in [`PATTERNED`], with anisotropic materials if it ends in [`BRUSHED`].
pub fn scene(name: &str) -> Scene {
    if let Some(name) = name.strip_suffix(BRUSHED) {
        let mut scene = scene(name);
        brush(&mut scene);
        return scene;
    }
    if let Some(name) = name.strip_suffix(PATTERNED) {
        let mut scene = scene(name);
        add_pattern(&mut scene);
        return scene;
    }
    if let Some(name) = name.strip_suffix(LIT) {
        let mut scene = scene(name);
        add_lights(&mut scene);
        return scene;
    }
    if let Some(name) = name.strip_suffix(SOFTLY_LIT) {
        let mut scene = scene(name);
        add_lights(&mut scene);
        scene.lights.iter_mut().for_each(|light| light.extent = 0.1);
        return scene;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name)
        .with_extension("gltf");
    Scene::load(&path).unwrap_or_else(|error| panic!("{error}"))
}

/// Adds punctual lights, and an environment with a different radiance in each direction.
fn add_lights(scene: &mut Scene) {
    let light = |kind, position: Vec3, range| PunctualLight {
        kind,
        position,
        intensity: Vec3::new(1.0, 0.8, 0.5),
        extent: 0.0,
        range,
    };
    let direction = Vec3::new(0.2, -1.0, -0.7).normalize();
    let spot = LightKind::Spot {
        direction,
        inner: 0.02,
        outer: 0.2,
        smooth: false,
    };
    scene.lights = vec![
        light(LightKind::Point, Vec3::new(0.3, 0.5, 0.2), None),
        light(LightKind::Point, Vec3::new(-0.4, 0.6, 0.4), Some(1.5)),
        light(spot, Vec3::new(-0.1, 0.8, 0.6), Some(4.0)),
        light(LightKind::Directional { direction }, Vec3::ZERO, None),
    ];
    let pixel = |i: usize| {
        [
            0.2 + (i % 5) as f32,
            if i == 100 { 200.0 } else { 0.5 },
            (i / 32) as f32 * 0.2,
        ]
    };
    let image = Image::new(32, 16, (0..512).map(pixel).collect());
    scene.environment = Some(Environment::new(image).expect("an environment").rotated(77.0));
}

/// Adds a square texture without filtering that is repeated this many times over a unit of its coordinates; returns its index.
fn add_texture(scene: &mut Scene, side: u32, repeats: f32, texel: impl Fn(u32) -> u32) -> u32 {
    let lookup = TextureLookup {
        row_u: [repeats, 0.0, 0.0],
        row_v: [0.0, repeats, 0.0],
        first_texel: scene.textures.texels.len() as u32,
        size: side | side << 16,
        flags: NEAREST,
        ..TextureLookup::zeroed()
    };
    scene.textures.texels.extend((0..side * side).map(texel));
    scene.textures.lookups.push(lookup);
    scene.textures.lookups.len() as u32 - 1
}

/// Gives emissive surfaces a texture of which one texel in 32 is bright. It is not filtered: near 0 only rounding errors would
/// remain.
fn add_pattern(scene: &mut Scene) {
    let texel = |i: u32| if (i * 7) % 32 == i / 32 % 8 { u32::MAX } else { 0 };
    let texture = add_texture(scene, 32, 4.0, texel);
    for material in scene
        .materials
        .iter_mut()
        .filter(|material| material.emission != Vec3::ZERO)
    {
        material.textures.emission = Some(texture);
        material.emission *= 32.0;
    }
    // Across a floor or ceiling, and along walls.
    let places = scene
        .positions
        .iter()
        .map(|p| [Vec2::new(p.x + 0.3 * p.y, p.z - 0.7 * p.y); 2]);
    scene.texcoords = places.collect();
}

/// Makes materials anisotropic, in a direction and by a strength that a texture has.
fn brush(scene: &mut Scene) {
    let texel = |i: u32| {
        let (sin, cos) = (i as f32).sin_cos();
        let byte = |value: f32| (255.0 * value).round() as u32;
        byte(0.5 + 0.5 * cos) | byte(0.5 + 0.5 * sin) << 8 | byte(1.0 - i as f32 / 80.0) << 16
    };
    let texture = add_texture(scene, 8, 1.0, texel);
    for material in &mut scene.materials {
        material.textures.anisotropy = Some(texture);
        material.layers.anisotropy.strength = 0.8;
        material.layers.anisotropy.rotation = 0.7;
    }
    if scene.texcoords.is_empty() {
        scene.texcoords = scene.positions.iter().map(|p| [Vec2::new(p.x, p.z); 2]).collect();
    }
    // Off the surfaces, with either side of the bitangent.
    let tangent = |(i, n): (usize, &Vec3)| {
        let t = n.any_orthonormal_vector() + 0.2 * n;
        t.normalize().extend(if i / 16 % 2 == 0 { 1.0 } else { -1.0 })
    };
    scene.tangents = scene.normals.iter().enumerate().map(tangent).collect();
}

/// A scene in the device's layout.
pub fn packed(scene: &Scene) -> PackedScene {
    PackedScene::new(scene).unwrap_or_else(|error| panic!("{}: {error}", scene.name))
}

/// Small enough for a CPU device, large enough for statistics.
pub fn small() -> RenderConfig {
    RenderConfig {
        resolution: [64, 64],
        photons: 5000,
        ..RenderConfig::default()
    }
}

/// Visible points of the device with their BSDFs, which are empty if the scene is not glossy.
pub struct Seen {
    pub points: Vec<VisiblePoint>,
    pub bsdfs: Vec<PackedBsdf>,
}

impl Seen {
    /// As receivers of the CPU's gather, with R² of each.
    pub fn with<'a>(&'a self, radii2: &'a [f32]) -> DeviceReceivers<'a> {
        DeviceReceivers {
            points: &self.points,
            bsdfs: &self.bsdfs,
            radii2,
        }
    }
}

/// A scene, and a renderer for it that has done one iteration.
pub struct Bench {
    pub scene: PackedScene,
    camera: Camera,
    pub config: RenderConfig,
    pub settings: Settings,
    pub renderer: Renderer,
}

impl Bench {
    pub fn new(name: &str, config: RenderConfig) -> Self {
        Self::with(name, config, |_| ())
    }

    /// With a change to the scene.
    pub fn with(name: &str, config: RenderConfig, change: impl FnOnce(&mut PackedScene)) -> Self {
        Self::seen_with(name, config, |scene, _| change(scene))
    }

    /// With a change to the scene or its camera.
    pub fn seen_with(name: &str, config: RenderConfig, change: impl FnOnce(&mut PackedScene, &mut Camera)) -> Self {
        let loaded = scene(name);
        let mut scene = packed(&loaded);
        let mut camera = loaded.cameras[0].clone();
        change(&mut scene, &mut camera);
        let device = Device::open(None).expect("a Vulkan device");
        let mut renderer = Renderer::new(device, &scene, &camera, config.clone()).expect("a renderer");
        renderer.iterate().expect("an iteration");
        let settings = download(&mut renderer, BufferId::Settings)[0];
        Self {
            scene,
            camera,
            config,
            settings,
            renderer,
        }
    }

    /// The plain CPU renderer for the same scene.
    pub fn plain(&self) -> cpu::Renderer {
        cpu::Renderer::new(&self.scene, &self.camera, self.config.clone()).expect("a renderer")
    }

    /// The inputs of the CPU's functions.
    pub fn inputs(&self) -> cpu::Inputs<'_> {
        cpu::Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
        }
    }

    /// The visible points that the device found last.
    pub fn seen(&mut self) -> Seen {
        Seen {
            points: self.download(BufferId::VisiblePoints),
            bsdfs: if self.scene.features.glossy {
                self.download(BufferId::PackedBsdfs)
            } else {
                Vec::new()
            },
        }
    }

    /// The content of a buffer of the device.
    pub fn download<T: bytemuck::AnyBitPattern>(&mut self, id: BufferId) -> Vec<T> {
        download(&mut self.renderer, id)
    }

    /// Sets the content of a buffer of the device.
    pub fn upload<T: bytemuck::NoUninit>(&mut self, id: BufferId, data: &[T]) {
        // The renderer recreates buffers of another size.
        let mut bytes: Vec<u8> = bytemuck::cast_slice(data).to_vec();
        if let Some(size) = self.renderer.sizes().bytes(id) {
            assert!(
                bytes.len() as u64 <= size,
                "{id:?} has no room for {} bytes",
                bytes.len()
            );
            bytes.resize(size as usize, 0);
        }
        self.renderer
            .gpu()
            .upload(id, &bytes)
            .unwrap_or_else(|error| panic!("{id:?}: {error}"));
    }

    /// The photons of the last batch.
    pub fn photons(&mut self) -> Vec<Photon> {
        let count: Vec<u32> = self.download(BufferId::PhotonCount);
        let mut photons = self.download(BufferId::Photons);
        photons.truncate(count[0] as usize);
        photons
    }
}

fn download<T: bytemuck::AnyBitPattern>(renderer: &mut Renderer, id: BufferId) -> Vec<T> {
    renderer
        .gpu()
        .download(id, None)
        .unwrap_or_else(|error| panic!("{id:?}: {error}"))
}

/// The first three of three or four components, in f64.
pub fn xyz<const N: usize>(v: [f32; N]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// The object of a visible point or a photon; `None` for a slot without a visible point.
pub fn object(object: u32) -> Option<u32> {
    (object != NO_OBJECT).then_some(object & !CAUSTIC)
}

/// Upper bound of an object's absolute coordinates, as kernels use it to offset rays from visible points.
pub fn reach_of(scene: &PackedScene, object: u32) -> DVec3 {
    let grid = &scene.object_grids[object as usize];
    let low = DVec3::from_array(grid.low.map(f64::from));
    let size = DVec3::from_array(grid.cells.map(f64::from)) / f64::from(grid.inverse_cell);
    low.abs().max((low + size).abs())
}

/// A visible point of albedo π on an object, seen from +z.
pub fn visible_point(position: [f32; 3], object: u32) -> VisiblePoint {
    let normal = cpu::encode_direction(DVec3::Z);
    VisiblePoint {
        position,
        object,
        weight: [1.0; 3],
        geometric_normal: normal,
        emitted: [0.0; 3],
        shading_normal: normal,
    }
}

/// A photon that arrives from +z.
pub fn photon(position: [f32; 3], object: u32, flux: [f32; 3]) -> Photon {
    Photon {
        position,
        object,
        flux,
        direction: cpu::encode_direction(DVec3::NEG_Z),
    }
}

/// `count` numbers in [0, 1) in sets of four, the same in every run.
pub fn random_numbers(count: u32) -> impl Iterator<Item = [f32; 4]> {
    (0..count).map(|i| {
        Random::new(PathKind::Camera, i, 0, 0xbe9c)
            .next4()
            .map(|number| number as f32)
    })
}
