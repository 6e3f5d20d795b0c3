//! The iterations of a render, until they end or one fails.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::rendered::About;
use super::{Failure, Hooks, Progress, Rendered, Snapshot, State, Until, Wanted};
use crate::backend::{Backend, Counters, Resolved};
use crate::error::{Error, Result};
use crate::estimate::ErrorEstimate;
use crate::report::{Profile, StageTimes};

/// A picture is kept for the case that a later iteration loses the device. This is the share of time that making it may take.
const KEEPING: f64 = 0.01;

/// The parameters of the work.
pub struct Work<'a> {
    /// Limits.
    pub until: Until,
    /// Callbacks of the caller.
    pub hooks: &'a Hooks<'a>,
    /// What it renders.
    pub about: &'a About,
}

/// The result.
pub struct Done {
    /// The picture.
    pub picture: Arc<Resolved>,
    /// Counters of the render.
    pub counters: Counters,
    /// Iterations in it.
    pub iterations: u32,
    /// Photon paths in it.
    pub emitted: u64,
    /// Seconds that it took.
    pub seconds: f64,
    /// Total time, including iterations that are not in the picture.
    pub time: Duration,
    /// Launches of all iterations.
    pub profile: Profile,
    /// The failure that ended the render early.
    pub failure: Option<Failure>,
}

/// An intermediate picture.
struct Kept {
    picture: Arc<Resolved>,
    counters: Counters,
    iterations: u32,
    emitted: u64,
    /// Rendering time in seconds.
    seconds: f64,
    at: Instant,
    /// Time that making it took.
    cost: Duration,
}

impl Kept {
    /// The picture so far of a render that began at `start`.
    fn make(backend: &mut dyn Backend, start: Instant) -> Result<Self> {
        let begin = Instant::now();
        let picture = backend.resolve_all()?.into();
        Ok(Self {
            picture,
            counters: backend.counters(),
            iterations: backend.iterations(),
            emitted: backend.emitted(),
            seconds: (begin - start).as_secs_f64(),
            at: Instant::now(),
            cost: begin.elapsed(),
        })
    }

    /// As the result of a render that ended with it.
    fn done(&self, time: Duration) -> Done {
        Done {
            picture: self.picture.clone(),
            counters: self.counters,
            iterations: self.iterations,
            emitted: self.emitted,
            seconds: self.seconds,
            time,
            profile: Profile::default(),
            failure: None,
        }
    }

    fn is_old(&self) -> bool {
        self.at.elapsed().as_secs_f64() * KEEPING > self.cost.as_secs_f64()
    }
}

impl Work<'_> {
    /// Renders.
    ///
    /// # Errors
    /// Any failure before the first picture. Later failures are returned with the picture of the iterations before.
    pub fn run(&self, backend: &mut dyn Backend) -> Result<Done> {
        let start = Instant::now();
        let stopped = self.hooks.stop;
        let done = |backend: &dyn Backend, error| self.until.done(backend.iterations(), start.elapsed(), error);
        let stop = || stopped() || self.until.time.is_some_and(|time| start.elapsed() >= time);
        let mut profile = Profile::default();
        let mut stages = StageTimes::default();
        let mut kept: Option<Kept> = None;
        let mut error = None;
        let mut failure = None;
        let mut has_begun = false;
        // There is always a picture, however short the time; iterations that were submitted ahead are completed.
        while backend.iterations() == 0 || has_begun || !(stopped() || done(backend, error) >= 1.0) {
            let began = start.elapsed();
            let next = backend.iterations() + 1;
            let is_due = ErrorEstimate::is_due(next);
            let is_last = self.until.iterations.is_some_and(|most| next >= most);
            let wanted = self.hooks.snapshots.as_ref().and_then(|snapshots| (snapshots.wanted)());
            let is_wanted = wanted >= Some(Wanted::Picture);
            let another = !(is_due || is_last || is_wanted || stop() || kept.as_ref().is_none_or(Kept::is_old));
            has_begun = another;
            let run = if another {
                backend.iterate_before_another(&stop)
            } else {
                backend.iterate_unless(&stop)
            };
            let run = run.and_then(|run| {
                let iterations = backend.iterations();
                let is_needed = is_due || kept.as_ref().is_none_or(Kept::is_old);
                if let Some(run) = &run
                    && self.hooks.snapshots.is_some()
                {
                    stages.add(run);
                }
                if run.is_some() && !another && (is_needed || is_wanted) {
                    let made = Kept::make(backend, start)?;
                    let cost = if is_needed { Duration::ZERO } else { made.cost };
                    if is_due {
                        let estimate = self.about.estimate;
                        error = estimate.relative(iterations, &made.picture).map(|error| error.total);
                    }
                    if let Some(wanted) = wanted {
                        let begin = Instant::now();
                        let state = self.state_if(wanted, backend, &made, start.elapsed())?;
                        self.give(Snapshot {
                            rendered: Rendered::new(self.about, made.done(start.elapsed())).into(),
                            state,
                            stages: stages.clone(),
                            cost: cost + begin.elapsed(),
                        });
                    }
                    kept = Some(made);
                }
                Ok(run)
            });
            match run {
                Ok(Some(run)) if self.hooks.profile => profile.add(began, run),
                Ok(Some(_)) => {}
                Ok(None) => break,
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            }
            (self.hooks.progress)(Progress {
                iterations: backend.iterations(),
                photons_emitted: backend.emitted(),
                error,
                done: done(backend, error),
            });
        }
        let at_end = if kept
            .as_ref()
            .is_some_and(|kept| kept.iterations == backend.iterations())
        {
            Ok(())
        } else {
            Kept::make(backend, start).map(|made| kept = Some(made))
        };
        let failure = failure.or(at_end.err());
        let Some(kept) = kept.filter(|kept| kept.iterations > 0) else {
            return Err(failure.unwrap_or_else(|| Error::Device("no iteration was done".to_owned())));
        };
        let failure = failure.map(|error| Failure {
            error,
            iteration: backend.iterations() + 1,
            kept: kept.iterations,
        });
        Ok(Done {
            profile,
            failure,
            ..kept.done(start.elapsed())
        })
    }

    /// The state of a snapshot that is made after this time.
    fn state_if(
        &self,
        wanted: Wanted,
        backend: &mut dyn Backend,
        made: &Kept,
        time: Duration,
    ) -> Result<Option<Arc<State>>> {
        if wanted < Wanted::State {
            return Ok(None);
        }
        let state = State::of(self.about, backend, Some(&made.picture), self.about.spent + time)?;
        Ok(Some(state.into()))
    }

    fn give(&self, snapshot: Snapshot) {
        if let Some(snapshots) = &self.hooks.snapshots {
            (snapshots.take)(snapshot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{DeviceDescription, Figures};
    use crate::config::Totals;
    use crate::layout::BehindGlass;
    use crate::record::Run;
    use crate::session::Snapshots;
    use crate::state::Blocks;
    use bytemuck::Zeroable as _;
    use std::cell::RefCell;

    /// A device that is lost in an iteration, and whose pictures are as bright as it has done iterations.
    struct Lost {
        figures: Figures,
        lost_in: u32,
        is_lost: bool,
        /// Whether its memory can still be read.
        is_readable: bool,
        /// Time that a picture takes.
        resolving: Duration,
    }

    fn lost_in(iteration: u32, is_readable: bool) -> Lost {
        Lost {
            figures: Figures::default(),
            lost_in: iteration,
            is_lost: false,
            is_readable,
            resolving: Duration::ZERO,
        }
    }

    impl Backend for Lost {
        fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
            if self.iterations() + 1 == self.lost_in {
                self.is_lost = true;
                return Err(Error::Device("the device is lost".to_owned()));
            }
            if self.iterations() > 0 && stop() {
                return Ok(None);
            }
            self.figures.totals.add(Totals {
                iterations: 1,
                emitted: 10,
                camera_paths: 1,
            });
            Ok(Some(Run::default()))
        }

        fn resolve_all(&mut self) -> Result<Resolved> {
            if self.is_lost && !self.is_readable {
                return Err(Error::Device("the device is lost".to_owned()));
            }
            std::thread::sleep(self.resolving);
            let pixel = [self.iterations() as f32; 4];
            Ok(Resolved::from_film(
                [1, 1],
                &[pixel],
                vec![BehindGlass::zeroed()],
                vec![pixel; 4],
            ))
        }

        fn save(&mut self) -> Result<Blocks> {
            let mut blocks = Blocks::default();
            blocks.put("iterations", &self.iterations())?;
            Ok(blocks)
        }

        fn restore(&mut self, learned: &Blocks) -> Result<()> {
            self.figures.totals.iterations = learned.get("iterations")?;
            Ok(())
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
                name: String::new(),
                driver: String::new(),
                timestamp_period_ns: 1.0,
            }
        }
    }

    fn run(device: &mut Lost, until: Until, stop: &dyn Fn() -> bool) -> Result<Done> {
        let hooks = Hooks {
            stop,
            ..Hooks::default()
        };
        let work = Work {
            until,
            about: &About::of_nothing(),
            hooks: &hooks,
        };
        work.run(device)
    }

    fn twenty(device: &mut Lost) -> Result<Done> {
        run(device, Until::iterations(20), &|| false)
    }

    #[test]
    fn an_iteration_that_fails_leaves_the_picture_of_those_before() {
        for is_readable in [true, false] {
            let done =
                twenty(&mut lost_in(9, is_readable)).unwrap_or_else(|error| panic!("readable: {is_readable}: {error}"));
            assert_eq!((done.iterations, done.emitted), (8, 80));
            assert_eq!(done.picture.image.pixels(), [[8.0; 3]]);
            let failure = done.failure.expect("what failed");
            assert_eq!((failure.iteration, failure.kept), (9, 8));
            let text = failure.to_string();
            assert!(
                text.contains("the device is lost") && text.contains("iteration 9") && text.contains("first 8"),
                "{text}"
            );
        }
    }

    #[test]
    fn a_picture_is_kept_from_the_first_iteration_on() {
        assert_eq!(twenty(&mut lost_in(2, false)).expect("a picture").iterations, 1);
        let error = twenty(&mut lost_in(1, false)).err().expect("an error").to_string();
        assert!(error.contains("the device is lost"), "{error}");
    }

    #[test]
    fn one_iteration_is_done_however_soon_the_user_asks_to_stop() {
        let done = run(&mut lost_in(9, true), Until::iterations(20), &|| true);
        assert_eq!(done.expect("a picture").iterations, 1);
        let done = run(&mut lost_in(9, true), Until::time(Duration::from_nanos(1)), &|| false);
        assert_eq!(done.expect("a picture").iterations, 1);
    }

    #[test]
    fn snapshots_are_pictures_and_states_of_the_same_iterations() {
        let taken = RefCell::new(Vec::new());
        let hooks = Hooks {
            snapshots: Some(Snapshots {
                wanted: &|| Some(Wanted::State),
                take: &|snapshot| {
                    let iterations = snapshot.state.expect("a state").blocks.get::<u32>("iterations");
                    taken
                        .borrow_mut()
                        .push((snapshot.rendered.iterations(), iterations.expect("a number")));
                },
            }),
            ..Hooks::default()
        };
        let work = Work {
            until: Until::iterations(3),
            about: &About::of_nothing(),
            hooks: &hooks,
        };
        work.run(&mut lost_in(u32::MAX, true)).expect("a picture");
        assert_eq!(taken.into_inner(), [(1, 1), (2, 2), (3, 3)]);
    }

    #[test]
    fn spare_snapshots_are_those_of_pictures_that_are_made_anyway() {
        let taken = RefCell::new(Vec::new());
        let hooks = Hooks {
            snapshots: Some(Snapshots {
                wanted: &|| Some(Wanted::Spare),
                take: &|snapshot| {
                    assert!(snapshot.state.is_none() && snapshot.cost < Duration::from_millis(50));
                    taken.borrow_mut().push(snapshot.rendered.iterations());
                },
            }),
            ..Hooks::default()
        };
        let work = Work {
            until: Until::iterations(10),
            about: &About::of_nothing(),
            hooks: &hooks,
        };
        // Pictures so slow that the first one is kept until an error is due.
        let mut device = Lost {
            resolving: Duration::from_millis(50),
            ..lost_in(u32::MAX, true)
        };
        work.run(&mut device).expect("a picture");
        assert_eq!(taken.into_inner(), [1, 4, 8]);
    }

    #[test]
    fn a_render_goes_on_where_it_ended() {
        let mut device = lost_in(u32::MAX, true);
        assert_eq!(twenty(&mut device).expect("a picture").iterations, 20);
        let more = run(&mut device, Until::iterations(23), &|| false).expect("a picture");
        assert_eq!((more.iterations, device.iterations()), (23, 23));
    }
}
