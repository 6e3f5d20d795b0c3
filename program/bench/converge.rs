//! Error against time: the same scene with several settings, each compared with a reference as it goes.

use std::time::Instant;

use serde::Serialize;

use super::slope_text;
use ppm_vk::{Camera, DeviceDescription, Image, Platform, PreparedScene, RenderConfig, Result, Session, compare};

/// First iterations, which are excluded from the fit: the radius has hardly changed.
const FIRST_FITTED: u32 = 4;

/// The parameters of a measurement.
pub struct Converge<'a> {
    /// The scene.
    pub scene: &'a PreparedScene,
    /// Its camera.
    pub camera: &'a Camera,
    /// The platform.
    pub platform: Platform,
    /// The reference; pictures have its size.
    pub reference: &'a Image,
    /// Seconds of rendering, for each setting.
    pub seconds: f64,
    /// Iterations that each setting gets at the most.
    pub iterations: Option<u32>,
    /// Settings and their names.
    pub settings: Vec<(String, RenderConfig)>,
    /// Whether to stop; called after every iteration. Measurements so far are kept.
    pub stop: &'a dyn Fn() -> bool,
}

/// A setting's errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Its name.
    pub setting: String,
    /// After 1, 2, 4, … iterations.
    pub points: Vec<Measured>,
    /// Slope of log relMSE against log device seconds, by least squares, from the fourth iteration on; `None` with fewer than
    /// two points.
    pub slope: Option<f64>,
}

/// The error after a number of iterations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measured {
    /// Iterations.
    pub iterations: u32,
    /// Device time in seconds.
    pub device_s: f64,
    /// Wall-clock time in seconds, excluding pictures and comparisons.
    pub wall_s: f64,
    /// relMSE.
    pub rel_mse: f64,
    /// RMSE, in units of radiance.
    pub rmse: f64,
    /// The picture's mean over the reference's.
    pub mean_ratio: [f64; 3],
    /// Root of relMSE, estimated by the render.
    pub estimated_error: Option<f64>,
    /// 1 / (relMSE · device seconds); infinite if the picture equals the reference.
    pub efficiency: f64,
}

/// All curves.
#[derive(Debug, Clone, Serialize)]
pub struct Convergence {
    /// The device.
    pub device: DeviceDescription,
    /// One for each setting.
    pub curves: Vec<Curve>,
}

/// Renders with each setting; `note` gets progress messages, `measured` all results after each measurement.
///
/// # Errors
/// Errors of a render, and those of `measured`.
pub fn converge(
    what: &Converge,
    note: &dyn Fn(&str),
    measured: &mut dyn FnMut(&Convergence) -> Result<()>,
) -> Result<()> {
    let mut known: Option<Convergence> = None;
    for (name, config) in &what.settings {
        if (what.stop)() {
            break;
        }
        note(name);
        let mut session = Session::new(what.scene, what.camera, config, &what.platform)?;
        let known = known.get_or_insert_with(|| Convergence {
            device: session.device(),
            curves: Vec::new(),
        });
        known.curves.push(Curve {
            setting: name.clone(),
            points: Vec::new(),
            slope: None,
        });
        follow(what, &mut session, known, measured)?;
    }
    Ok(())
}

/// Adds points to the last curve until the time is over.
fn follow(
    what: &Converge,
    session: &mut Session,
    known: &mut Convergence,
    measured: &mut dyn FnMut(&Convergence) -> Result<()>,
) -> Result<()> {
    let (mut wall_s, mut device_s) = (0.0, 0.0);
    let mut next = 1;
    loop {
        let begin = Instant::now();
        let stop = || (what.stop)() || wall_s + begin.elapsed().as_secs_f64() >= what.seconds;
        let run = session.iterate(&stop)?;
        wall_s += begin.elapsed().as_secs_f64();
        let launches = run.iter().flat_map(|run| &run.launches);
        device_s += launches.map(|launch| launch.duration_ns * 1e-9).sum::<f64>();
        let iterations = session.iterations();
        let last = run.is_none() || wall_s >= what.seconds || what.iterations == Some(iterations) || (what.stop)();
        let is_known = known
            .curves
            .last()
            .and_then(|curve| curve.points.last())
            .is_some_and(|point| point.iterations == iterations);
        if (iterations == next || last) && !is_known {
            let (picture, error) = session.picture()?;
            let comparison = compare(&picture, what.reference)?;
            if let Some(curve) = known.curves.last_mut() {
                curve.points.push(Measured {
                    iterations,
                    device_s,
                    wall_s,
                    rel_mse: comparison.rel_mse,
                    rmse: comparison.rmse,
                    mean_ratio: comparison.mean_ratio,
                    estimated_error: error.map(|error| error.total),
                    efficiency: 1.0 / (comparison.rel_mse * device_s),
                });
                let fitted = curve.points.iter().filter(|point| point.iterations >= FIRST_FITTED);
                curve.slope = super::log_slope(fitted.map(|point| (point.device_s, point.rel_mse)));
            }
            measured(known)?;
            next = next.max(iterations) * 2;
        }
        if last {
            return Ok(());
        }
    }
}

/// The time at which a curve reaches an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reached {
    /// After this device time, in seconds.
    After(f64),
    /// At the first measurement: within this time, in seconds.
    Within(f64),
    /// Not within the measurement.
    Never,
}

/// The time at which a curve reaches this relMSE, interpolated on the log-log line.
pub fn seconds_to(curve: &Curve, rel_mse: f64) -> Reached {
    let mut before: Option<&Measured> = None;
    for point in &curve.points {
        if point.rel_mse <= rel_mse {
            return before.map_or(Reached::Within(point.device_s), |before| {
                let along = (before.rel_mse / rel_mse).ln() / (before.rel_mse / point.rel_mse).ln();
                Reached::After(before.device_s * (point.device_s / before.device_s).powf(along))
            });
        }
        before = Some(point);
    }
    Reached::Never
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

/// The curves as a table; the others are compared with the first setting.
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
            "{}: relMSE falls with time to the power {}",
            curve.setting,
            slope_text(curve.slope)
        );
        let (first, end) = (&convergence.curves[0], curve.points.last());
        if let Some(end) = end
            && !std::ptr::eq(first, curve)
        {
            let (error, name, taken) = (end.rel_mse, &first.setting, end.device_s);
            text += &match seconds_to(first, error) {
                Reached::After(seconds) => format!(
                    "; its last relMSE, {error:.6}, takes {name} {seconds:.2} s instead of {taken:.2} s: a factor of {:.2}",
                    taken / seconds
                ),
                Reached::Within(seconds) => format!(
                    "; its last relMSE, {error:.6}, takes {name} at most {seconds:.2} s, its first measurement, instead of \
                     {taken:.2} s: a factor of {:.2} or more",
                    taken / seconds
                ),
                Reached::Never => format!("; {name} doesn't reach its last relMSE, {error:.6}"),
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
            slope: None,
        };
        let Reached::After(seconds) = seconds_to(&curve, 0.5) else {
            panic!("{:?}", seconds_to(&curve, 0.5));
        };
        assert!((seconds - 2.0).abs() < 1e-12, "{seconds}");
        assert_eq!(seconds_to(&curve, 2.0), Reached::Within(1.0));
        assert_eq!(seconds_to(&curve, 0.1), Reached::Never);
    }
}
