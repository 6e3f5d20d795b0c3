//! Profiles of stages: as a table, as JSON and as a Chrome trace.

use std::fmt::Write as _;
use std::time::Duration;

use serde::Serialize;
use serde_json::json;

use crate::backend::{Counters, DeviceDescription};
use crate::record::{Launch, Run};
use crate::text::escaped;

/// Every launch of a render, in order.
#[derive(Debug, Default)]
pub struct Profile {
    runs: Vec<Run>,
    /// Start of each, relative to the start of the render.
    begins: Vec<Duration>,
}

/// Gaps between iterations, in microseconds: the wall clock from one iteration's start to the next, minus the time in which the
/// device worked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gaps {
    /// The median gap.
    pub median_us: f64,
    /// Total, including pictures that were made in between.
    pub total_us: f64,
    /// Wall clock from the first iteration's start to the last one's.
    pub wall_us: f64,
}

/// Statistics of the launches of one stage, in microseconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageProfile {
    /// The stage.
    pub stage: &'static str,
    /// Number of launches.
    pub launches: usize,
    /// The shortest launch.
    pub min_us: f64,
    /// The median launch.
    pub median_us: f64,
    /// The 95th percentile.
    pub p95_us: f64,
    /// All launches together.
    pub total_us: f64,
    /// Share of the time of all stages.
    pub share: f64,
}

/// The subject of a profile.
#[derive(Debug, Clone, Serialize)]
pub struct Subject {
    /// The scene's name.
    pub scene: String,
    /// Pixels, width and height.
    pub resolution: [u32; 2],
    /// Gather method.
    pub gather: String,
    /// Photon paths of an iteration.
    pub photons: u32,
    /// Photon paths of all iterations.
    pub photons_emitted: u64,
    /// The device.
    pub device: DeviceDescription,
    /// Counters.
    pub counters: Counters,
}

/// The total times of stages, in the order of their first launch: unlike a [`Profile`], they take little memory in long renders.
#[derive(Debug, Clone, Default)]
pub struct StageTimes(Vec<StageTime>);

/// The total time of a stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageTime {
    /// The stage.
    pub stage: &'static str,
    /// Number of launches.
    pub launches: u64,
    /// All launches together, in microseconds.
    pub total_us: f64,
}

impl StageTimes {
    /// Adds the launches of an iteration.
    pub fn add(&mut self, run: &Run) {
        for Launch { stage, duration_ns, .. } in &run.launches {
            let at = self.0.iter().position(|time| time.stage == *stage).unwrap_or_else(|| {
                self.0.push(StageTime {
                    stage,
                    launches: 0,
                    total_us: 0.0,
                });
                self.0.len() - 1
            });
            self.0[at].launches += 1;
            self.0[at].total_us += duration_ns * 1e-3;
        }
    }

    /// The stages.
    pub fn stages(&self) -> &[StageTime] {
        &self.0
    }
}

impl Profile {
    /// Adds an iteration that began at this time after the start of the render.
    pub fn add(&mut self, began: Duration, run: Run) {
        self.begins.push(began);
        self.runs.push(run);
    }

    /// Adds the iterations of a render that followed.
    pub fn append(&mut self, other: Self) {
        let before = self.begins.last().copied().unwrap_or_default();
        self.begins.extend(other.begins.into_iter().map(|begin| before + begin));
        self.runs.extend(other.runs);
    }

    /// Wall-clock time from each submission to its end, summed.
    pub fn wall(&self) -> Duration {
        self.runs.iter().map(|run| run.wall).sum()
    }

    /// The host's gaps between iterations; `None` for a single iteration.
    pub fn gaps(&self) -> Option<Gaps> {
        let walls = self.begins.windows(2).map(|pair| us(pair[1].saturating_sub(pair[0])));
        // An iteration that was submitted ahead may have less wall clock than work.
        let mut gaps: Vec<f64> = walls.zip(&self.runs).map(|(wall, run)| wall - busy_us(run)).collect();
        gaps.sort_by(f64::total_cmp);
        let (first, last) = (self.begins.first()?, self.begins.last()?);
        (!gaps.is_empty()).then(|| Gaps {
            median_us: quantile(&gaps, 0.5),
            total_us: gaps.iter().sum(),
            wall_us: us(last.saturating_sub(*first)),
        })
    }

    /// The stages in the order of their first launch.
    pub fn stages(&self) -> Vec<StageProfile> {
        let mut durations: Vec<(&'static str, Vec<f64>)> = Vec::new();
        for Launch { stage, duration_ns, .. } in self.runs.iter().flat_map(|run| &run.launches) {
            let us = duration_ns * 1e-3;
            match durations.iter_mut().find(|(name, _)| name == stage) {
                Some((_, times)) => times.push(us),
                None => durations.push((stage, vec![us])),
            }
        }
        let all: f64 = durations.iter().flat_map(|(_, times)| times).sum();
        durations
            .into_iter()
            .map(|(stage, mut times)| {
                times.sort_by(f64::total_cmp);
                let total_us: f64 = times.iter().sum();
                StageProfile {
                    stage,
                    launches: times.len(),
                    min_us: times[0],
                    median_us: quantile(&times, 0.5),
                    p95_us: quantile(&times, 0.95),
                    total_us,
                    share: total_us / all,
                }
            })
            .collect()
    }

    /// A table of the stages for people.
    pub fn table(&self, subject: &Subject) -> String {
        let stages = self.stages();
        let stages_us: f64 = stages.iter().map(|stage| stage.total_us).sum();
        let wall_us = us(self.wall());
        let [width, height] = subject.resolution;
        let mut text = format!(
            "{} at {width}x{height}, {} photon paths per iteration, gather {}\non {} ({}), timestamps of {} ns\n\n",
            escaped(&subject.scene),
            subject.photons,
            subject.gather,
            escaped(&subject.device.name),
            escaped(&subject.device.driver),
            subject.device.timestamp_period_ns
        );
        let mut line = |cells: [&str; 7]| {
            let [stage, launches, min, median, p95, total, share] = cells;
            // Writing to a String can't fail.
            let _ = writeln!(
                text,
                "{stage:<16} {launches:>8} {min:>12} {median:>12} {p95:>12} {total:>14} {share:>8}"
            );
        };
        line([
            "stage",
            "launches",
            "min µs",
            "median µs",
            "p95 µs",
            "total µs",
            "share",
        ]);
        for stage in &stages {
            line([
                stage.stage,
                &stage.launches.to_string(),
                &format!("{:.1}", stage.min_us),
                &format!("{:.1}", stage.median_us),
                &format!("{:.1}", stage.p95_us),
                &format!("{:.1}", stage.total_us),
                &format!("{:.1} %", 100.0 * stage.share),
            ]);
        }
        let _ = writeln!(
            text,
            "\nall stages {stages_us:.1} µs, submissions {wall_us:.1} µs of wall clock ({:.1} % of it in stages), {} iterations\n\
             {} photon paths, {}",
            100.0 * stages_us / wall_us,
            self.runs.len(),
            subject.photons_emitted,
            subject.counters.photons()
        );
        if let Some(gaps) = self.gaps() {
            let _ = writeln!(
                text,
                "between iterations the device had no work for {:.1} µs (median), {:.1} µs in all, of {:.1} µs from the first \
                 iteration's start to the last one's",
                gaps.median_us, gaps.total_us, gaps.wall_us
            );
        }
        text
    }

    /// The same as JSON. Keys that end in `_us` are microseconds.
    pub fn json(&self, subject: &Subject) -> serde_json::Value {
        let stages = self.stages();
        json!({
            "subject": subject,
            "iterations": self.runs.len(),
            "stages_us": stages.iter().map(|stage| stage.total_us).sum::<f64>(),
            "submissions_us": us(self.wall()),
            "gaps": self.gaps(),
            "stages": stages,
        })
    }

    /// Every launch as an event of the Chrome trace format, which Perfetto reads too.
    pub fn trace(&self, subject: &Subject) -> serde_json::Value {
        let launches = || {
            self.runs
                .iter()
                .enumerate()
                .flat_map(|(i, run)| run.launches.iter().map(move |l| (i, l)))
        };
        let origin = launches()
            .map(|(_, launch)| launch.begin_ns)
            .fold(f64::INFINITY, f64::min);
        let events: Vec<_> = launches()
            .map(|(iteration, launch)| {
                json!({
                    "name": launch.stage,
                    "cat": "stage",
                    "ph": "X",
                    "ts": (launch.begin_ns - origin) * 1e-3,
                    "dur": launch.duration_ns * 1e-3,
                    "pid": 1,
                    "tid": 1,
                    "args": { "iteration": iteration },
                })
            })
            .collect();
        json!({ "traceEvents": events, "displayTimeUnit": "ns", "otherData": subject })
    }
}

fn us(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e6
}

/// Time in which at least one launch ran, in microseconds: some run in parallel.
fn busy_us(run: &Run) -> f64 {
    let mut spans: Vec<[f64; 2]> = run
        .launches
        .iter()
        .map(|launch| [launch.begin_ns, launch.begin_ns + launch.duration_ns])
        .collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut end = f64::NEG_INFINITY;
    let mut busy = 0.0;
    for [from, to] in spans {
        busy += (to - from.max(end)).max(0.0);
        end = end.max(to);
    }
    busy * 1e-3
}

/// The quantile `q` of sorted values.
fn quantile(sorted: &[f64], q: f64) -> f64 {
    let rank = (q * sorted.len() as f64).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile() -> Profile {
        let mut profile = Profile::default();
        for i in 1..=20u32 {
            let launch = |stage, begin, us: u32| Launch {
                stage,
                begin_ns: f64::from(begin),
                duration_ns: f64::from(us) * 1e3,
            };
            let run = Run {
                launches: vec![
                    launch("camera", i * 1_000_000, i),
                    launch("photons", i * 1_000_000 + 500_000, 30),
                ],
                wall: Duration::from_micros(u64::from(i) + 30),
            };
            profile.add(Duration::from_micros(u64::from(i) * 1000), run);
        }
        profile
    }

    #[test]
    fn stages_have_their_order_statistics() {
        let stages = profile().stages();
        assert_eq!(
            stages.iter().map(|stage| stage.stage).collect::<Vec<_>>(),
            ["camera", "photons"]
        );
        let camera = &stages[0];
        assert_eq!(
            (camera.launches, camera.min_us, camera.median_us, camera.p95_us),
            (20, 1.0, 10.0, 19.0)
        );
        assert_eq!(camera.total_us, 210.0);
        assert!((camera.share - 210.0 / 810.0).abs() < 1e-12);
    }

    #[test]
    fn a_gap_is_what_the_device_did_not_work_from_one_iteration_to_the_next() {
        let gaps = profile().gaps().expect("gaps");
        // Iteration i works for i and 30 of 1,000 µs; the last one has no next.
        let all: Vec<f64> = (1..20).map(|i| 970.0 - f64::from(i)).collect();
        let close = |found: f64, expected: f64| (found - expected).abs() < 1e-6;
        assert!(close(gaps.median_us, 960.0), "{gaps:?}");
        assert!(close(gaps.total_us, all.iter().sum()), "{gaps:?}");
        assert!(close(gaps.wall_us, 19_000.0), "{gaps:?}");
        let mut one = Profile::default();
        one.add(Duration::ZERO, Run::default());
        assert_eq!(one.gaps(), None);
    }

    #[test]
    fn launches_side_by_side_are_no_longer_work_than_the_time_that_they_take_together() {
        let launch = |begin_ns, duration_ns| Launch {
            stage: "a",
            begin_ns,
            duration_ns,
        };
        let run = Run {
            launches: vec![launch(0.0, 4e3), launch(1e3, 2e3), launch(3e3, 3e3), launch(9e3, 1e3)],
            wall: Duration::ZERO,
        };
        assert!((busy_us(&run) - 7.0).abs() < 1e-9, "{}", busy_us(&run));
    }

    #[test]
    fn trace_has_every_launch_from_time_zero() {
        let subject = Subject {
            scene: "s".into(),
            resolution: [1, 1],
            gather: "naive".into(),
            photons: 1,
            photons_emitted: 20,
            device: DeviceDescription {
                name: "d".into(),
                driver: "v".into(),
                timestamp_period_ns: 1.0,
            },
            counters: Counters::default(),
        };
        let trace = profile().trace(&subject);
        let events = trace["traceEvents"].as_array().expect("events");
        assert_eq!(events.len(), 40);
        assert_eq!(events[0]["ts"], 0.0);
        assert_eq!(events[1]["dur"], 30.0);
    }
}
