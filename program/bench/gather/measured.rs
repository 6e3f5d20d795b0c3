//! The measurement of one gather method.

use std::time::Instant;

use super::MethodResult;
use crate::bench::median;
use crate::bench::structure::{Structure, structure};
use ppm_vk::internals::cpu::{self, DeviceReceivers};
use ppm_vk::internals::gather::{METHODS, Runs, Tests, is_gather_stage};
use ppm_vk::internals::layout::{GATHERED_FOR, GROUP, Gathered, NO_OBJECT, Photon, VisiblePoint};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::sizes::{Probe, Sizes};
use ppm_vk::internals::stage::BufferId;
use ppm_vk::{Error, Result, Run};

/// Maximum time of one gather, in microseconds; a slower method is measured on a share of the visible points.
const BUDGET_US: f64 = 1e6;

/// Visible points, photons, and the accepted photons of each point.
pub struct Input {
    pub points: Vec<VisiblePoint>,
    /// R² of each slot, for each photon map.
    pub radii2: Vec<f32>,
    pub photons: Vec<Photon>,
    /// M of each slot, for each photon map, by a kd-tree on the CPU.
    pub expected: Vec<u32>,
}

impl Input {
    /// The renderer's visible points and photons.
    pub fn of(renderer: &mut Renderer) -> Result<Self> {
        let count: Vec<u32> = renderer.gpu().download(BufferId::PhotonCount, Some(1))?;
        let mut input = Self {
            points: renderer.gpu().download(BufferId::VisiblePoints, None)?,
            radii2: renderer.gpu().download(BufferId::Radii2, None)?,
            photons: renderer.gpu().download(BufferId::Photons, Some(count[0] as usize))?,
            expected: Vec::new(),
        };
        let gathered = cpu::gather_kd_tree(&input.seen(), &input.photons);
        input.expected = gathered.iter().map(|gathered| gathered.count).collect();
        Ok(input)
    }

    pub fn seen(&self) -> DeviceReceivers<'_> {
        DeviceReceivers {
            points: &self.points,
            bsdfs: &[],
            radii2: &self.radii2,
        }
    }
}

/// Result of some work, and the microseconds that it took.
pub fn timed_us<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let begin = Instant::now();
    let result = work();
    (result, begin.elapsed().as_secs_f64() * 1e6)
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
pub struct Measured {
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
    pub fn new(renderer: &mut Renderer, method: usize, input: &Input, visible_points: usize) -> Result<Self> {
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
            if point.object == NO_OBJECT || tests[slot] & GATHERED_FOR == 0 {
                continue;
            }
            seen += 1;
            for receiver in (slot..gathered.len()).step_by(input.points.len()) {
                let (found, expected) = (gathered[receiver].count, input.expected[receiver]);
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

    pub fn repeat(&mut self, renderer: &mut Renderer, input: &Input) -> Result<()> {
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

    pub fn result(self, visible_points: usize, sizes: &Sizes) -> MethodResult {
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
