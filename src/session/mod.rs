//! The public interface for rendering: a scene in, pictures out.

mod crops;
mod flicker;
mod layers;
mod merge;
mod prepared;
mod rendered;
mod shutter;
mod snapshot;
mod state;
mod until;
mod warning;
mod work;

pub use crops::{Mosaic, crops};
pub use flicker::Flicker;
pub use merge::Merge;
pub use prepared::PreparedScene;
pub use rendered::{Failure, Rendered};
pub use shutter::Motion;
pub use snapshot::{Snapshot, Snapshots, Wanted};
pub use state::State;
pub use until::{Progress, Until};
pub use warning::Warning;

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::backend::{Backend, DeviceDescription, Phase};
use crate::config::{MAX_SIDE, RenderConfig};
use crate::error::{Error, Result, Setting};
use crate::estimate::{ErrorEstimate, RelativeError, of_one_photon};
use crate::film::Image;
use crate::gather::{METHODS, default_cpu_method, default_method};
use crate::gpu::Device;
use crate::record::Run;
use crate::scene::Camera;
use crate::{cpu, pipeline};
use layers::SceneNames;
use rendered::About;
use shutter::Moving;
use state::Identity;
use work::Work;

/// The platform of a render.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Platform {
    /// A Vulkan device: the one of this index or with this in its name, or the best one.
    Vulkan(Option<String>),
    /// The CPU, without Vulkan: a plain, slow renderer, which the kernels are tested against.
    Cpu,
}

impl Default for Platform {
    fn default() -> Self {
        Self::Vulkan(None)
    }
}

/// Callbacks of [`Session::render_with`].
pub struct Hooks<'a> {
    /// Called between batches of photon paths: whether to stop early, with the picture so far.
    pub stop: &'a dyn Fn() -> bool,
    /// Called after every iteration.
    pub progress: &'a dyn Fn(Progress),
    /// Whether [`Rendered::profile`] collects launches: those of a day take gigabytes.
    pub profile: bool,
    /// Pictures and states while the render goes on.
    pub snapshots: Option<Snapshots<'a>>,
}

impl Default for Hooks<'_> {
    fn default() -> Self {
        Self {
            stop: &|| false,
            progress: &|_| (),
            profile: false,
            snapshots: None,
        }
    }
}

enum Renderer {
    Device(Box<pipeline::Renderer>),
    Moving(Box<Moving>),
    Cpu(Box<cpu::Renderer>),
}

/// A progressive render of a scene, which can be continued.
///
/// ```no_run
/// use ppm_vk::{Platform, PreparedScene, RenderConfig, Scene, Session, Until};
///
/// # fn main() -> ppm_vk::Result<()> {
/// let scene = Scene::load("scenes/cornell-spheres.gltf".as_ref())?;
/// let camera = &scene.cameras[0];
/// let prepared = PreparedScene::new(&scene)?;
/// let mut session = Session::new(&prepared, camera, &RenderConfig::of(camera), &Platform::default())?;
/// let rendered = session.render(Until::iterations(64))?;
/// rendered.write_exr("picture.exr".as_ref())?;
/// # Ok(())
/// # }
/// ```
pub struct Session {
    renderer: Renderer,
    config: RenderConfig,
    estimate: ErrorEstimate,
    warnings: Vec<Warning>,
    scene: String,
    names: Arc<SceneNames>,
    identity: Identity,
    /// Power of the scene's lights.
    power: f64,
    /// Render units per scene unit.
    scale: f64,
    /// Rendering time so far.
    spent: Duration,
}

impl Session {
    /// Opens a device, uploads the scene, finds the first radii.
    ///
    /// # Errors
    /// A setting outside its range, no usable device, or one without enough memory.
    pub fn new(scene: &PreparedScene, camera: &Camera, config: &RenderConfig, platform: &Platform) -> Result<Self> {
        Self::watched(scene, camera, config, platform, &|_| ())
    }

    /// As [`Session::new`]; `begins` is called at the beginning of each [`Phase`].
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn watched(
        scene: &PreparedScene,
        camera: &Camera,
        config: &RenderConfig,
        platform: &Platform,
        begins: &dyn Fn(Phase),
    ) -> Result<Self> {
        let device = match platform {
            Platform::Vulkan(device) => {
                begins(Phase::Compile);
                Some(Device::open(device.as_deref())?)
            }
            Platform::Cpu => None,
        };
        Self::on(device, scene, camera, config, begins)
    }

    /// A session of another scene, such as the next frame of an animation, where this one is: kernels that both need are compiled
    /// already. It learns anew, so its pictures have the bits of [`Session::new`].
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn next(
        self,
        scene: &PreparedScene,
        camera: &Camera,
        config: &RenderConfig,
        begins: &dyn Fn(Phase),
    ) -> Result<Self> {
        let device = match self.renderer {
            Renderer::Device(renderer) => {
                begins(Phase::Compile);
                Some(renderer.into_device()?)
            }
            Renderer::Moving(moving) => {
                begins(Phase::Compile);
                Some(moving.renderer.into_device()?)
            }
            Renderer::Cpu(_) => None,
        };
        Self::on(device, scene, camera, config, begins)
    }

    /// On a device, or on the CPU.
    fn on(
        device: Option<Device>,
        scene: &PreparedScene,
        camera: &Camera,
        config: &RenderConfig,
        begins: &dyn Fn(Phase),
    ) -> Result<Self> {
        let packed = scene.packed();
        let is_cpu = device.is_none();
        let config = with_method(config, is_cpu);
        let renderer = match device {
            Some(device) => Renderer::Device(Box::new(pipeline::Renderer::watched(
                device,
                packed,
                camera,
                config.clone(),
                begins,
            )?)),
            None => {
                if let Some(crop) = config.crop {
                    let what = format!("{crop}: the CPU backend renders whole pictures");
                    return Err(Error::setting(Setting::Crop, what));
                }
                begins(Phase::Pilot);
                Renderer::Cpu(Box::new(cpu::Renderer::new(packed, camera, config.clone())?))
            }
        };
        let backend = renderer.backend();
        let mut warnings = Warning::before(&packed.features, &config, backend.photon_maps());
        if let Renderer::Device(device) = &renderer
            && let Some(why) = device.without_ray_queries()
        {
            warnings.push(Warning::WithoutRayQueries(why.to_owned()));
        }
        let estimate = ErrorEstimate::new(&config, of_one_photon(packed.power, backend, &config));
        Ok(Self {
            renderer,
            identity: Identity::of(scene, camera, &config, is_cpu),
            config,
            estimate,
            warnings,
            scene: scene.name().to_owned(),
            names: scene.names(),
            power: packed.power,
            scale: packed.scale,
            spent: Duration::ZERO,
        })
    }

    /// Whether a session of this scene, camera and settings would render the same picture.
    pub fn is_of(&self, scene: &PreparedScene, camera: &Camera, config: &RenderConfig) -> bool {
        let is_cpu = matches!(self.renderer, Renderer::Cpu(_));
        // Layers tell of places in the world, which the identity does not know.
        self.names.normalisation == scene.names().normalisation
            && self.identity == Identity::of(scene, camera, &with_method(config, is_cpu), is_cpu)
    }

    /// Renders until a limit is reached.
    ///
    /// # Errors
    /// Any failure before the first picture. Later failures are in [`Rendered::failure`].
    pub fn render(&mut self, until: Until) -> Result<Rendered> {
        self.render_with(until, &Hooks::default())
    }

    /// The same with callbacks, which can show progress or stop early. It can be called again, to continue.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub fn render_with(&mut self, until: Until, hooks: &Hooks<'_>) -> Result<Rendered> {
        let about = self.about();
        let work = Work {
            until,
            hooks,
            about: &about,
        };
        let done = work.run(self.renderer.backend_mut())?;
        self.spent += done.time;
        Ok(Rendered::new(&about, done))
    }

    fn about(&self) -> About {
        About {
            scene: self.scene.clone(),
            names: self.names.clone(),
            config: self.config.clone(),
            gather: self.gather(),
            device: self.device(),
            estimate: self.estimate,
            spent: self.spent,
            identity: self.identity.clone(),
        }
    }

    /// What it has learned so far: another process can go on from it.
    ///
    /// # Errors
    /// Whatever the device can't do.
    pub fn state(&mut self) -> Result<State> {
        let about = self.about();
        let backend = self.renderer.backend_mut();
        // The picture is of use to parts alone.
        let picture = if self.config.part.is_whole() {
            None
        } else {
            Some(backend.resolve_all()?)
        };
        State::of(&about, backend, picture.as_ref(), self.spent)
    }

    /// Goes on from a state of this scene with these settings: on the same device, further iterations give the same bits as if
    /// the render had not been interrupted.
    ///
    /// # Errors
    /// A state of another render, which is told with what differs; whatever the device can't do.
    pub fn resume(&mut self, state: &State) -> Result<()> {
        state.of.check_is(&self.identity)?;
        self.renderer.backend_mut().restore(&state.blocks)?;
        self.spent = state.spent()?;
        let photon = of_one_photon(self.power, self.renderer.backend(), &self.config);
        self.estimate = ErrorEstimate::new(&self.config, photon);
        Ok(())
    }

    /// Runs one iteration, and returns the times of its launches. Unlike [`Session::render`], it keeps no picture for the case
    /// that the next iteration fails. `None`: `stop`, which is called between batches of photon paths, ended it early, and it is
    /// left out.
    ///
    /// # Errors
    /// Whatever the device can't do.
    pub fn iterate(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        let begin = Instant::now();
        let run = self.renderer.backend_mut().iterate_unless(stop);
        self.spent += begin.elapsed();
        run
    }

    /// The picture so far, and its estimated error, if known.
    ///
    /// # Errors
    /// Whatever the device can't do.
    pub fn picture(&mut self) -> Result<(Image, Option<RelativeError>)> {
        let picture = self.renderer.backend_mut().resolve_all()?;
        let error = self.estimate.relative(self.iterations(), &picture);
        Ok((picture.image, error))
    }

    /// Iterations so far.
    pub fn iterations(&self) -> u32 {
        self.renderer.backend().iterations()
    }

    /// Photon paths emitted so far.
    pub fn photons_emitted(&self) -> u64 {
        self.renderer.backend().emitted()
    }

    /// The device that it runs on.
    pub fn device(&self) -> DeviceDescription {
        self.renderer.backend().device()
    }

    /// The median of the initial radii, in scene units.
    pub fn radius(&self) -> f64 {
        f64::from(self.renderer.backend().radius()) / self.scale
    }

    /// Whether photon paths are aimed. They are not if the pilot rounds found that aiming does not pay for its cost.
    pub fn is_aimed(&self) -> bool {
        self.renderer.backend().aims()
    }

    /// Its settings.
    pub fn config(&self) -> &RenderConfig {
        &self.config
    }

    /// Warnings before the render begins.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// The gather method's name.
    pub fn gather(&self) -> &'static str {
        METHODS[self.config.gather.unwrap_or_default()].name
    }

    /// The renderer on a device, for benches of its parts; `None` on the CPU.
    #[doc(hidden)]
    pub fn on_device(&mut self) -> Option<&mut pipeline::Renderer> {
        match &mut self.renderer {
            Renderer::Device(renderer) => Some(renderer),
            Renderer::Moving(moving) => Some(&mut moving.renderer),
            Renderer::Cpu(_) => None,
        }
    }
}

/// The settings with a gather method.
fn with_method(config: &RenderConfig, is_cpu: bool) -> RenderConfig {
    let default = if is_cpu { default_cpu_method } else { default_method };
    RenderConfig {
        gather: config.gather.or_else(|| Some(default())),
        ..config.clone()
    }
}

impl Renderer {
    fn backend(&self) -> &dyn Backend {
        match self {
            Self::Device(renderer) => renderer.as_ref(),
            Self::Moving(moving) => moving.as_ref(),
            Self::Cpu(renderer) => renderer.as_ref(),
        }
    }

    fn backend_mut(&mut self) -> &mut dyn Backend {
        match self {
            Self::Device(renderer) => renderer.as_mut(),
            Self::Moving(moving) => moving.as_mut(),
            Self::Cpu(renderer) => renderer.as_mut(),
        }
    }
}

/// Aspect ratio where a camera has none.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;

impl RenderConfig {
    /// The defaults, with a picture of the camera's aspect ratio.
    pub fn of(camera: &Camera) -> Self {
        let width = Self::DEFAULT.resolution[0];
        let height = width as f32 / camera.aspect.unwrap_or(DEFAULT_ASPECT);
        Self {
            resolution: [width, (height.round() as u32).clamp(1, MAX_SIDE)],
            ..Self::DEFAULT
        }
    }
}
