//! A render on a Vulkan device. [`Stages::iteration`] has the order of the stages: it reads like figure 1 of the paper.

mod aim;
mod fitting;
mod iteration;
mod memory;
mod pose;
mod radii;
mod saved;
mod stages;

pub use fitting::crops;
use fitting::{build_structures, check_fits};
use iteration::Begun;
pub use memory::Memory;
pub use memory::scene_buffers;
use memory::{bindable_bytes, limits};
pub use stages::Stages;

use crate::backend::{Backend, DeviceDescription, Figures, Phase, Resolved, settings};
use crate::config::{Accel, RenderConfig, Totals};
use crate::emission::Aim;
use crate::error::{Error, Result, Setting};
use crate::gather::{METHODS, default_method, grid_sizes};
use crate::gpu::{Device, DeviceSummary, no_ray_query};
use crate::layout::{BehindGlass, IDS_OF_PIXEL, IdCount, LightParts, Settings, StatusCounters, SurfaceSum};
use crate::packing::{IN_VACUUM, PackedScene, SceneFeatures};
use crate::random::CameraTurn;
use crate::record::{Recording, Run};
use crate::scene::Camera;
use crate::sizes::{Limits, Probe, Sizes};
use crate::stage::{BufferId, SEQUENCE_FILMS};
use crate::state::Blocks;
use stages::{method_stages, reporting};

/// A progressive render on a device.
pub struct Renderer {
    device: Device,
    config: RenderConfig,
    sizes: Sizes,
    limits: Limits,
    settings: Settings,
    features: SceneFeatures,
    figures: Figures,
    /// Maximum number of photons of a lane, and of a batch, so far.
    photon_need: [u32; 2],
    /// Whether the photon buffers have been fitted.
    fitted: bool,
    /// State of aimed photon paths.
    aim: Option<Aim>,
    /// Number of launches of a gather outside of a render, for each of [`METHODS`].
    parts_of_methods: Vec<u32>,
    /// The status after the last iteration, if nothing else has run since.
    reported: Option<StatusCounters>,
    /// An iteration that was submitted ahead.
    ahead: Option<Begun>,
    /// Why rays are not traced by ray queries, if they would be by default.
    without_ray_queries: Option<String>,
    /// Nanoseconds that the last iteration's launches took.
    iteration_ns: f64,
}

impl Renderer {
    /// Prepares a render: uploads the scene, finds the radius, resets the statistics.
    ///
    /// # Errors
    /// A setting outside its range, a device without enough memory, or a failed Vulkan call.
    pub fn new(device: Device, scene: &PackedScene, camera: &Camera, config: RenderConfig) -> Result<Self> {
        Self::watched(device, scene, camera, config, &|_| ())
    }

    /// As [`Renderer::new`]; `begins` is called at the beginning of each phase.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn watched(
        device: Device,
        scene: &PackedScene,
        camera: &Camera,
        config: RenderConfig,
        begins: &dyn Fn(Phase),
    ) -> Result<Self> {
        let bindable = bindable_bytes(device.summary());
        let mut renderer = Self::upload(bindable, device, scene, camera, config)?;
        begins(Phase::Pilot);
        renderer.prepare(scene)?;
        Ok(renderer)
    }

    /// As [`Renderer::new`], with photon buffers of at most `buffer_bytes` each: an iteration that needs more is split into
    /// batches.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn within(
        buffer_bytes: u64,
        device: Device,
        scene: &PackedScene,
        camera: &Camera,
        config: RenderConfig,
    ) -> Result<Self> {
        let mut renderer = Self::upload(buffer_bytes, device, scene, camera, config)?;
        renderer.prepare(scene)?;
        Ok(renderer)
    }

    /// Uploads the scene, makes the buffers and compiles the kernels.
    fn upload(
        buffer_bytes: u64,
        mut device: Device,
        scene: &PackedScene,
        camera: &Camera,
        config: RenderConfig,
    ) -> Result<Self> {
        config.check()?;
        let method = &METHODS[config.gather.unwrap_or_else(default_method)];
        if method.stages().is_none() {
            let what = format!("{}: runs on the CPU only", method.name);
            return Err(Error::setting(Setting::Gather, what));
        }
        let is_free = config.accel == Accel::Auto;
        let mut config = RenderConfig {
            accel: accel_on(&config, device.summary())?,
            ..config
        };
        let mut without_ray_queries = None;
        if config.accel == Accel::RayQuery
            && let Err(error) = build_structures(&mut device, scene)
        {
            if !is_free {
                return Err(error);
            }
            config.accel = Accel::Bvh;
            without_ray_queries = Some(error.to_string());
        }
        let within = |loop_limit, device: &Device| Limits {
            storage_buffer_bytes: buffer_bytes,
            ..limits(device.summary(), loop_limit, scene)
        };
        check_fits(scene, &config, device.summary(), within(u32::MAX, &device))?;
        let loop_limit = device.loop_limit()?;
        let limits = within(loop_limit, &device);
        let triangles = scene.seen_triangles();
        if config.accel == Accel::Brute && triangles > u64::from(limits.loop_limit) {
            let what = format!(
                "brute: device {} ends loops early, and the scene has {triangles} triangles; use bvh or another device",
                device.summary().name
            );
            return Err(Error::setting(Setting::Accel, what));
        }
        let sizes = Sizes::new(&config, limits);
        for (id, bytes) in scene_buffers(scene, &config) {
            device.upload(id, bytes)?;
        }
        let settings = settings(&config, scene, camera, limits.loop_limit);
        let mut renderer = Self {
            device,
            config,
            sizes,
            limits,
            settings,
            features: SceneFeatures {
                immersed: scene.features.immersed || settings.camera_media != IN_VACUUM,
                lens: scene.features.lens || camera.lens.is_some(),
                ..scene.features
            },
            figures: Figures::default(),
            photon_need: [0, 0],
            fitted: false,
            aim: None,
            parts_of_methods: vec![1; METHODS.len()],
            reported: None,
            ahead: None,
            without_ray_queries,
            iteration_ns: f64::INFINITY,
        };
        renderer.upload_settings()?;
        // Before any work: fail early on insufficient memory.
        let stages = renderer.stages();
        let (iteration, picture) = (stages.shortest_iteration(), stages.picture(Totals::default()));
        renderer.make_buffers(&iteration)?;
        renderer.make_buffers(&picture)?;
        renderer.device.compile(&iteration)?;
        renderer.device.compile(&picture)?;
        Ok(renderer)
    }

    /// The device with the kernels that are compiled, for another render.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    pub fn into_device(mut self) -> Result<Device> {
        self.complete_ahead()?;
        self.device.clear();
        Ok(self.device)
    }

    fn stages(&self) -> Stages<'_> {
        Stages {
            config: &self.config,
            sizes: &self.sizes,
            features: self.features,
        }
    }

    /// Finds the first visible points and traces the first batch of photons, as input for benches of gathers. Returns the time.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    pub fn trace(&mut self) -> Result<Run> {
        self.fit_photon_buffers()?;
        let (run, _) = self.run_until_it_fits(|stages| {
            let mut recording = reporting();
            stages.camera(CameraTurn::FIRST, &mut recording);
            stages.radii(&mut recording);
            stages.demand(0, &mut recording);
            stages.photons(0, 0, &mut recording);
            recording
        })?;
        Ok(run)
    }

    /// Makes the picture so far; also returns the time.
    ///
    /// # Errors
    /// As [`Backend::resolve`].
    pub fn picture(&mut self) -> Result<(Run, Resolved)> {
        self.complete_ahead()?;
        let recording = self.stages().picture(self.figures.totals);
        let (run, status) = self.run_reporting(recording)?;
        self.figures.counters.non_finite += u64::from(status.non_finite);
        self.figures.counters.photons_accepted = status.photons_accepted();
        let (region, shown) = (self.sizes.region, self.config.shown());
        // Without the guides behind it.
        let film: Vec<[f32; 4]> = self.device.download(BufferId::Film, Some(region.pixels() as usize))?;
        let behind_glass: Vec<BehindGlass> = self.device.download(BufferId::GlassFilm, None)?;
        let mut sequences = Vec::new();
        for film in SEQUENCE_FILMS {
            sequences.extend(region.cut(&shown, self.device.download::<[f32; 4]>(film, None)?));
        }
        let (film, behind_glass) = (region.cut(&shown, film), region.cut(&shown, behind_glass));
        let mut resolved = Resolved::from_film(shown.size, &film, behind_glass, sequences);
        let layers = self.config.layers;
        if layers.show_surfaces() {
            let surfaces: Vec<SurfaceSum> = self.device.download(BufferId::SurfaceSums, None)?;
            resolved.layers.surfaces = region.cut(&shown, surfaces);
            let ids: Vec<[IdCount; 2 * IDS_OF_PIXEL as usize]> = self.device.download(BufferId::IdCounts, None)?;
            resolved.layers.ids = region.cut(&shown, ids).into_flattened();
        }
        if layers.show_light() {
            let light: Vec<LightParts> = self.device.download(BufferId::LightPartsFilm, None)?;
            resolved.layers.light = region.cut(&shown, light);
        }
        Ok((run, resolved))
    }

    /// Gathers the current photons with any method of a device; earlier sums are cleared. Returns the time and the status.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    pub fn gather(&mut self, method: usize, probe: Probe) -> Result<(Run, StatusCounters)> {
        let render = (self.sizes.gather_parts, self.sizes.probe);
        (self.sizes.gather_parts, self.sizes.probe) = (self.parts_of_methods[method], probe);
        let result = self.run_until_it_fits(|stages| {
            let mut recording = reporting();
            recording.fill(BufferId::GatheredOf, 0);
            recording.fill(BufferId::TestsOf, 0);
            let (order, gather) = method_stages(method);
            order(stages.sizes, &mut recording);
            grid_sizes(stages.sizes, &mut recording);
            gather(stages.sizes, &mut recording);
            recording
        });
        self.parts_of_methods[method] = self.sizes.gather_parts;
        (self.sizes.gather_parts, self.sizes.probe) = render;
        result
    }

    /// Whether photons that no visible point can accept are dropped.
    pub fn drops_unwanted(&self) -> bool {
        self.config.drops_unwanted()
    }

    /// Why rays are traced by the BVH on a device with ray queries, if they would be traced by those by default.
    pub fn without_ray_queries(&self) -> Option<&str> {
        self.without_ray_queries.as_deref()
    }

    /// The buffers' sizes.
    pub fn sizes(&self) -> &Sizes {
        &self.sizes
    }

    /// The device, to read its buffers.
    pub fn gpu(&mut self) -> &mut Device {
        &mut self.device
    }

    /// Uploads the settings, with the buffers' sizes.
    fn upload_settings(&mut self) -> Result<()> {
        let sizes = &self.sizes;
        self.settings.photon_lanes = sizes.photon_lanes;
        self.settings.lane_capacity = sizes.lane_capacity;
        self.settings.photon_capacity = sizes.photon_capacity;
        self.settings.cell_bits = sizes.cell_bits;
        self.settings.slots_per_pixel = sizes.slots_per_pixel;
        self.settings.photon_maps = sizes.photon_maps;
        self.device.upload(BufferId::Settings, &[self.settings])
    }

    /// Allocates the buffers that a recording uses, if they are missing or of another size.
    fn make_buffers(&mut self, recording: &Recording) -> Result<()> {
        for id in recording.buffers() {
            if let Some(bytes) = self.sizes.bytes(id)
                && self.device.size(id) != bytes.max(4)
            {
                self.device.create(id, bytes)?;
            }
        }
        Ok(())
    }

    /// Runs a recording on the device, after allocating the buffers that it needs.
    ///
    /// # Errors
    /// A device without enough memory, or a failed Vulkan call.
    pub fn run(&mut self, recording: &Recording) -> Result<Run> {
        self.reported = None;
        self.make_buffers(recording)?;
        self.device.run(recording)
    }
}

/// How rays are traced on a device.
fn accel_on(config: &RenderConfig, device: &DeviceSummary) -> Result<Accel> {
    let is_gpu = ["discrete", "integrated", "virtual"].contains(&device.kind);
    match config.accel {
        Accel::Auto if is_gpu && device.ray_query => Ok(Accel::RayQuery),
        Accel::Auto => Ok(Accel::Bvh),
        Accel::RayQuery if !device.ray_query => Err(no_ray_query(&device.name)),
        chosen => Ok(chosen),
    }
}

impl Backend for Renderer {
    fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        self.do_iteration(stop, false)
    }

    fn iterate_before_another(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        self.do_iteration(stop, true)
    }

    fn resolve_all(&mut self) -> Result<Resolved> {
        self.picture().map(|(_, resolved)| resolved)
    }

    fn save(&mut self) -> Result<Blocks> {
        self.learned()
    }

    fn restore(&mut self, learned: &Blocks) -> Result<()> {
        self.continue_from(learned)
    }

    fn figures(&self) -> &Figures {
        &self.figures
    }

    fn aims(&self) -> bool {
        self.aim.is_some()
    }

    fn photon_maps(&self) -> u32 {
        self.sizes.photon_maps
    }

    fn device(&self) -> DeviceDescription {
        let summary = self.device.summary();
        DeviceDescription {
            name: summary.name.clone(),
            driver: summary.driver.clone(),
            timestamp_period_ns: summary.timestamp_period_ns,
        }
    }
}
