//! A bench's results as SVG.

use plotters::prelude::*;

use super::converge::Convergence;
use super::gather::Results;
use super::scaling::Scaling;
use super::slope_text;
use ppm_vk::internals::error::{Error, Result};

const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

fn drawing<E: std::fmt::Display>(error: E) -> Error {
    Error::Config(format!("the plot can't be drawn: {error}"))
}

/// Build and gather of each method, one bar a resolution, on a logarithmic scale.
///
/// # Errors
/// A drawing that fails.
pub fn plot_methods(results: &Results) -> Result<String> {
    let names: Vec<&str> = results
        .resolutions
        .first()
        .map(|result| result.methods.iter().map(|method| method.method).collect())
        .unwrap_or_default();
    let times: Vec<Vec<f64>> = results
        .resolutions
        .iter()
        .map(|result| {
            let methods = result.methods.iter();
            methods.map(|method| method.build_and_gather_us() * 1e-3).collect()
        })
        .collect();
    let range = log_range(times.iter().flatten().copied());
    let smallest = range.start;
    let mut svg = String::new();
    {
        let height = 90 + 44 * names.len() as u32;
        let area = SVGBackend::with_string(&mut svg, (900, height)).into_drawing_area();
        area.fill(&WHITE).map_err(drawing)?;
        let caption = format!("build and gather, ms: {}", results.device.name);
        let mut chart = ChartBuilder::on(&area)
            .caption(caption, ("sans-serif", 18))
            .margin(10)
            .x_label_area_size(30)
            .y_label_area_size(220)
            .build_cartesian_2d(range, 0.0..names.len() as f64)
            .map_err(drawing)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .y_labels(0)
            .x_label_formatter(&|x| label(*x))
            .draw()
            .map_err(drawing)?;
        let thickness = 0.8 / times.len().max(1) as f64;
        for (index, (result, times)) in results.resolutions.iter().zip(&times).enumerate() {
            let color = COLORS[index % COLORS.len()];
            let [width, height] = result.resolution;
            let bars = times.iter().enumerate().map(|(row, &time)| {
                let top = (names.len() - row) as f64 - 0.1 - thickness * index as f64;
                Rectangle::new([(smallest, top), (time.log10(), top - thickness)], color.filled())
            });
            chart
                .draw_series(bars)
                .map_err(drawing)?
                .label(format!("{width}x{height}"))
                .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 12, y + 5)], color.filled()));
        }
        for (row, name) in names.iter().enumerate() {
            let middle = chart
                .plotting_area()
                .map_coordinate(&(smallest, (names.len() - row) as f64 - 0.5));
            let style = ("sans-serif", 14).into_font().color(&BLACK);
            area.draw(&Text::new(*name, (15, middle.1 - 7), style))
                .map_err(drawing)?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK)
            .draw()
            .map_err(drawing)?;
        area.present().map_err(drawing)?;
    }
    Ok(svg)
}

/// Range of an axis of decimal logarithms. (plotters' own logarithmic axis never ends for some ranges.)
fn log_range(values: impl Iterator<Item = f64> + Clone) -> std::ops::Range<f64> {
    // Whatever is measured, an axis has finite ends.
    let drawn = values.filter(|value| *value > 0.0 && value.is_finite());
    let low = drawn.clone().fold(1e300, f64::min);
    let high = drawn.fold(1e-300, f64::max).max(low);
    low.log10() - 0.2..high.log10() + 0.2
}

/// A tick of an axis of decimal logarithms.
fn label(logarithm: f64) -> String {
    let value = 10f64.powf(logarithm);
    let digits = 10f64.powf(1.0 - logarithm.floor());
    let value = (value * digits).round() / digits;
    if (0.001..100_000.0).contains(&value) {
        format!("{value}")
    } else {
        format!("{value:.0e}")
    }
}

/// A name, and points.
type Line = (String, Vec<(f64, f64)>);

/// Draws lines on logarithmic scales, with a legend.
fn draw_lines(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    caption: &str,
    legend: SeriesLabelPosition,
    lines: &[Line],
) -> Result<()> {
    let points = || lines.iter().flat_map(|(_, points)| points);
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 15))
        .margin(10)
        .x_label_area_size(30)
        .y_label_area_size(60)
        .build_cartesian_2d(
            log_range(points().map(|point| point.0)),
            log_range(points().map(|point| point.1)),
        )
        .map_err(drawing)?;
    chart
        .configure_mesh()
        .x_label_formatter(&|x| label(*x))
        .y_label_formatter(&|y| label(*y))
        .draw()
        .map_err(drawing)?;
    for (index, (name, points)) in lines.iter().enumerate() {
        let color = COLORS[index % COLORS.len()];
        let logarithms = points.iter().map(|(x, y)| (x.log10(), y.log10()));
        chart
            .draw_series(LineSeries::new(logarithms, color.stroke_width(2)).point_size(3))
            .map_err(drawing)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(legend)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK)
        .draw()
        .map_err(drawing)
}

/// Cost against each quantity, in a panel each, on logarithmic scales.
///
/// # Errors
/// A drawing that fails.
pub fn plot_scaling(scaling: &Scaling) -> Result<String> {
    let mut quantities: Vec<&str> = scaling.series.iter().map(|series| series.against).collect();
    quantities.dedup();
    quantities.truncate(3);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (1200, 420)).into_drawing_area();
        area.fill(&WHITE).map_err(drawing)?;
        let panels = area.split_evenly((1, quantities.len().max(1)));
        for (panel, against) in panels.iter().zip(&quantities) {
            let series = scaling.series.iter().filter(|series| series.against == *against);
            let lines: Vec<Line> = series
                .map(|series| {
                    let points = series.points.iter().map(|point| (point.x, point.cost_us * 1e-3));
                    let name = format!("{}, slope {}", series.method, slope_text(series.slope));
                    (name, points.collect())
                })
                .collect();
            draw_lines(
                panel,
                &format!("ms against {against}"),
                SeriesLabelPosition::UpperLeft,
                &lines,
            )?;
        }
        area.present().map_err(drawing)?;
    }
    Ok(svg)
}

/// relMSE against the device's seconds, a line for each setting, on logarithmic scales.
///
/// # Errors
/// A drawing that fails.
pub fn plot_convergence(convergence: &Convergence) -> Result<String> {
    let curves = convergence.curves.iter();
    let lines: Vec<Line> = curves
        .map(|curve| {
            let points = curve.points.iter().map(|point| (point.device_s, point.rel_mse));
            let name = format!("{}, slope {}", curve.setting, slope_text(curve.slope));
            (name, points.collect())
        })
        .collect();
    let caption = format!("relMSE against seconds: {}", convergence.device.name);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (800, 560)).into_drawing_area();
        area.fill(&WHITE).map_err(drawing)?;
        draw_lines(&area, &caption, SeriesLabelPosition::LowerLeft, &lines)?;
        area.present().map_err(drawing)?;
    }
    Ok(svg)
}
