//! The order of the stages in one iteration, on the CPU.

use std::time::Instant;

use bytemuck::Zeroable;

use super::{
    Batch, Counts, Inputs, Seen, camera, compact, coverage, direct, fit_radius, gather_kd_tree, gather_naive, photons,
    reset, resolve, update,
};
use crate::backend::{Backend, Counters, DeviceDescription, Resolved, settings};
use crate::config::{Estimator, Limits, RenderConfig, Sizes};
use crate::error::{Error, Result};
use crate::gather::{METHODS, Runs, default_cpu_method};
use crate::layout::{Coverage, DirectSum, Gathered, Settings, Statistics};
use crate::radius;
use crate::record::{Launch, Run};
use crate::scene::{Camera, PackedScene};

/// Lanes that a batch's photon paths are dealt to, whatever the number of threads. As many as on a CPU's Vulkan
/// device, so that both give the photons in the same order.
const LANES: u32 = 4096;
/// Bytes of a batch's photons at the most.
const PHOTON_BYTES: u64 = 1 << 30;

/// A progressive render on the CPU, with all threads of rayon's pool.
pub struct Renderer {
    scene: PackedScene,
    config: RenderConfig,
    sizes: Sizes,
    settings: Settings,
    seen: Seen,
    statistics: Vec<Statistics>,
    gathered: Vec<Gathered>,
    direct_sums: Vec<DirectSum>,
    coverage: Vec<Coverage>,
    iterations: u32,
    emitted: u64,
    counters: Counters,
    made: Instant,
}

impl Renderer {
    /// Prepares a render: finds the radius, resets the statistics.
    ///
    /// # Errors
    /// A setting outside its range, or more photons in a batch than the kd-tree can number.
    pub fn new(scene: &PackedScene, camera: &Camera, config: RenderConfig) -> Result<Self> {
        config.check()?;
        let method = &METHODS[config.gather.unwrap_or_else(default_cpu_method)];
        if method.stages().is_some() {
            return Err(Error::Config(format!(
                "--gather {}: runs on a Vulkan device; leave out --backend cpu",
                method.name
            )));
        }
        let limits = Limits {
            storage_buffer_bytes: PHOTON_BYTES,
            loop_limit: u32::MAX,
            lanes: LANES,
            splitting: scene.features.dielectric || scene.features.glossy,
            glossy: scene.features.glossy,
            meshes: scene.object_grids.len() as u32,
            object_cells: scene.object_cells,
        };
        let sizes = Sizes::new(&config, limits);
        let slots = sizes.slots() as usize;
        let mut renderer = Self {
            scene: scene.clone(),
            sizes,
            settings: Settings {
                slots_per_pixel: sizes.slots_per_pixel,
                photon_lanes: sizes.photon_lanes,
                ..settings(&config, scene, camera, limits.loop_limit)
            },
            config,
            seen: Seen::default(),
            statistics: Vec::new(),
            gathered: vec![Gathered::zeroed(); slots],
            direct_sums: vec![DirectSum::zeroed(); slots],
            coverage: vec![Coverage::zeroed(); slots],
            iterations: 0,
            emitted: 0,
            counters: Counters::default(),
            made: Instant::now(),
        };
        renderer.choose_radius()?;
        Ok(renderer)
    }

    /// What the stages read of the configuration and the camera.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// R², N and τ of each slot.
    pub fn statistics(&self) -> &[Statistics] {
        &self.statistics
    }

    /// Takes the user's radius, or finds one from the density of pilot photons: one for the median visible point, then
    /// smaller ones where the photons are denser. Resets the statistics.
    fn choose_radius(&mut self) -> Result<()> {
        let slots = self.sizes.slots() as usize;
        if self.config.radius.is_some() {
            self.statistics = vec![reset(self.settings.initial_radius2); slots];
            return Ok(());
        }
        let inputs = Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
        };
        let counts = Counts::default();
        let seen = camera(&inputs, 0, &counts);
        let photons = compact(&photons(
            &inputs,
            batch_of(&self.sizes, &self.config, radius::PILOT, 0),
            &counts,
        ));
        // The pilot is a batch; the densities of the whole iteration's photons are higher.
        let share = self.sizes.batch_paths as f32 / self.config.photons as f32;
        let automatic = radius::automatic(&seen.points, &photons);
        self.settings.initial_radius2 = automatic.radius2 * share;
        self.statistics = vec![reset(self.settings.initial_radius2); slots];
        for _ in 0..radius::FITS {
            gather_kd_tree(&seen, &self.statistics, &photons, &mut self.gathered)?;
            let wanted = automatic.photons as f32 * share;
            fit_radius(wanted, &mut self.gathered, &mut self.statistics);
        }
        Ok(())
    }
}

impl Backend for Renderer {
    fn iterate(&mut self) -> Result<Run> {
        let iteration = self.iterations;
        let inputs = Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
        };
        let counts = Counts::default();
        let mut clock = Clock {
            made: self.made,
            run: Run::default(),
        };
        if iteration == 0 || self.config.estimator == Estimator::Sppm {
            self.seen = clock.time("camera", || camera(&inputs, iteration, &counts));
        }
        for batch in 0..self.sizes.batches(self.config.photons) {
            let batch = batch_of(&self.sizes, &self.config, iteration, batch);
            let lanes = clock.time("photons", || photons(&inputs, batch, &counts));
            let photons = clock.time("compact", || compact(&lanes));
            let (seen, statistics, gathered) = (&self.seen, &self.statistics, &mut self.gathered);
            match METHODS[self.config.gather.unwrap_or_else(default_cpu_method)].runs {
                Runs::CpuNaive => {
                    clock.time("gather_naive", || gather_naive(seen, statistics, &photons, gathered));
                }
                _ => clock.time("gather_kd_tree", || {
                    gather_kd_tree(seen, statistics, &photons, gathered)
                })?,
            }
            self.counters.photons_stored += photons.len() as u64;
        }
        clock.time("direct", || {
            direct(&inputs, iteration, &self.seen, &counts, &mut self.direct_sums)
        });
        if self.config.estimator == Estimator::Sppm {
            let (points, statistics) = (&self.seen.points, &self.statistics);
            clock.time("coverage", || {
                coverage(&inputs, iteration, points, statistics, &mut self.coverage)
            });
        }
        clock.time("update", || {
            update(
                &self.seen.points,
                self.config.alpha,
                &counts,
                &mut self.gathered,
                &mut self.statistics,
            );
        });
        self.counters.truncated_paths += counts.truncated_paths();
        self.counters.non_finite += counts.non_finite();
        self.iterations += 1;
        self.emitted += u64::from(self.config.photons);
        Ok(clock.run)
    }

    fn resolve_all(&mut self) -> Result<Resolved> {
        let (iterations, emitted) = (self.iterations.max(1), self.emitted.max(1));
        let film = resolve(
            &self.settings,
            &self.statistics,
            &self.direct_sums,
            &self.coverage,
            iterations,
            emitted,
        );
        Ok(Resolved::from_film(self.config.resolution, &film))
    }

    fn iterations(&self) -> u32 {
        self.iterations
    }

    fn emitted(&self) -> u64 {
        self.emitted
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn radius(&self) -> f32 {
        self.settings.initial_radius2.sqrt()
    }

    fn device(&self) -> DeviceDescription {
        DeviceDescription {
            name: "CPU".to_owned(),
            driver: format!("{} threads", rayon::current_num_threads()),
            timestamp_period_ns: 1.0,
        }
    }
}

fn batch_of(sizes: &Sizes, config: &RenderConfig, iteration: u32, batch: u32) -> Batch {
    let first_path = batch * sizes.batch_paths;
    Batch {
        iteration,
        first_path,
        paths: sizes.batch_paths.min(config.photons - first_path),
    }
}

/// Notes when stages run.
struct Clock {
    made: Instant,
    run: Run,
}

impl Clock {
    fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let result = work();
        let duration = begin.elapsed();
        self.run.wall += duration;
        self.run.launches.push(Launch {
            stage,
            begin_ns: (begin - self.made).as_secs_f64() * 1e9,
            duration_ns: duration.as_secs_f64() * 1e9,
        });
        result
    }
}
