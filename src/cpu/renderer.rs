//! The order of the stages in one iteration, on the CPU.

use std::time::Instant;

use bytemuck::Zeroable;

use super::{
    Batch, Counts, Demand, GatheredWith, Inputs, Progress, Seen, camera, compact, count_met, coverage, demand, direct,
    fit_radius, gather_kd_tree, gather_naive, grid_shape, photons, radii, reset, resolve, resolve_sequences,
    shell_radii, update,
};
use crate::backend::{Backend, Counters, DeviceDescription, Resolved, demand_floor2, settings};
use crate::config::{EmissionChoice, Estimator, RenderConfig, SEQUENCES, Totals};
use crate::emission::{Aim, is_learned_from};
use crate::error::{Error, Result};
use crate::gather::{METHODS, Runs, default_cpu_method};
use crate::layout::{Coverage, DirectSum, Gathered, Settings, Statistics};
use crate::packing::PackedScene;
use crate::radius;
use crate::random::CameraTurn;
use crate::record::{Launch, Run};
use crate::scene::Camera;
use crate::sizes::{Limits, Sizes};

/// Lanes that a batch's photon paths are dealt to, whatever the number of threads. As many as on a CPU's Vulkan
/// device, so that both give the photons in the same order.
const LANES: u32 = 4096;
/// Bytes of a batch's photons at the most.
const PHOTON_BYTES: u64 = 1 << 27;

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
    /// Of each slot, for each of [`SEQUENCES`].
    sequence_sums: Vec<[f32; 4]>,
    coverage: Vec<Coverage>,
    /// Median of the initial radii.
    radius: f32,
    photon_flux: Option<f64>,
    totals: Totals,
    counters: Counters,
    /// Of photon paths, if they are aimed.
    aim: Option<Aim>,
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
            clustered_run: 1,
            splitting: scene.features.dielectric || scene.features.glossy,
            specular: scene.features.mirror || scene.features.dielectric,
            glossy: scene.features.glossy,
            meshes: scene.object_grids.len() as u32,
            object_cells: scene.object_cells,
        };
        let sizes = Sizes::new(&config, limits);
        let (slots, receivers) = (sizes.slots() as usize, sizes.receivers() as usize);
        let mut renderer = Self {
            scene: scene.clone(),
            sizes,
            settings: Settings {
                slots_per_pixel: sizes.slots_per_pixel,
                photon_lanes: sizes.photon_lanes,
                photon_maps: sizes.photon_maps,
                ..settings(&config, scene, camera, limits.loop_limit)
            },
            config,
            seen: Seen::default(),
            statistics: vec![reset(0.0); receivers],
            gathered: vec![Gathered::zeroed(); receivers],
            direct_sums: vec![DirectSum::zeroed(); slots],
            sequence_sums: vec![[0.0; 4]; SEQUENCES as usize * slots],
            coverage: vec![Coverage::zeroed(); receivers],
            radius: 0.0,
            photon_flux: None,
            totals: Totals::default(),
            counters: Counters::default(),
            aim: None,
            made: Instant::now(),
        };
        renderer.prepare()?;
        Ok(renderer)
    }

    /// What the stages read of the configuration and the camera.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// R², N and τ of each slot, for each photon map.
    pub fn statistics(&self) -> &[Statistics] {
        &self.statistics
    }

    /// What the stages read, without what visible points want of photons.
    fn inputs(&self) -> Inputs<'_> {
        Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
            demand: None,
            emission: self.aim.as_ref().map(Aim::table),
        }
    }

    /// Where photon paths start that are aimed; `None` for those that aren't.
    pub fn aim(&self) -> Option<&Aim> {
        self.aim.as_ref()
    }

    /// Aims photon paths by pilot rounds, if they are to be aimed, at what discs of a pilot want; then finds the
    /// radii.
    fn prepare(&mut self) -> Result<()> {
        let counts = Counts::default();
        let seen = camera(&self.inputs(), CameraTurn::FIRST, &counts);
        let mut of_pilot = vec![reset(0.0); self.statistics.len()];
        let radii2 = radii(&self.settings, &seen, &mut of_pilot);
        let demand = self.demand(&seen, &radii2);
        if self.config.emission == EmissionChoice::Aimed {
            let paths = self.sizes.pilot_paths(self.config.photons);
            self.aim = Aim::by_pilots(&self.config, &self.scene, &seen.points, |table, iteration| {
                let inputs = Inputs {
                    demand: demand.as_ref(),
                    emission: Some(table),
                    ..self.inputs()
                };
                let batch = Batch {
                    iteration,
                    first_path: 0,
                    paths,
                };
                Ok::<_, Error>(photons(&inputs, batch, &counts).values)
            })?;
        }
        self.choose_radius(&seen, demand.as_ref())
    }

    /// Takes the user's radius, or finds first radii from the density of pilot photons: one that suits the median visible
    /// point, then smaller ones where the photons are denser.
    fn choose_radius(&mut self, seen: &Seen, demand: Option<&Demand>) -> Result<()> {
        if self.config.radius.is_none() {
            let inputs = Inputs {
                demand,
                ..self.inputs()
            };
            let batch = batch_of(&self.sizes, &self.config, radius::PILOT, 0);
            let counts = Counts::default();
            let photons = compact(&photons(&inputs, batch, &counts).lanes);
            let dropping = radius::is_dropping_worth_it(counts.landed(), photons.len() as u64, self.aim.is_some());
            // The pilot is a batch; the densities of the whole iteration's photons are higher.
            let share = self.sizes.batch_paths as f32 / self.config.photons as f32;
            self.config.drop_unwanted &= dropping;
            self.photon_flux = radius::mean_flux(&photons);
            let first = radius::first(&seen.points, &seen.footprints, &photons, share);
            self.settings.first_footprints = first.map(|first| first.footprints);
            let wanted = first.map(|first| first.photons as f32 * share);
            for _ in 0..radius::FITS {
                let radii2 = radii(&self.settings, seen, &mut self.statistics);
                gather_kd_tree(seen, &radii2, &photons, &mut self.gathered)?;
                fit_radius(
                    wanted,
                    radius::LEAST_FOOTPRINTS,
                    &seen.footprints,
                    &mut self.gathered,
                    &mut self.statistics,
                );
            }
            if self.sizes.photon_maps == 2 {
                let caustic = &mut self.statistics[seen.points.len()..];
                radius::sharpen(self.config.resolution, &seen.footprints, caustic);
            }
        } else {
            radii(&self.settings, seen, &mut self.statistics);
        }
        self.radius = radius::median(&self.statistics[..seen.points.len()]);
        Ok(())
    }

    /// What visible points with discs of `radii2` want of photons.
    fn demand(&self, seen: &Seen, radii2: &[f32]) -> Option<Demand> {
        if !self.config.drops_unwanted() {
            return None;
        }
        let step = self.sizes.radius_step();
        let grid = grid_shape(&shell_radii(&self.settings, &seen.points, radii2, step));
        let progress = Progress {
            statistics: &self.statistics,
            coverage: &self.coverage,
            direct_sums: &self.direct_sums,
            iterations: self.totals.iterations,
            emitted: self.totals.emitted,
        };
        Some(demand(&self.settings, seen, radii2, progress, grid))
    }
}

impl Backend for Renderer {
    fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        let iteration = self.totals.iterations;
        if self.aim.is_some() && self.config.begins_sequences(iteration) {
            if iteration > 0 {
                self.settings.demand_floor2 = demand_floor2(&self.resolve()?);
            }
            // What an iteration learns changes no sequence.
            if let Some(aim) = &mut self.aim {
                aim.update();
            }
        }
        let inputs = Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
            demand: None,
            emission: self.aim.as_ref().map(Aim::table),
        };
        let counts = Counts::default();
        let mut values = Vec::new();
        let mut clock = Clock {
            made: self.made,
            run: Run::default(),
        };
        let slots = self.direct_sums.len();
        let sequence = (iteration % SEQUENCES) as usize * slots;
        let sequence = sequence..sequence + slots;
        let mut turn = CameraTurn::that_gathers(&self.config, iteration);
        if iteration == 0 || self.config.estimator == Estimator::Sppm {
            self.seen = clock.time("camera", || camera(&inputs, turn, &counts));
        }
        let radii2 = clock.time("radii", || radii(&self.settings, &self.seen, &mut self.statistics));
        let demand = clock.time("demand", || self.demand(&self.seen, &radii2));
        let inputs = Inputs {
            demand: demand.as_ref(),
            ..inputs
        };
        let mut stored = 0;
        let mut emitted = 0;
        for batch in 0..self.sizes.batches(self.config.photons) {
            if emitted > 0 && stop() {
                if iteration > 0 {
                    self.gathered.fill(Gathered::zeroed());
                    return Ok(None);
                }
                // More camera paths could take longer than what was cut.
                turn.paths = 1;
                break;
            }
            let batch = batch_of(&self.sizes, &self.config, iteration, batch);
            let traced = clock.time("photons", || photons(&inputs, batch, &counts));
            let photons = clock.time("compact", || compact(&traced.lanes));
            if batch.first_path == 0 {
                values = traced.values;
            }
            let (seen, gathered) = (&self.seen, &mut self.gathered);
            match METHODS[self.config.gather.unwrap_or_else(default_cpu_method)].runs {
                Runs::CpuNaive => {
                    clock.time("gather_naive", || gather_naive(seen, &radii2, &photons, gathered));
                }
                _ => clock.time("gather_kd_tree", || gather_kd_tree(seen, &radii2, &photons, gathered))?,
            }
            stored += photons.len() as u64;
            emitted += batch.paths;
        }
        let sequence = &mut self.sequence_sums[sequence];
        clock.time("direct", || {
            let (statistics, sums) = (&self.statistics, &mut self.direct_sums);
            direct(&inputs, turn, &self.seen, statistics, &counts, sums, sequence);
            count_met(&self.seen.points, &mut self.coverage);
        });
        if self.config.estimator == Estimator::Sppm {
            let points = &self.seen.points;
            clock.time("coverage", || {
                coverage(
                    &inputs,
                    iteration,
                    points,
                    &radii2,
                    (&self.statistics, &self.gathered),
                    &mut self.coverage,
                )
            });
        }
        let gathered_with = GatheredWith {
            radii2: &radii2,
            coverage: &self.coverage,
            photons: emitted,
            alpha: self.config.alpha,
        };
        clock.time("update", || {
            update(
                &self.seen.points,
                gathered_with,
                &counts,
                &mut self.gathered,
                &mut self.statistics,
                sequence,
            );
        });
        for turn in turn.others() {
            self.seen = clock.time("camera", || camera(&inputs, turn, &counts));
            clock.time("direct", || {
                let (statistics, sums) = (&self.statistics, &mut self.direct_sums);
                direct(&inputs, turn, &self.seen, statistics, &counts, sums, sequence);
                count_met(&self.seen.points, &mut self.coverage);
            });
        }
        if let Some(aim) = &mut self.aim
            && is_learned_from(&self.config, iteration)
        {
            aim.learn(&self.config, iteration, 0, &values);
        }
        self.counters.photons_stored += stored;
        self.counters.truncated_paths += counts.truncated_paths();
        self.counters.non_finite += counts.non_finite();
        self.counters.photons_landed += counts.landed();
        self.totals.add(Totals {
            iterations: 1,
            emitted: emitted.into(),
            camera_paths: turn.paths,
        });
        Ok(Some(clock.run))
    }

    fn resolve_all(&mut self) -> Result<Resolved> {
        self.counters.photons_accepted = self.statistics.iter().map(Statistics::accepted).sum();
        let totals = self.totals.at_least_one();
        let (film, behind_glass, non_finite) = resolve(
            &self.settings,
            &self.seen.points,
            &self.statistics,
            &self.direct_sums,
            &self.coverage,
            totals,
        );
        self.counters.non_finite += non_finite;
        let sequences = resolve_sequences(&self.settings, &self.sequence_sums, totals.iterations);
        Ok(Resolved::from_film(
            self.config.resolution,
            &film,
            behind_glass,
            sequences,
        ))
    }

    fn iterations(&self) -> u32 {
        self.totals.iterations
    }

    fn emitted(&self) -> u64 {
        self.totals.emitted
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn radius(&self) -> f32 {
        self.radius
    }

    fn photon_flux(&self) -> Option<f64> {
        self.photon_flux
    }

    fn aims(&self) -> bool {
        self.aim.is_some()
    }

    fn photon_maps(&self) -> u32 {
        self.sizes.photon_maps
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
