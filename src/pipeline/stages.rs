//! The stages of an iteration, as data.

use std::ops::Range;

use crate::config::{
    Accel, Direct, Estimator, PixelFilter, RenderConfig, SEQUENCES, Totals, TriangleTest, iterations_of,
};
use crate::gather::{METHODS, Record, default_method, grid_sizes, scan};
use crate::packing::SceneFeatures;
use crate::random::CameraTurn;
use crate::record::Recording;
use crate::shaders;
use crate::sizes::Sizes;
use crate::stage::{BufferId, RAY_QUERY, SEQUENCE_FILMS, SEQUENCE_SUMS, Shader, StageDesc};

/// The stages of a render, as data, without a device.
#[derive(Clone, Copy)]
pub struct Stages<'a> {
    /// The render's settings.
    pub config: &'a RenderConfig,
    /// Its buffers' sizes.
    pub sizes: &'a Sizes,
    /// Its scene's features.
    pub features: SceneFeatures,
}

/// The stages of a gather method that [`super::Renderer::new`] has accepted.
pub(super) fn method_stages(method: usize) -> (Record, Record) {
    let nothing: Record = |_, _| ();
    METHODS[method].stages().unwrap_or((nothing, nothing))
}

/// The sums of an iteration's sequence, for stages that add to them.
fn sums_of(iteration: u32) -> (BufferId, BufferId) {
    (BufferId::SequenceSums, SEQUENCE_SUMS[(iteration % SEQUENCES) as usize])
}

/// A recording that clears the status first.
pub(super) fn reporting() -> Recording {
    let mut recording = Recording::new();
    recording.fill(BufferId::Status, 0);
    recording
}

impl Stages<'_> {
    /// The commands of an iteration.
    pub fn iteration(&self, iteration: u32) -> Recording {
        let mut recording = reporting();
        self.begin(iteration, &mut recording);
        for batch in 0..self.sizes.batches(self.config.photons) {
            self.batch(iteration, batch, &mut recording);
        }
        let turn = CameraTurn::that_gathers(self.config, iteration);
        self.end(turn, self.config.photons, &mut recording);
        recording
    }

    /// The commands of an iteration of one batch: they use the same buffers as several batches.
    pub fn shortest_iteration(&self) -> Recording {
        let mut recording = reporting();
        self.begin(0, &mut recording);
        self.batch(0, 0, &mut recording);
        let turn = CameraTurn::that_gathers(self.config, 0);
        self.end(turn, self.config.photons, &mut recording);
        recording
    }

    /// The stages before an iteration's photons.
    pub(super) fn begin(&self, iteration: u32, recording: &mut Recording) {
        let (order, _) = self.method();
        if self.config.finds_visible_points(iteration) {
            let turn = CameraTurn::that_gathers(self.config, iteration);
            self.camera(turn, recording);
            order(self.sizes, recording);
        }
        self.radii(recording);
        self.demand(iteration, recording);
    }

    /// A batch of an iteration's photons.
    pub(super) fn batch(&self, iteration: u32, batch: u32, recording: &mut Recording) {
        let (_, gather) = self.method();
        self.photons(iteration, batch, recording);
        gather(self.sizes, recording);
    }

    /// The stages after an iteration's photons; `photons` is the number of paths.
    pub(super) fn end(&self, turn: CameraTurn, photons: u32, recording: &mut Recording) {
        let iteration = turn.iteration;
        let through_glass = self.features.dielectric && self.config.samples_behind_glass(iteration);
        self.direct(turn, through_glass, recording);
        // The paper has no such correction.
        if self.config.estimator == Estimator::Sppm {
            recording.dispatch(self.ray_stage(&shaders::COVERAGE, self.sizes.receivers()).push(
                shaders::CoveragePush {
                    iteration,
                    points: self.config.coverage_points(iteration),
                },
            ));
        }
        recording.dispatch(
            StageDesc::new(&shaders::UPDATE, self.sizes.slots())
                .push(shaders::UpdatePush {
                    photons: photons as f32,
                })
                .bind(vec![sums_of(iteration)]),
        );
        // After the photons, because an iteration that has to be repeated must stop before it adds anything.
        if self.config.layers.show_surfaces() && self.config.finds_visible_points(iteration) {
            recording.dispatch(
                self.ray_stage(&shaders::LAYERS, self.sizes.region.slots())
                    .push(shaders::CameraTurnPush::from(turn)),
            );
        }
        for turn in turn.others() {
            self.camera(turn, recording);
            self.direct(turn, false, recording);
        }
    }

    /// The commands that make the picture.
    pub fn film(&self, totals: Totals) -> Recording {
        let mut recording = reporting();
        let Totals {
            iterations,
            emitted,
            camera_paths,
        } = totals.at_least_one();
        let push = shaders::ResolvePush {
            iterations,
            emitted: emitted as f32,
            camera_paths,
        };
        recording.dispatch(
            StageDesc::new(&shaders::RESOLVE, self.sizes.pixel_slots)
                .constant("LIGHT_PARTS", u32::from(self.config.layers.show_light()))
                .push(push),
        );
        recording
    }

    /// The same, and the pictures of the sequences.
    pub fn picture(&self, totals: Totals) -> Recording {
        let mut recording = self.film(totals);
        let iterations = totals.at_least_one().iterations;
        for (sequence, (sums, film)) in (0..).zip(SEQUENCE_SUMS.into_iter().zip(SEQUENCE_FILMS)) {
            recording.dispatch(
                StageDesc::new(&shaders::RESOLVE_SEQUENCE, self.sizes.region.slots())
                    .push(shaders::ResolveSequencePush {
                        iterations: iterations_of(sequence, iterations),
                    })
                    .bind(vec![(BufferId::SequenceSums, sums), (BufferId::SequenceFilm, film)]),
            );
        }
        recording
    }

    /// The gather method's functions that record stages for new visible points, and for a batch of photons.
    pub(super) fn method(&self) -> (Record, Record) {
        method_stages(self.config.gather.unwrap_or_else(default_method))
    }

    /// Finds visible points, by one of the camera paths of each pixel.
    pub(super) fn camera(&self, turn: CameraTurn, recording: &mut Recording) {
        recording.dispatch(
            self.ray_stage(&shaders::CAMERA, self.sizes.pixel_slots)
                .push(shaders::CameraTurnPush::from(turn)),
        );
    }

    /// Direct light at the visible points. `through_glass`: whether light behind glass is estimated.
    fn direct(&self, turn: CameraTurn, through_glass: bool, recording: &mut Recording) {
        recording.dispatch(
            self.ray_stage(&shaders::DIRECT, self.sizes.slots())
                .constant("BEHIND_GLASS", u32::from(through_glass))
                .push(shaders::CameraTurnPush::from(turn))
                .bind(vec![sums_of(turn.iteration)]),
        );
    }

    /// The radii of the visible points, and grids of suitable cell sizes.
    pub(super) fn radii(&self, recording: &mut Recording) {
        recording.dispatch(StageDesc::new(&shaders::RADII, self.sizes.receivers()));
        grid_sizes(self.sizes, recording);
    }

    /// The demand of the visible points, after this number of iterations. The paper keeps all photons.
    pub(super) fn demand(&self, iterations: u32, recording: &mut Recording) {
        self.demand_of(false, iterations, recording);
    }

    /// The demand of guides alone.
    pub(super) fn demand_of_guides(&self, recording: &mut Recording) {
        self.demand_of(true, 0, recording);
    }

    fn demand_of(&self, guides: bool, iterations: u32, recording: &mut Recording) {
        if self.config.drops_unwanted() {
            let emitted = u64::from(iterations) * u64::from(self.config.photons);
            let push = shaders::DemandPush {
                iterations,
                emitted: emitted as f32,
                of_guides: u32::from(guides),
            };
            recording.fill(BufferId::Demand, 0);
            recording.dispatch(StageDesc::new(&shaders::DEMAND, self.sizes.receivers()).push(push));
        }
    }

    /// Traces the photons of a batch, and joins the regions of lanes.
    pub(super) fn photons(&self, iteration: u32, batch: u32, recording: &mut Recording) {
        let first = batch * self.sizes.batch_paths;
        let paths = self.sizes.batch_paths.min(self.config.photons - first);
        self.trace_paths(iteration, first..first + paths, recording);
        scan(BufferId::LaneOffsets, self.sizes.photon_lanes, recording);
        recording.dispatch(StageDesc::new(&shaders::COMPACT, self.sizes.lane_photons()));
    }

    /// Traces a range of paths of an iteration.
    pub(super) fn trace_paths(&self, iteration: u32, paths: Range<u32>, recording: &mut Recording) {
        let lanes = self.sizes.photon_lanes;
        let push = shaders::PathsPush {
            iteration,
            block: self.config.block_of(iteration),
            first_of_sequence: self.config.first_of_sequence(iteration),
            first_path: paths.start,
            path_count: paths.len() as u32,
        };
        recording.dispatch(self.ray_stage(&shaders::EMISSION, paths.len() as u32).push(push));
        recording.dispatch(self.ray_stage(&shaders::PHOTONS, lanes).push(push));
    }

    /// A stage that traces rays.
    fn ray_stage(&self, shader: &'static Shader, threads: u32) -> StageDesc {
        let mut constants = vec![
            ("BRUTE_FORCE", u32::from(self.config.accel == Accel::Brute)),
            (RAY_QUERY, u32::from(self.config.accel == Accel::RayQuery)),
            ("HAVEL", u32::from(self.config.triangle_test == TriangleTest::Havel)),
            ("SAMPLER", self.config.sampler as u32),
            ("SLOTS", self.sizes.slots_per_pixel),
            ("JITTER", u32::from(self.config.estimator == Estimator::Sppm)),
            ("FILTERED", u32::from(self.config.filter != PixelFilter::Box)),
            ("DROP_UNWANTED", u32::from(self.config.drops_unwanted())),
            ("AIMED", u32::from(self.sizes.aimed)),
            ("SAMPLE_LIGHTS", u32::from(self.config.direct == Direct::Light)),
        ];
        constants.extend(
            self.features
                .constants()
                .map(|(name, present)| (name, u32::from(present))),
        );
        StageDesc::new(shader, threads).constants(constants)
    }
}
