//! The iterations of a render, until they end or one fails.

use std::time::{Duration, Instant};

use super::progress::Limits;
use crate::backend::{Backend, Resolved};
use crate::error::{Error, Result};
use crate::estimate::ErrorEstimate;
use crate::report::Profile;

/// A picture is kept, for the case that a later iteration loses the device, so often that this is the part of the time that it
/// takes.
const KEEPING: f64 = 0.01;

/// What there is to be done.
pub struct Work<'a> {
    /// When it ends.
    pub limits: Limits,
    /// How its error is told.
    pub estimate: ErrorEstimate,
    /// Whether the launches are kept.
    pub profiled: bool,
    /// Whether the user has asked to stop.
    pub asked: &'a dyn Fn() -> bool,
}

/// What was rendered.
pub struct Rendered {
    /// The picture.
    pub picture: Resolved,
    /// Iterations in it.
    pub iterations: u32,
    /// Photon paths in it.
    pub emitted: u64,
    /// Time that it took.
    pub seconds: f64,
    /// Launches of all iterations.
    pub profile: Profile,
    /// What ended the render too early.
    pub failure: Option<String>,
}

/// A picture on the way.
struct Kept {
    picture: Resolved,
    iterations: u32,
    emitted: u64,
    /// Rendering time in seconds.
    seconds: f64,
    at: Instant,
    /// Time that it took to be made.
    cost: Duration,
}

impl Kept {
    /// The picture so far of a render that began at `start`.
    fn make(backend: &mut dyn Backend, start: Instant) -> Result<Self> {
        let begin = Instant::now();
        let picture = backend.resolve_all()?;
        Ok(Self {
            picture,
            iterations: backend.iterations(),
            emitted: backend.emitted(),
            seconds: (begin - start).as_secs_f64(),
            at: Instant::now(),
            cost: begin.elapsed(),
        })
    }

    fn is_old(&self) -> bool {
        self.at.elapsed().as_secs_f64() * KEEPING > self.cost.as_secs_f64()
    }
}

impl Work<'_> {
    /// Renders; `show` is told how far it is after each iteration.
    ///
    /// # Errors
    /// What failed before there was a picture. Later failures are told beside the picture of the iterations before.
    pub fn run(&self, backend: &mut dyn Backend, show: &dyn Fn(&dyn Backend, Option<f64>)) -> Result<Rendered> {
        let start = Instant::now();
        let stop = || (self.asked)() || self.limits.time.is_some_and(|time| start.elapsed() >= time);
        let mut profile = Profile::default();
        let mut kept: Option<Kept> = None;
        let mut error = None;
        let mut failure = None;
        let mut has_begun = false;
        // However short the time, there is a picture; and what the device was given ahead is waited for.
        while backend.iterations() == 0
            || has_begun
            || !((self.asked)() || self.limits.done(backend.iterations(), start.elapsed(), error) >= 1.0)
        {
            let began = start.elapsed();
            let next = backend.iterations() + 1;
            let is_due = ErrorEstimate::is_due(next);
            let is_last = self.limits.iterations.is_some_and(|most| next >= most);
            let another = !(is_due || is_last || stop() || kept.as_ref().is_none_or(Kept::is_old));
            has_begun = another;
            let done = if another {
                backend.iterate_before_another(&stop)
            } else {
                backend.iterate_unless(&stop)
            };
            let done = done.and_then(|run| {
                let iterations = backend.iterations();
                if run.is_some() && !another && (is_due || kept.as_ref().is_none_or(Kept::is_old)) {
                    let made = Kept::make(backend, start)?;
                    if is_due {
                        error = self
                            .estimate
                            .relative(iterations, &made.picture)
                            .map(|error| error.total);
                    }
                    kept = Some(made);
                }
                Ok(run)
            });
            match done {
                // A day's launches are gigabytes.
                Ok(Some(run)) if self.profiled => profile.add(began, run),
                Ok(Some(_)) => {}
                Ok(None) => break,
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            }
            show(backend, error);
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
        let failure = failure.map(|error| {
            let (failed, before) = (backend.iterations() + 1, kept.iterations);
            format!("{error}: iteration {failed} failed, and the picture is that of the first {before}")
        });
        Ok(Rendered {
            picture: kept.picture,
            iterations: kept.iterations,
            emitted: kept.emitted,
            seconds: kept.seconds,
            profile,
            failure,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{Counters, DeviceDescription};
    use crate::config::RenderConfig;
    use crate::estimate::OnePhoton;
    use crate::layout::BehindGlass;
    use crate::record::Run;
    use bytemuck::Zeroable as _;
    use std::cell::Cell;

    /// A device that is lost in an iteration, and whose pictures are as bright as it has done iterations.
    struct Lost {
        iterations: u32,
        lost_in: u32,
        is_lost: bool,
        /// Whether its memory can still be read.
        is_readable: bool,
    }

    fn lost_in(iteration: u32, is_readable: bool) -> Lost {
        Lost {
            iterations: 0,
            lost_in: iteration,
            is_lost: false,
            is_readable,
        }
    }

    impl Backend for Lost {
        fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
            if self.iterations + 1 == self.lost_in {
                self.is_lost = true;
                return Err(Error::Device("the device is lost".to_owned()));
            }
            if self.iterations > 0 && stop() {
                return Ok(None);
            }
            self.iterations += 1;
            Ok(Some(Run::default()))
        }

        fn resolve_all(&mut self) -> Result<Resolved> {
            if self.is_lost && !self.is_readable {
                return Err(Error::Device("the device is lost".to_owned()));
            }
            let pixel = [self.iterations as f32; 4];
            Ok(Resolved::from_film(
                [1, 1],
                &[pixel],
                vec![BehindGlass::zeroed()],
                vec![pixel; 4],
            ))
        }

        fn iterations(&self) -> u32 {
            self.iterations
        }

        fn emitted(&self) -> u64 {
            10 * u64::from(self.iterations)
        }

        fn counters(&self) -> Counters {
            Counters::default()
        }

        fn radius(&self) -> f32 {
            1.0
        }

        fn photon_flux(&self) -> Option<f64> {
            None
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

    fn work(asked: &dyn Fn() -> bool) -> Work<'_> {
        Work {
            limits: Limits {
                iterations: Some(20),
                time: None,
                error: None,
            },
            estimate: ErrorEstimate::new(&RenderConfig::default(), OnePhoton::default()),
            profiled: false,
            asked,
        }
    }

    #[test]
    fn an_iteration_that_fails_leaves_the_picture_of_those_before() {
        for is_readable in [true, false] {
            let rendered = work(&|| false)
                .run(&mut lost_in(9, is_readable), &|_, _| ())
                .unwrap_or_else(|error| panic!("readable: {is_readable}: {error}"));
            assert_eq!((rendered.iterations, rendered.emitted), (8, 80));
            assert_eq!(rendered.picture.image.pixels(), [[8.0; 3]]);
            let failure = rendered.failure.expect("what failed");
            assert!(
                failure.contains("the device is lost")
                    && failure.contains("iteration 9")
                    && failure.contains("first 8"),
                "{failure}"
            );
        }
    }

    #[test]
    fn a_picture_is_kept_from_the_first_iteration_on() {
        let rendered = work(&|| false).run(&mut lost_in(2, false), &|_, _| ());
        assert_eq!(rendered.expect("a picture").iterations, 1);
        let error = work(&|| false).run(&mut lost_in(1, false), &|_, _| ());
        assert!(
            error
                .err()
                .expect("an error")
                .to_string()
                .contains("the device is lost")
        );
    }

    #[test]
    fn one_iteration_is_done_however_soon_the_user_asks_to_stop() {
        let asked = Cell::new(true);
        let rendered = work(&|| asked.get()).run(&mut lost_in(9, true), &|_, _| ());
        assert_eq!(rendered.expect("a picture").iterations, 1);
        let mut hurried = work(&|| false);
        hurried.limits.time = Some(Duration::from_nanos(1));
        assert_eq!(
            hurried
                .run(&mut lost_in(9, true), &|_, _| ())
                .expect("a picture")
                .iterations,
            1
        );
    }
}
