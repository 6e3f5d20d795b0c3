//! Error against time: the same scene with several settings, each compared with a reference as it goes.

use std::time::Instant;

use serde::Serialize;

use crate::backend::{Backend, DeviceDescription};
use crate::config::RenderConfig;
use crate::error::Result;
use crate::estimate::ErrorEstimate;
use crate::film::Image;
use crate::gpu::Device;
use crate::metrics::compare;
use crate::pipeline::Renderer;
use crate::scene::{Camera, PackedScene};

/// Iterations before which errors aren't taken for the fit: the radius has hardly moved.
const FIRST_FITTED: u32 = 4;

/// What is rendered, and for how long.
pub struct Converge<'a> {
    /// The scene.
    pub scene: &'a PackedScene,
    /// Its camera.
    pub camera: &'a Camera,
    /// Device, by index or a part of its name.
    pub device: Option<&'a str>,
    /// What the pictures should be; its size is theirs.
    pub reference: &'a Image,
    /// Seconds of rendering, for each setting.
    pub seconds: f64,
    /// Settings and their names.
    pub settings: Vec<(String, RenderConfig)>,
}

/// A setting's errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Its name.
    pub setting: String,
    /// After 1, 2, 4, … iterations.
    pub points: Vec<Measured>,
    /// Slope of log relMSE against log device seconds, by least squares, from the fourth iteration on.
    pub slope: f64,
}

/// Error after so many iterations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measured {
    /// Iterations.
    pub iterations: u32,
    /// Seconds that the device was busy.
    pub device_s: f64,
    /// Seconds on the clock, pictures and comparisons left out.
    pub wall_s: f64,
    /// relMSE.
    pub rel_mse: f64,
    /// RMSE, in units of radiance.
    pub rmse: f64,
    /// The picture's mean over the reference's.
    pub mean_ratio: [f64; 3],
    /// Root of relMSE as the render estimates it by itself.
    pub estimated_error: Option<f64>,
    /// 1 / (relMSE · device seconds).
    pub efficiency: f64,
}

/// All curves.
#[derive(Debug, Clone, Serialize)]
pub struct Convergence {
    /// Where.
    pub device: DeviceDescription,
    /// One for each setting.
    pub curves: Vec<Curve>,
}

/// Renders with each setting; `note` hears what it is doing.
///
/// # Errors
/// Whatever a render can meet.
pub fn converge(what: &Converge, note: &dyn Fn(&str)) -> Result<Convergence> {
    let mut device = None;
    let mut curves = Vec::new();
    for (name, config) in &what.settings {
        note(name);
        let mut renderer = Renderer::new(Device::open(what.device)?, what.scene, what.camera, config.clone())?;
        device.get_or_insert(renderer.device());
        curves.push(curve(what, name, &mut renderer, config)?);
    }
    Ok(Convergence {
        device: device.ok_or_else(|| crate::error::Error::Config("no setting to render with".to_owned()))?,
        curves,
    })
}

fn curve(what: &Converge, name: &str, renderer: &mut Renderer, config: &RenderConfig) -> Result<Curve> {
    let mut estimate = ErrorEstimate::new(config.alpha);
    let (mut wall_s, mut device_s) = (0.0, 0.0);
    let mut points = Vec::new();
    let mut next = 1;
    loop {
        let begin = Instant::now();
        let run = renderer.iterate()?;
        wall_s += begin.elapsed().as_secs_f64();
        device_s += run.launches.iter().map(|launch| launch.duration_ns * 1e-9).sum::<f64>();
        let iterations = renderer.iterations();
        let last = wall_s >= what.seconds;
        if estimate.wants(iterations) {
            estimate.add(iterations, renderer.resolve_all()?);
        }
        if iterations == next || last {
            let comparison = compare(&renderer.resolve()?, what.reference)?;
            points.push(Measured {
                iterations,
                device_s,
                wall_s,
                rel_mse: comparison.rel_mse,
                rmse: comparison.rmse,
                mean_ratio: comparison.mean_ratio,
                estimated_error: estimate.relative(iterations).map(|error| error.total),
                efficiency: 1.0 / (comparison.rel_mse * device_s),
            });
            next = next.max(iterations) * 2;
        }
        if last {
            let fitted = points.iter().filter(|point| point.iterations >= FIRST_FITTED);
            let slope = super::log_slope(fitted.map(|point| (point.device_s, point.rel_mse)));
            return Ok(Curve {
                setting: name.to_owned(),
                points,
                slope,
            });
        }
    }
}

/// Seconds of the device after which a curve reaches this relMSE, between its points on the log-log line.
pub fn seconds_to(curve: &Curve, rel_mse: f64) -> Option<f64> {
    let mut before: Option<&Measured> = None;
    for point in &curve.points {
        if point.rel_mse <= rel_mse {
            return Some(match before {
                None => point.device_s,
                Some(before) => {
                    let along = (before.rel_mse / rel_mse).ln() / (before.rel_mse / point.rel_mse).ln();
                    before.device_s * (point.device_s / before.device_s).powf(along)
                }
            });
        }
        before = Some(point);
    }
    None
}

/// The curves as comma-separated values, with a heading.
pub fn csv(convergence: &Convergence) -> String {
    let mut text =
        "setting,iterations,device_s,wall_s,rel_mse,rmse,mean_ratio_r,mean_ratio_g,mean_ratio_b,estimated_error,\
                    efficiency\n"
            .to_owned();
    for curve in &convergence.curves {
        for point in &curve.points {
            let [r, g, b] = point.mean_ratio;
            let estimated = point
                .estimated_error
                .map_or(String::new(), |error| format!("{error:.6e}"));
            text += &format!(
                "{},{},{:.6},{:.6},{:.6e},{:.6e},{r:.6},{g:.6},{b:.6},{estimated},{:.6e}\n",
                curve.setting,
                point.iterations,
                point.device_s,
                point.wall_s,
                point.rel_mse,
                point.rmse,
                point.efficiency
            );
        }
    }
    text
}

/// The curves as a table; the first setting is what the others are measured by.
pub fn converge_table(convergence: &Convergence) -> String {
    let mut text = format!(
        "on {} ({})\n{:<28} {:>10} {:>10} {:>10} {:>12} {:>10} {:>10} {:>11}\n",
        convergence.device.name,
        convergence.device.driver,
        "setting",
        "iterations",
        "device s",
        "wall s",
        "relMSE",
        "√relMSE",
        "estimated",
        "efficiency"
    );
    for curve in &convergence.curves {
        for point in &curve.points {
            let estimated = point
                .estimated_error
                .map_or("–".to_owned(), |error| format!("{:.2} %", 100.0 * error));
            text += &format!(
                "{:<28} {:>10} {:>10.3} {:>10.3} {:>12.6} {:>8.2} % {estimated:>10} {:>11.2}\n",
                curve.setting,
                point.iterations,
                point.device_s,
                point.wall_s,
                point.rel_mse,
                100.0 * point.rel_mse.sqrt(),
                point.efficiency
            );
        }
    }
    text.push('\n');
    for curve in &convergence.curves {
        text += &format!(
            "{}: relMSE falls with time to the power {:.2}",
            curve.setting, curve.slope
        );
        let (first, end) = (&convergence.curves[0], curve.points.last());
        if let Some(end) = end
            && !std::ptr::eq(first, curve)
        {
            text += &match seconds_to(first, end.rel_mse) {
                Some(seconds) => format!(
                    "; its last relMSE, {:.6}, takes {} {seconds:.2} s instead of {:.2} s: a factor of {:.2}",
                    end.rel_mse,
                    first.setting,
                    end.device_s,
                    end.device_s / seconds
                ),
                None => format!("; {} doesn't reach its last relMSE, {:.6}", first.setting, end.rel_mse),
            };
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_to_an_error_lies_on_the_line_between_two_points() {
        let point = |iterations, device_s, rel_mse| Measured {
            iterations,
            device_s,
            wall_s: device_s,
            rel_mse,
            rmse: 0.0,
            mean_ratio: [1.0; 3],
            estimated_error: None,
            efficiency: 0.0,
        };
        let curve = Curve {
            setting: "s".to_owned(),
            points: vec![point(1, 1.0, 1.0), point(4, 4.0, 0.25)],
            slope: -1.0,
        };
        let close = |found: Option<f64>, expected: f64| (found.expect("a time") - expected).abs() < 1e-12;
        assert!(close(seconds_to(&curve, 0.5), 2.0), "{:?}", seconds_to(&curve, 0.5));
        assert!(close(seconds_to(&curve, 2.0), 1.0));
        assert_eq!(seconds_to(&curve, 0.1), None);
    }
}
