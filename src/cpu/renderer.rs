//! A plain progressive photon mapper: the paper's algorithm step by step, without optimisations.

mod radii;
mod saved;

use std::ops::Range;
use std::time::Instant;

use glam::{DVec3, DVec4};
use rayon::prelude::*;

use super::Inputs;
use super::camera::{CameraPath, trace_camera_path};
use super::coverage::{Place, can_have_photons, is_surrounded};
use super::direct::direct_light;
use super::gather::{Gathered, gather_kd_tree, gather_naive};
use super::photons::{Ending, trace_photon_path};
use super::slots::{Discs, Pixel, Slot};
use super::statistics::Statistics;
use super::vector::mean;
use crate::backend::{Backend, DeviceDescription, Figures, Resolved, settings};
use crate::config::{Direct, Estimator, RenderConfig, SEQUENCES, Totals, iterations_of};
use crate::error::{Error, Result, Setting};
use crate::gather::{METHODS, Runs, default_cpu_method};
use crate::layout::{COVERAGE_TRUSTED, COVERAGE_WHOLE, Photon, Settings};
use crate::packing::PackedScene;
use crate::random::{CameraTurn, PathKind, Random};
use crate::record::{Launch, Run};
use crate::scene::Camera;
use crate::sizes::PPM_SLOTS;
use crate::state::Blocks;

/// Photon paths that are traced before their photons are gathered.
const BATCH: u32 = 1 << 18;

/// A progressive render on the CPU, on all threads of rayon's pool.
pub struct Renderer {
    scene: PackedScene,
    config: RenderConfig,
    settings: Settings,
    /// Visible points per pixel at most.
    pixel_slots: usize,
    /// One per pixel, row by row from the top left.
    paths: Vec<CameraPath>,
    pixels: Vec<Pixel>,
    /// The slots of a pixel are contiguous.
    slots: Vec<Slot>,
    figures: Figures,
    created: Instant,
}

impl Renderer {
    /// Prepares a render: chooses the initial radii.
    ///
    /// # Errors
    /// A setting outside its range, or more photons in a batch than the k-d tree can index.
    pub fn new(scene: &PackedScene, camera: &Camera, config: RenderConfig) -> Result<Self> {
        config.check()?;
        let method = &METHODS[config.gather.unwrap_or_else(default_cpu_method)];
        if method.stages().is_some() {
            let what = format!("{}: runs on a Vulkan device alone", method.name);
            return Err(Error::setting(Setting::Gather, what));
        }
        let splits = scene.features.dielectric || scene.features.glossy;
        let pixel_slots = match config.estimator {
            Estimator::Ppm if splits => PPM_SLOTS as usize,
            _ => 1,
        };
        let pixels = config.resolution[0] as usize * config.resolution[1] as usize;
        let mut renderer = Self {
            scene: scene.clone(),
            settings: settings(&config, scene, camera, u32::MAX),
            config,
            pixel_slots,
            paths: Vec::new(),
            pixels: vec![Pixel::default(); pixels],
            slots: vec![Slot::default(); pixels * pixel_slots],
            figures: Figures::default(),
            created: Instant::now(),
        };
        renderer.choose_radii()?;
        Ok(renderer)
    }

    /// What tracing functions read.
    pub fn inputs(&self) -> Inputs<'_> {
        Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
        }
    }

    /// R², N and τ of all slots.
    pub fn statistics(&self) -> impl Iterator<Item = &Statistics> {
        self.slots.iter().map(|slot| &slot.statistics)
    }

    /// Traces a camera path for each pixel.
    pub fn trace_camera_paths(&self, turn: CameraTurn) -> Vec<CameraPath> {
        let width = self.config.resolution[0] as usize;
        let of_pixel = |pixel: usize| {
            let pixel = [(pixel % width) as u32, (pixel / width) as u32];
            trace_camera_path(&self.inputs(), pixel, turn, self.pixel_slots)
        };
        (0..self.pixels.len()).into_par_iter().map(of_pixel).collect()
    }

    /// Traces these photon paths of an iteration. Returns the photons in path order, and how many paths were truncated and not
    /// finite.
    pub fn trace_photon_paths(&self, iteration: u32, paths: Range<u32>) -> (Vec<Photon>, [u64; 2]) {
        let inputs = self.inputs();
        let chunks: Vec<u32> = paths.clone().step_by(1024).collect();
        let of_chunk = |&first: &u32| {
            let (mut photons, mut ended) = (Vec::new(), [0; 2]);
            for path in first..(first + 1024).min(paths.end) {
                match trace_photon_path(&inputs, path, iteration, &mut photons) {
                    Ending::Absorbed => {}
                    Ending::Truncated => ended[0] += 1,
                    Ending::NonFinite => ended[1] += 1,
                }
            }
            (photons, ended)
        };
        let (photons, ended): (Vec<_>, Vec<_>) = chunks.par_iter().map(of_chunk).unzip();
        let ended = ended
            .iter()
            .fold([0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        (photons.concat(), ended)
    }

    fn gather(&self, photons: &[Photon]) -> Vec<Gathered> {
        let discs = Discs {
            paths: &self.paths,
            slots: &self.slots,
            pixel_slots: self.pixel_slots,
        };
        match METHODS[self.config.gather.unwrap_or_else(default_cpu_method)].runs {
            Runs::CpuNaive => gather_naive(&discs, photons),
            _ => gather_kd_tree(&discs, photons),
        }
    }

    /// Adds emission and direct light of the pixels' paths.
    fn add_direct(&mut self, turn: CameraTurn) {
        let inputs = Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
        };
        let through_glass =
            turn.path == 0 && inputs.scene.features.dielectric && inputs.config.samples_behind_glass(turn.iteration);
        let of_pixel = |(index, (pixel, path)): (usize, (&mut Pixel, &CameraPath))| {
            let mut radiance = path.emitted;
            if inputs.config.direct == Direct::Light {
                let mut random = Random::of_pixel(inputs.config, PathKind::LightSample, index as u32, turn);
                for point in &path.points {
                    let light = direct_light(&inputs, point, through_glass, &mut random);
                    radiance += light.radiance;
                    pixel.unbent += light.unbent;
                }
                pixel.unbent_iterations += u32::from(through_glass);
            }
            radiance /= f64::from(turn.paths);
            pixel.direct += radiance;
            pixel.sequences[(turn.iteration % SEQUENCES) as usize] += radiance.extend(0.0);
            pixel.met += u32::from(path.met);
        };
        self.pixels
            .par_iter_mut()
            .zip(&self.paths)
            .enumerate()
            .for_each(of_pixel);
        self.figures.counters.truncated_paths += self.paths.iter().map(|path| path.truncated).sum::<u64>();
    }

    /// Samples the coverage of discs; for pixels without photons, whether a surface surrounds the point.
    fn add_coverage(&mut self, iteration: u32, gathered: &[Gathered]) {
        let inputs = Inputs {
            scene: &self.scene,
            settings: &self.settings,
            config: &self.config,
        };
        let points = inputs.config.coverage_points(iteration);
        let slots = self
            .slots
            .par_iter_mut()
            .zip(&mut self.pixels)
            .zip(&self.paths)
            .zip(gathered);
        slots
            .enumerate()
            .for_each(|(index, (((slot, pixel), path), gathered))| {
                let Some(point) = path.points.first() else { return };
                let normal = point.bsdf.normals().geometric;
                let place = Place {
                    origin: point.surface.origin_towards(normal),
                    normal,
                    object: point.surface.object,
                };
                let mut random = Random::of_disc(inputs.config, index as u32, iteration, points);
                let trusted =
                    slot.covered == f64::from(slot.coverage_iterations) && slot.coverage_iterations >= COVERAGE_TRUSTED;
                if slot.statistics.accepted == 0 && gathered.count == 0 {
                    random.skip_to(COVERAGE_WHOLE); // after the numbers of the disc
                    let [u, v, ..] = random.next4();
                    pixel.surrounded |= is_surrounded(&inputs, place, [u, v]);
                } else if !trusted || iteration.is_multiple_of(8) {
                    let covered = (0..points).filter(|&number| {
                        let [u, v, ..] = random.sample_of(number, points).next4();
                        can_have_photons(&inputs, place, slot.disc.sqrt(), [u, v])
                    });
                    slot.covered += covered.count() as f64 / f64::from(points);
                    slot.coverage_iterations += 1;
                }
            });
    }

    /// Updates the statistics with an iteration's photons.
    fn update(&mut self, iteration: u32, emitted: u32, gathered: &[Gathered]) {
        let alpha = f64::from(self.config.alpha);
        for (index, gathered) in gathered.iter().enumerate().filter(|(_, gathered)| gathered.count > 0) {
            let (pixel, number) = (index / self.pixel_slots, index % self.pixel_slots);
            let throughput = self.paths[pixel].points[number].throughput;
            let slot = &mut self.slots[index];
            // τ is that of a disc of R. A smaller disc has been gathered where the radius is bounded.
            let larger = slot.statistics.radius2 / slot.disc;
            let of_disc = Statistics {
                flux: throughput * gathered.flux * larger,
                ..slot.statistics
            };
            let curvature = Statistics {
                flux: DVec3::splat(mean(throughput) * gathered.curvature(slot.disc) * larger),
                ..of_disc
            };
            let [radiance, curvature] =
                [of_disc, curvature].map(|part| part.radiance(slot.covered_fraction(), emitted.into()));
            let sequence = (iteration % SEQUENCES) as usize;
            self.pixels[pixel].sequences[sequence] += radiance.extend(curvature.x);
            slot.statistics.take(gathered.count, of_disc.flux, alpha);
        }
    }
}

impl Backend for Renderer {
    fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        let iteration = self.figures.totals.iterations;
        let mut clock = Clock {
            created: self.created,
            run: Run::default(),
        };
        let mut turn = CameraTurn::that_gathers(&self.config, iteration);
        if self.config.finds_visible_points(iteration) {
            self.paths = clock.time("camera", || self.trace_camera_paths(turn));
        }
        // Equation 2 has shrunk them, also where the visible points stay.
        self.find_discs();
        let mut gathered = vec![Gathered::default(); self.slots.len()];
        let (mut emitted, mut stored, mut ended) = (0, 0, [0; 2]);
        while emitted < self.config.photons {
            if emitted > 0 && stop() {
                if iteration > 0 {
                    return Ok(None);
                }
                // More camera paths could take longer than the photons that were skipped.
                turn.paths = 1;
                break;
            }
            let batch = emitted..emitted + BATCH.min(self.config.photons - emitted);
            emitted = batch.end;
            let (photons, of_batch) = clock.time("photons", || self.trace_photon_paths(iteration, batch));
            ended = [ended[0] + of_batch[0], ended[1] + of_batch[1]];
            stored += photons.len() as u64;
            let accepted = clock.time("gather", || self.gather(&photons));
            gathered.iter_mut().zip(&accepted).for_each(|(sum, part)| sum.add(part));
        }
        clock.time("direct", || self.add_direct(turn));
        if self.config.estimator == Estimator::Sppm {
            clock.time("coverage", || self.add_coverage(iteration, &gathered));
        }
        clock.time("update", || self.update(iteration, emitted, &gathered));
        for turn in turn.others() {
            self.paths = clock.time("camera", || self.trace_camera_paths(turn));
            clock.time("direct", || self.add_direct(turn));
        }
        self.figures.counters.photons_landed += stored;
        self.figures.counters.photons_stored += stored;
        self.figures.counters.truncated_paths += ended[0];
        self.figures.counters.non_finite += ended[1];
        self.figures.totals.add(Totals {
            iterations: 1,
            emitted: emitted.into(),
            camera_paths: turn.paths,
        });
        Ok(Some(clock.run))
    }

    fn resolve_all(&mut self) -> Result<Resolved> {
        self.figures.counters.photons_accepted = self.statistics().map(|statistics| statistics.accepted).sum();
        let totals = self.figures.totals.at_least_one();
        let mut non_finite = 0;
        // Values beyond f32 are black.
        let rounded = |value: DVec4| Some(value.as_vec4()).filter(|value| value.is_finite());
        let (mut film, mut behind_glass) = (Vec::new(), Vec::new());
        for (index, pixel) in self.pixels.iter().enumerate() {
            let slots = &self.slots[index * self.pixel_slots..][..self.pixel_slots];
            let (radiance, glass) = pixel.resolve(&self.paths[index].points, slots, totals);
            let waits = pixel.surrounded && slots.iter().all(|slot| slot.statistics.accepted == 0);
            let alpha = pixel.met as f32 / totals.camera_paths as f32;
            let radiance = rounded(radiance.extend(0.0));
            non_finite += u64::from(radiance.is_none());
            let [r, g, b, _] = radiance.unwrap_or_default().to_array();
            film.push([r, g, b, if waits { -alpha } else { alpha }]);
            behind_glass.push(glass);
        }
        let mut sequences = Vec::new();
        for sequence in 0..SEQUENCES {
            let iterations = iterations_of(sequence, totals.iterations).max(1);
            let of_pixel = |pixel: &Pixel| pixel.sequences[sequence as usize] / f64::from(iterations);
            let pictures = self
                .pixels
                .iter()
                .map(|pixel| rounded(of_pixel(pixel)).unwrap_or_default());
            sequences.extend(pictures.map(|value| value.to_array()));
        }
        self.figures.counters.non_finite += non_finite;
        Ok(Resolved::from_film(
            self.config.resolution,
            &film,
            behind_glass,
            sequences,
        ))
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
        false
    }

    fn photon_maps(&self) -> u32 {
        1
    }

    fn device(&self) -> DeviceDescription {
        DeviceDescription {
            name: "CPU".to_owned(),
            driver: format!("{} threads", rayon::current_num_threads()),
            timestamp_period_ns: 1.0,
        }
    }
}

/// Measures the steps.
struct Clock {
    created: Instant,
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
            begin_ns: (begin - self.created).as_secs_f64() * 1e9,
            duration_ns: duration.as_secs_f64() * 1e9,
        });
        result
    }
}
