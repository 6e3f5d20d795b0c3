//! The growth of gathering costs with photons, visible points and radius.

use serde::Serialize;

use super::gather::GatherBench;
use super::{log_slope, median, stages_of};
use ppm_vk::internals::gather::METHODS;
use ppm_vk::internals::sizes::Probe;
use ppm_vk::{DeviceDescription, Error, RenderConfig, Result, Run, Session};

/// Photon paths of an iteration.
const PHOTONS: [u32; 7] = [10_000, 31_623, 100_000, 316_228, 1_000_000, 3_162_278, 10_000_000];
/// Factors of the picture's sides.
const SIDES: [f64; 5] = [0.5, 1.0, 2.0, 3.5, 5.0];
/// Factors of the radius.
const RADII: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Maximum number of photon paths for which several iterations are measured.
const REPEATED: u32 = 400_000;

/// Costs of some methods.
#[derive(Debug, Clone, Serialize)]
pub struct Scaling {
    /// The device.
    pub device: DeviceDescription,
    /// One for each method and quantity.
    pub series: Vec<Series>,
}

/// A method's cost against a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// The method's name.
    pub method: &'static str,
    /// The varied quantity.
    pub against: &'static str,
    /// In growing order.
    pub points: Vec<Point>,
    /// Slope of the line through the points, in logarithms, by least squares.
    pub slope: Option<f64>,
}

/// A measured cost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// The quantity.
    pub x: f64,
    /// Microseconds of building and gathering in an iteration.
    pub cost_us: f64,
}

/// Measures the cost of the methods that test nearby photons only, at the first resolution, with the automatic radius of that
/// resolution. Photon paths go up to `most_photons`.
///
/// # Errors
/// Errors of a render.
pub fn scaling(bench: &GatherBench, most_photons: u32, note: &dyn Fn(&str)) -> Result<Scaling> {
    let [width, height] = *bench
        .resolutions
        .first()
        .ok_or_else(|| Error::Config("no resolution to measure".to_owned()))?;
    let session = bench.session([width, height])?;
    let device = session.device();
    let radius = bench.config.radius.unwrap_or(session.radius());
    drop(session);
    let near = |method: &usize| METHODS[*method].looks_nearby();
    let methods: Vec<usize> = bench.methods.iter().copied().filter(near).collect();
    if methods.is_empty() {
        return Err(Error::Config(
            "--scaling: none of these --methods tests nearby photons only; try clustered or cluster-grid".to_owned(),
        ));
    }
    let mut series = Vec::new();
    for method in methods {
        let at = |resolution: [u32; 2], photons: u32, radius: f64| RenderConfig {
            resolution,
            photons,
            radius: Some(radius),
            gather: Some(method),
            ..bench.config.clone()
        };
        let here = [width, height];
        let photons = PHOTONS.into_iter().filter(|&photons| photons <= most_photons);
        let photons = photons.map(|photons| (f64::from(photons), at(here, photons, radius)));
        let points = SIDES.map(|factor| {
            let resolution = here.map(|side| ((f64::from(side) * factor).round() as u32).max(1));
            let pixels = f64::from(resolution[0]) * f64::from(resolution[1]);
            (pixels, at(resolution, bench.config.photons, radius))
        });
        let radii = RADII.map(|factor| {
            let share = factor * factor;
            (share * 100.0, at(here, bench.config.photons, radius * factor))
        });
        for (against, configs) in [
            ("photon paths", photons.collect::<Vec<_>>()),
            ("pixels", points.to_vec()),
            ("area within the radius, % of the automatic", radii.to_vec()),
        ] {
            let mut line = Series {
                method: METHODS[method].name,
                against,
                points: Vec::new(),
                slope: None,
            };
            for (x, config) in configs {
                note(&format!("{}: {against} {x:.0}", METHODS[method].name));
                line.points.push(Point {
                    x,
                    cost_us: cost_us(bench, config)?,
                });
            }
            line.slope = log_slope(line.points.iter().map(|point| (point.x, point.cost_us)));
            series.push(line);
        }
    }
    Ok(Scaling { device, series })
}

/// Microseconds of building and gathering in the first iteration.
fn cost_us(bench: &GatherBench, config: RenderConfig) -> Result<f64> {
    let repeats = if config.photons > REPEATED { 1 } else { bench.repeats };
    let mut times = Vec::new();
    // The first one is a warm-up; each is a separate render, whose radii have not shrunk.
    for repeat in 0..=repeats {
        if repeat == 0 && repeats == 1 {
            continue;
        }
        let mut session = Session::new(bench.scene, bench.camera, &config, &bench.platform)?;
        let renderer = stages_of(&mut session)?;
        // So that photon buffers are fitted and kernels are compiled.
        renderer.trace()?;
        if let Some(method) = config.gather {
            renderer.trace()?;
            renderer.gather(method, Probe::default())?;
        }
        times.push(gather_us(&session.iterate(&|| false)?.unwrap_or_default()));
    }
    let warm = usize::from(times.len() > 1);
    Ok(median(times.split_off(warm)))
}

/// Microseconds of an iteration's launches after `compact`, up to the end of the gather.
fn gather_us(run: &Run) -> f64 {
    let mut gathering = false;
    let mut us = 0.0;
    for launch in &run.launches {
        match launch.stage {
            "camera" | "photons" | "direct" => gathering = false,
            "compact" => {
                gathering = true;
                continue;
            }
            _ => (),
        }
        if gathering {
            us += launch.duration_ns * 1e-3;
        }
    }
    us
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_building_and_gathering_counts() {
        let launch = |stage, us: f64| ppm_vk::internals::record::Launch {
            stage,
            begin_ns: 0.0,
            duration_ns: us * 1e3,
        };
        let batch = [
            launch("photons", 1.0),
            launch("scan_blocks", 2.0),
            launch("compact", 4.0),
            launch("scan_blocks", 8.0),
            launch("gather_clustered", 16.0),
        ];
        let mut launches = vec![launch("camera", 32.0)];
        launches.extend(batch);
        launches.extend(batch);
        launches.extend([launch("direct", 64.0), launch("update", 128.0)]);
        let run = Run {
            launches,
            ..Run::default()
        };
        assert_eq!(gather_us(&run), 48.0);
    }
}
