//! Every gather method on the same visible points and photons.

mod measured;

use serde::Serialize;

use self::measured::{Input, Measured, timed_us};
use super::structure::Structure;
use super::{median, stages_of};
use ppm_vk::internals::backend::Backend as _;
use ppm_vk::internals::cpu;
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::layout::NO_OBJECT;
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::random::CameraTurn;
use ppm_vk::{Camera, DeviceDescription, Error, Platform, PreparedScene, RenderConfig, Result, Run, Session};

/// The parameters of a measurement.
pub struct GatherBench<'a> {
    /// The scene.
    pub scene: &'a PreparedScene,
    /// Its camera.
    pub camera: &'a Camera,
    /// The platform.
    pub platform: Platform,
    /// Everything but the resolution.
    pub config: RenderConfig,
    /// Pixels, width and height.
    pub resolutions: Vec<[u32; 2]>,
    /// Indices into [`METHODS`].
    pub methods: Vec<usize>,
    /// How often each method runs.
    pub repeats: usize,
}

/// The results of a bench.
#[derive(Debug, Clone, Serialize)]
pub struct Results {
    /// The device.
    pub device: DeviceDescription,
    /// Bytes per second that a copying kernel reads and writes together.
    pub copy_bytes_per_s: f64,
    /// Photon paths.
    pub photon_paths: u32,
    /// How often each method ran.
    pub repeats: usize,
    /// One for each resolution.
    pub resolutions: Vec<ResolutionResult>,
}

/// A resolution's figures.
#[derive(Debug, Clone, Serialize)]
pub struct ResolutionResult {
    /// Pixels, width and height.
    pub resolution: [u32; 2],
    /// Visible points.
    pub visible_points: usize,
    /// Photons stored.
    pub photons: usize,
    /// The paper's other steps.
    pub steps: StepTimes,
    /// One for each method.
    pub methods: Vec<MethodResult>,
}

/// Times of the steps other than the gather, in microseconds: device, CPU.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct StepTimes {
    /// Finding the visible points.
    pub raytracing_us: [f64; 2],
    /// Tracing photons and joining the regions of lanes.
    pub photon_tracing_us: [f64; 2],
    /// Making the picture.
    pub synthesize_us: [f64; 2],
}

/// A method's figures, of all visible points.
#[derive(Debug, Clone, Serialize)]
pub struct MethodResult {
    /// Its name.
    pub method: &'static str,
    /// Ordering the visible points.
    pub order_us: f64,
    /// Ordering the photons.
    pub build_us: f64,
    /// Gathering.
    pub gather_us: f64,
    /// Share of the visible points that were processed; the gather's time is scaled up.
    pub share: f64,
    /// Photons tested for a visible point, on average.
    pub tested: f64,
    /// Photons accepted by a visible point, on average.
    pub accepted: f64,
    /// Photons tested per second of gathering.
    pub tests_per_s: f64,
    /// Bytes of photons, visible points and sums that invocations load and store per second of gathering.
    pub bytes_per_s: f64,
    /// The structures that the method built.
    pub structure: Structure,
}

impl MethodResult {
    /// Ordering photons and gathering them: what each iteration of the paper's estimator costs.
    pub fn build_and_gather_us(&self) -> f64 {
        self.build_us + self.gather_us
    }
}

impl GatherBench<'_> {
    /// Runs the bench; `note` gets progress messages.
    ///
    /// # Errors
    /// Errors of a render, and a method whose photons differ from those of a k-d tree on the CPU.
    pub fn run(&self, note: &dyn Fn(&str)) -> Result<Results> {
        let mut resolutions = Vec::new();
        let mut copy_bytes_per_s = f64::NAN;
        let mut device = None;
        for &resolution in &self.resolutions {
            let mut session = self.session(resolution)?;
            let on = session.device();
            let renderer = stages_of(&mut session)?;
            if device.is_none() {
                note("copy bandwidth");
                copy_bytes_per_s = renderer.gpu().copy_bandwidth()?;
                device = Some(on);
            }
            resolutions.push(self.resolution(renderer, resolution, note)?);
        }
        Ok(Results {
            device: device.ok_or_else(|| Error::Config("no resolution to measure".to_owned()))?,
            copy_bytes_per_s,
            photon_paths: self.config.photons,
            repeats: self.repeats,
            resolutions,
        })
    }

    /// A session at this resolution, before its first iteration.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn session(&self, resolution: [u32; 2]) -> Result<Session> {
        let config = RenderConfig {
            resolution,
            ..self.config.clone()
        };
        Session::new(self.scene, self.camera, &config, &self.platform)
    }

    fn resolution(
        &self,
        renderer: &mut Renderer,
        resolution: [u32; 2],
        note: &dyn Fn(&str),
    ) -> Result<ResolutionResult> {
        let [width, height] = resolution;
        note(&format!("{width}x{height}: rays, photons, kd-tree"));
        if renderer.sizes().batches(self.config.photons) > 1 {
            return Err(Error::Config(format!(
                "--photons {}: more than the device holds at once ({}); try fewer, or --scaling",
                self.config.photons,
                renderer.sizes().batch_paths
            )));
        }
        let mut steps = self.device_steps(renderer)?;
        let input = Input::of(renderer)?;
        self.cpu_steps(resolution, &mut steps)?;
        let visible_points = input.points.iter().filter(|point| point.object != NO_OBJECT).count();

        let mut methods = Vec::new();
        for &method in &self.methods {
            note(&format!(
                "{width}x{height}: {} against the kd-tree",
                METHODS[method].name
            ));
            methods.push(Measured::new(renderer, method, &input, visible_points)?);
        }
        for repeat in 1..=self.repeats {
            note(&format!("{width}x{height}: run {repeat} of {}", self.repeats));
            for measured in &mut methods {
                measured.repeat(renderer, &input)?;
            }
        }
        Ok(ResolutionResult {
            resolution,
            visible_points,
            photons: input.photons.len(),
            steps,
            methods: methods
                .into_iter()
                .map(|method| method.result(visible_points, renderer.sizes()))
                .collect(),
        })
    }

    fn device_steps(&self, renderer: &mut Renderer) -> Result<StepTimes> {
        let (mut rays, mut photons, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
        // One more, to warm up.
        for _ in 0..=self.repeats {
            let run = renderer.trace()?;
            let camera = time_of(&run, |stage| stage == "camera");
            rays.push(camera);
            photons.push(time_of(&run, |_| true) - camera);
            pictures.push(time_of(&renderer.picture()?.0, |_| true));
        }
        let warm = |times: Vec<f64>| median(times.into_iter().skip(1).collect());
        Ok(StepTimes {
            raytracing_us: [warm(rays), f64::NAN],
            photon_tracing_us: [warm(photons), f64::NAN],
            synthesize_us: [warm(pictures), f64::NAN],
        })
    }

    /// The same steps by the plain renderer.
    fn cpu_steps(&self, resolution: [u32; 2], steps: &mut StepTimes) -> Result<()> {
        let config = RenderConfig {
            resolution,
            gather: None,
            ..self.config.clone()
        };
        let photons = config.photons;
        let mut plain = cpu::Renderer::new(self.scene.packed(), self.camera, config)?;
        // One more, to warm up.
        let median_of = |work: &mut dyn FnMut() -> f64| median((0..=self.repeats).map(|_| work()).skip(1).collect());
        steps.raytracing_us[1] = median_of(&mut || timed_us(|| plain.trace_camera_paths(CameraTurn::FIRST)).1);
        steps.photon_tracing_us[1] = median_of(&mut || timed_us(|| plain.trace_photon_paths(0, 0..photons)).1);
        steps.synthesize_us[1] = median_of(&mut || timed_us(|| plain.resolve_all()).1);
        Ok(())
    }
}

/// Microseconds of the launches of some stages.
fn time_of(run: &Run, which: impl Fn(&str) -> bool) -> f64 {
    let launches = run.launches.iter().filter(|launch| which(launch.stage));
    launches.map(|launch| launch.duration_ns * 1e-3).sum()
}
