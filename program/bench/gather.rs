//! Every gather method on the same visible points and photons.

use std::time::Instant;

use serde::Serialize;

use super::structure::{Structure, structure};
use super::{median, stages_of};
use ppm_vk::internals::backend::Backend as _;
use ppm_vk::internals::cpu::{self, DeviceReceivers};
use ppm_vk::internals::gather::{METHODS, Runs, Tests, is_gather_stage};
use ppm_vk::internals::layout::{GATHERED_FOR, GROUP, Gathered, NO_OBJECT, Photon, VisiblePoint};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::random::CameraTurn;
use ppm_vk::internals::sizes::{Probe, Sizes};
use ppm_vk::internals::stage::BufferId;
use ppm_vk::{Camera, DeviceDescription, Error, Platform, PreparedScene, RenderConfig, Result, Run, Session};

/// Maximum time of one gather, in microseconds; a slower method is measured on a share of the visible points.
const BUDGET_US: f64 = 1e6;

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

/// Visible points, photons, and the accepted photons of each point.
struct Input {
    points: Vec<VisiblePoint>,
    /// R² of each slot, for each photon map.
    radii2: Vec<f32>,
    photons: Vec<Photon>,
    /// M of each slot, for each photon map, by a kd-tree on the CPU.
    expected: Vec<u32>,
}

impl Input {
    fn seen(&self) -> DeviceReceivers<'_> {
        DeviceReceivers {
            points: &self.points,
            bsdfs: &[],
            radii2: &self.radii2,
        }
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
        let input = input(renderer)?;
        self.cpu_steps(resolution, &mut steps)?;
        let visible_points = input.points.iter().filter(|point| object(point) != NO_OBJECT).count();

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

fn input(renderer: &mut Renderer) -> Result<Input> {
    let count: Vec<u32> = renderer.gpu().download(BufferId::PhotonCount, Some(1))?;
    let mut input = Input {
        points: renderer.gpu().download(BufferId::VisiblePoints, None)?,
        radii2: renderer.gpu().download(BufferId::Radii2, None)?,
        photons: renderer.gpu().download(BufferId::Photons, Some(count[0] as usize))?,
        expected: Vec::new(),
    };
    let gathered = cpu::gather_kd_tree(&input.seen(), &input.photons);
    input.expected = gathered.iter().map(|gathered| gathered.count).collect();
    Ok(input)
}

fn object(point: &VisiblePoint) -> u32 {
    point.object
}

fn count_of(gathered: &Gathered) -> u32 {
    gathered.count
}

/// Result of some work, and the microseconds that it took.
fn timed_us<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let begin = Instant::now();
    let result = work();
    (result, begin.elapsed().as_secs_f64() * 1e6)
}

/// Microseconds of the launches of some stages.
fn time_of(run: &Run, which: impl Fn(&str) -> bool) -> f64 {
    let launches = run.launches.iter().filter(|launch| which(launch.stage));
    launches.map(|launch| launch.duration_ns * 1e-3).sum()
}

/// Microseconds of ordering points, ordering photons, gathering.
fn phases(run: &Run) -> [f64; 3] {
    // Photons come after points; the first stage that reads photons begins the second phase.
    let begins_build = |stage: &str| ["mesh_count", "object_cell_count", "grid_radii"].contains(&stage);
    let mut phase = 0;
    let mut times = [0.0; 3];
    for launch in &run.launches {
        if is_gather_stage(launch.stage) {
            phase = 2;
        } else if begins_build(launch.stage) {
            phase = 1;
        }
        times[phase] += launch.duration_ns * 1e-3;
    }
    times
}

/// A method that is being measured.
struct Measured {
    method: usize,
    probe: Probe,
    share: f64,
    tested: f64,
    accepted: f64,
    structure: Structure,
    times: Vec<[f64; 3]>,
}

impl Measured {
    /// Compares the method's photons with the expected ones, and chooses the share for the measurement.
    fn new(renderer: &mut Renderer, method: usize, input: &Input, visible_points: usize) -> Result<Self> {
        let mut measured = Self {
            method,
            probe: Probe::default(),
            share: 1.0,
            tested: input.photons.len() as f64,
            accepted: mean(input.expected.iter().copied(), visible_points),
            structure: Structure::default(),
            times: Vec::new(),
        };
        let Runs::Device { tests, .. } = METHODS[method].runs else {
            if matches!(METHODS[method].runs, Runs::CpuNaive) {
                measured.choose_stride(measured.cpu_naive(input, 256) * 256.0);
            } else {
                measured.tested = f64::NAN;
            }
            return Ok(measured);
        };
        if tests == Tests::All {
            let stride = renderer.sizes().slots().div_ceil(GROUP).div_ceil(16);
            measured.probe.stride = stride;
            // Twice: the first run compiles.
            renderer.gather(method, measured.probe)?;
            let (run, _) = renderer.gather(method, measured.probe)?;
            measured.choose_stride(phases(&run)[2] * f64::from(stride));
        }
        let counting = Probe {
            count_tests: true,
            ..measured.probe
        };
        let (_, status) = renderer.gather(method, counting)?;
        measured.structure = structure(renderer, METHODS[method].name, &status)?;
        let gathered: Vec<Gathered> = renderer.gpu().download(BufferId::GatheredOf, None)?;
        let tests: Vec<u32> = renderer.gpu().download(BufferId::TestsOf, None)?;
        // With a maximum per cell, the method loses photons; its result states the number.
        let loses = renderer.sizes().cell_photons.is_some() && METHODS[method].name == "cluster-grid";
        let (mut seen, mut accepted) = (0, 0.0);
        for (slot, point) in input.points.iter().enumerate() {
            if object(point) == NO_OBJECT || tests[slot] & GATHERED_FOR == 0 {
                continue;
            }
            seen += 1;
            for receiver in (slot..gathered.len()).step_by(input.points.len()) {
                let (found, expected) = (count_of(&gathered[receiver]), input.expected[receiver]);
                accepted += f64::from(found);
                if found != expected && !loses {
                    return Err(Error::Device(format!(
                        "method {}: finds {found} photons for visible point {slot}, a kd-tree {expected}; please report \
                         this with the device and its driver",
                        METHODS[method].name
                    )));
                }
            }
        }
        measured.share = seen as f64 / visible_points.max(1) as f64;
        measured.tested = mean(tests.into_iter().map(|tests| tests & !GATHERED_FOR), seen);
        measured.accepted = accepted / seen.max(1) as f64;
        // And once as in the measurement.
        renderer.gather(method, measured.probe)?;
        Ok(measured)
    }

    /// Chooses a stride by the time that all visible points would take.
    fn choose_stride(&mut self, whole_us: f64) {
        self.probe.stride = (whole_us / BUDGET_US).ceil().max(1.0) as u32;
        self.share = 1.0 / f64::from(self.probe.stride);
    }

    /// Microseconds of testing every photon on the CPU for one visible point in `stride`.
    fn cpu_naive(&self, input: &Input, stride: usize) -> f64 {
        let points: Vec<VisiblePoint> = input.points.iter().copied().step_by(stride).collect();
        let maps = input.radii2.chunks(input.points.len());
        let radii2: Vec<f32> = maps.flat_map(|map| map.iter().copied().step_by(stride)).collect();
        let seen = DeviceReceivers {
            points: &points,
            bsdfs: &[],
            radii2: &radii2,
        };
        timed_us(|| cpu::gather_naive(&seen, &input.photons)).1
    }

    fn repeat(&mut self, renderer: &mut Renderer, input: &Input) -> Result<()> {
        let times = match METHODS[self.method].runs {
            Runs::Device { .. } => phases(&renderer.gather(self.method, self.probe)?.0),
            Runs::CpuNaive => [0.0, 0.0, self.cpu_naive(input, self.probe.stride as usize)],
            Runs::CpuKdTree => {
                let (_, us) = timed_us(|| cpu::gather_kd_tree(&input.seen(), &input.photons));
                [0.0, 0.0, us]
            }
        };
        self.times.push(times);
        Ok(())
    }

    fn result(self, visible_points: usize, sizes: &Sizes) -> MethodResult {
        let phase = |index: usize| median(self.times.iter().map(|times| times[index]).collect());
        let gather_us = phase(2) / self.share;
        let sharing = match METHODS[self.method].runs {
            Runs::Device { sharing, .. } => sharing(sizes).into(),
            _ => 1.0,
        };
        let tests = self.tested * visible_points as f64;
        // Position, normal and R² of a visible point, and its sum read and written.
        let point_bytes = 3 * 16 + 2 * size_of::<Gathered>();
        let bytes = tests / sharing * size_of::<Photon>() as f64 + (visible_points * point_bytes) as f64;
        MethodResult {
            method: METHODS[self.method].name,
            order_us: phase(0),
            build_us: phase(1),
            gather_us,
            share: self.share,
            tested: self.tested,
            accepted: self.accepted,
            tests_per_s: tests / gather_us * 1e6,
            bytes_per_s: bytes / gather_us * 1e6,
            structure: self.structure,
        }
    }
}

fn mean(counts: impl Iterator<Item = u32>, number: usize) -> f64 {
    counts.map(f64::from).sum::<f64>() / number.max(1) as f64
}
