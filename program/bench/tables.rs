//! A bench's results as text: the paper's tables next to our figures, then all methods.

use std::fmt::Write as _;

use super::gather::{MethodResult, ResolutionResult, Results};
use super::paper::{self, CPU_NAIVE, RESOLUTIONS, STEPS, TABLE_3, TABLE_4};
use super::scaling::Scaling;
use super::slope_text;
use ppm_vk::internals::gather::METHODS;

/// All tables.
pub fn tables(results: &Results) -> String {
    let mut text = format!(
        "{} photon paths; medians of {} interleaved runs\non {} ({}), timestamps of {} ns; a copying kernel moves {:.2} GB/s\n",
        results.photon_paths,
        results.repeats,
        results.device.name,
        results.device.driver,
        results.device.timestamp_period_ns,
        results.copy_bytes_per_s * 1e-9
    );
    for (number, resolution) in (1..).zip(RESOLUTIONS) {
        if let Some(result) = at(results, resolution) {
            text += &steps(number, result);
        }
    }
    text += &ladder("Table 3: acceleration techniques, gather alone, ms", results, &TABLE_3);
    text += &ladder("Table 4: k-means clusters, gather alone, ms", results, &TABLE_4);
    for result in &results.resolutions {
        text += &methods(result, results.copy_bytes_per_s);
    }
    text
}

fn at(results: &Results, resolution: [u32; 2]) -> Option<&ResolutionResult> {
    results
        .resolutions
        .iter()
        .find(|result| result.resolution == resolution)
}

fn method<'a>(result: &'a ResolutionResult, name: &str) -> Option<&'a MethodResult> {
    result.methods.iter().find(|method| method.method == name)
}

/// A number of milliseconds, or a dash.
fn ms(us: Option<f64>) -> String {
    match us.map(|us| us * 1e-3).filter(|ms| ms.is_finite()) {
        Some(ms) if ms >= 1000.0 => format!("{ms:.0}"),
        Some(ms) if ms >= 10.0 => format!("{ms:.1}"),
        Some(ms) => format!("{ms:.3}"),
        None => "–".to_owned(),
    }
}

/// Tables 1 and 2.
fn steps(number: usize, result: &ResolutionResult) -> String {
    let [width, height] = result.resolution;
    let mut text = format!("\nTable {number}: naive implementation at {width}x{height}, ms\n");
    let column = paper::column(result.resolution).unwrap_or_default();
    let gathers = ["naive", "cpu-kdtree"].map(|name| method(result, name).map(|method| method.gather_us));
    let ours = [
        result.steps.raytracing_us.map(Some),
        result.steps.photon_tracing_us.map(Some),
        gathers,
        result.steps.synthesize_us.map(Some),
    ];
    line(
        &mut text,
        ["", "paper's GPU", "paper's CPU", "this device", "this CPU"].map(str::to_owned),
    );
    for ((step, gpu, cpu), [device, host]) in STEPS.iter().zip(ours) {
        line(
            &mut text,
            [
                (*step).to_owned(),
                ms(Some(gpu[column] * 1e3)),
                ms(Some(cpu[column] * 1e3)),
                ms(device),
                ms(host),
            ],
        );
    }
    if result.resolution == RESOLUTIONS[0] {
        let naive = method(result, "cpu-naive").map(|method| method.gather_us);
        line(
            &mut text,
            [
                "Brute force (section 6)".to_owned(),
                "–".to_owned(),
                ms(Some(CPU_NAIVE * 1e3)),
                "–".to_owned(),
                ms(naive),
            ],
        );
    }
    text
}

fn line(text: &mut String, cells: [String; 5]) {
    let [first, rest @ ..] = cells;
    // Writing to a String can't fail.
    let _ = write!(text, "{first:<44}");
    for cell in rest {
        let _ = write!(text, " {cell:>14}");
    }
    text.push('\n');
}

/// Tables 3 and 4: each row at both resolutions, the paper's and ours.
fn ladder(title: &str, results: &Results, rows: &[paper::Row]) -> String {
    let ours = RESOLUTIONS.map(|resolution| at(results, resolution));
    if ours.iter().all(Option::is_none) {
        return String::new();
    }
    let mut text = format!("\n{title}\n");
    line(
        &mut text,
        ["", "paper 320x280", "paper 1080p", "ours 320x280", "ours 1080p"].map(str::to_owned),
    );
    for (name, row, figures) in rows {
        let gather = |result: Option<&ResolutionResult>| ms(result.and_then(|r| method(r, name)).map(|m| m.gather_us));
        line(
            &mut text,
            [
                (*row).to_owned(),
                ms(Some(figures[0] * 1e3)),
                ms(Some(figures[1] * 1e3)),
                gather(ours[0]),
                gather(ours[1]),
            ],
        );
    }
    text
}

/// All methods at a resolution.
fn methods(result: &ResolutionResult, copy_bytes_per_s: f64) -> String {
    let [width, height] = result.resolution;
    let mut text = format!(
        "\nAll methods at {width}x{height}: {} visible points, {} photons; ms\n\n",
        result.visible_points, result.photons
    );
    let _ = writeln!(
        text,
        "{:<28} {:>9} {:>9} {:>10} {:>10} {:>9} {:>11} {:>9} {:>9} {:>8} {:>7}",
        "method", "order", "build", "gather", "b + g", "× naive", "tested/pt", "acc./pt", "Mtests/s", "GB/s", "of copy"
    );
    let naive = method(result, "naive").map(MethodResult::build_and_gather_us);
    for method in &result.methods {
        let share = if method.share < 1.0 { "*" } else { "" };
        let times = naive.map_or("–".to_owned(), |naive| {
            format!("{:.1}", naive / method.build_and_gather_us())
        });
        let counted = method.tested.is_finite();
        let number = |value: f64, digits: usize| {
            if counted {
                format!("{value:.digits$}")
            } else {
                "–".to_owned()
            }
        };
        let _ = writeln!(
            text,
            "{:<28} {:>9} {:>9} {:>10} {:>10} {:>9} {:>11} {:>9.1} {:>9} {:>8} {:>7}",
            method.method,
            ms(Some(method.order_us)),
            ms(Some(method.build_us)),
            ms(Some(method.gather_us)) + share,
            ms(Some(method.build_and_gather_us())),
            times,
            number(method.tested, 1),
            method.accepted,
            number(method.tests_per_s * 1e-6, 0),
            number(method.bytes_per_s * 1e-9, 2),
            number(100.0 * method.bytes_per_s / copy_bytes_per_s, 0) + if counted { " %" } else { "" },
        );
    }
    let shares: Vec<String> = result
        .methods
        .iter()
        .filter(|method| method.share < 1.0)
        .map(|method| format!("{} {:.3} %", method.method, 100.0 * method.share))
        .collect();
    if !shares.is_empty() {
        let _ = writeln!(
            text,
            "* measured on a share of the visible points and scaled up: {}",
            shares.join(", ")
        );
    }
    text += "order: visible points, when they are new; build: photons; b + g: build and gather; clearing buffers is not \
             timed. GB/s: what invocations load and\n\
             store; caches serve part of it, so that it can exceed what a copy moves.\n";
    for method in &result.methods {
        text += &structure(method);
    }
    text
}

fn structure(method: &MethodResult) -> String {
    let mut text = String::new();
    if let Some(clusters) = &method.structure.clusters {
        let _ = write!(
            text,
            "{}: {:.1} % fillers",
            method.method,
            100.0 * clusters.filler_ratio
        );
        if let Some(sizes) = clusters.sizes {
            let _ = write!(
                text,
                "; {} clusters of {} to {} visible points, median {}",
                sizes.number, sizes.min, sizes.max, sizes.median
            );
        }
        text.push('\n');
    }
    if let Some(cells) = method.structure.cell_photons {
        let _ = writeln!(
            text,
            "{}: {} cells with photons, {} to {} each, median {}",
            method.method, cells.number, cells.min, cells.max, cells.median
        );
    }
    if method.structure.full_cells > 0 {
        let _ = writeln!(
            text,
            "{}: {} cells had more photons than --cell-photons allows; {} photons were lost",
            method.method, method.structure.full_cells, method.structure.lost_photons
        );
    }
    text
}

/// Names of the methods, for the head of a scaling table.
fn summary(name: &str) -> &'static str {
    METHODS
        .iter()
        .find(|method| method.name == name)
        .map_or("", |method| method.summary)
}

/// Costs against photons, visible points and radius, with the slope of each line.
pub fn scaling_table(scaling: &Scaling) -> String {
    let mut text = format!(
        "build and gather of one iteration, ms, on {} ({})\n",
        scaling.device.name, scaling.device.driver
    );
    for series in &scaling.series {
        let _ = writeln!(
            text,
            "\n{} against {}: {}",
            series.method,
            series.against,
            summary(series.method)
        );
        for point in &series.points {
            let _ = writeln!(text, "{:>14.0} {:>12}", point.x, ms(Some(point.cost_us)));
        }
        let _ = writeln!(text, "slope of the log-log line {}", slope_text(series.slope));
    }
    text
}
