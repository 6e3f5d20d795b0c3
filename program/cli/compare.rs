//! A picture against a reference.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use serde_json::json;

use super::args::png_file;
use super::outputs::check_outputs;
use super::{Outcome, print};
use ppm_vk::internals::film::{Image, read_exr, write_rgb8};
use ppm_vk::internals::metrics::{compare, defects, flip, relative_errors};

/// `ppm-vk compare`.
#[derive(Debug, Args)]
pub struct Compare {
    /// OpenEXR picture.
    image: PathBuf,
    /// Reference, an OpenEXR picture.
    reference: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Write the relative squared error of each pixel in false colours, from blue (10⁻⁵ and below) to yellow (1 and above);
    /// NaN is green.
    #[arg(long, value_name = "FILE.png", value_parser = png_file)]
    heatmap: Option<PathBuf>,
}

/// Prints the measures, writes the heat map.
pub fn run(arguments: &Compare) -> Result<Outcome> {
    check_outputs(
        &[&arguments.image, &arguments.reference],
        arguments.heatmap.as_deref().into_iter(),
    )?;
    let (image, reference) = (read_exr(&arguments.image)?, read_exr(&arguments.reference)?);
    let measures = compare(&image, &reference).with_context(|| arguments.image.display().to_string())?;
    let bad = [
        (&arguments.image, defects(&image)),
        (&arguments.reference, defects(&reference)),
    ];
    let errors = flip(&image, &reference);
    let mean_flip = errors.iter().map(|&error| f64::from(error)).sum::<f64>() / errors.len() as f64;
    if let Some(file) = &arguments.heatmap {
        write_heatmap(&image, &reference, file)?;
    }
    for (file, defects) in bad {
        if defects.nan + defects.infinite + defects.negative > 0 {
            say!(
                "warning: {}: {} pixels with NaN, {} with infinite, {} with negative values; the measures are of the picture as it \
                 is, and one such pixel can be all of them",
                file.display(),
                defects.nan,
                defects.infinite,
                defects.negative
            );
        }
    }
    if arguments.json {
        let mut value = serde_json::to_value(measures)?;
        value["flip"] = json!(mean_flip);
        value["defects"] = json!({"image": bad[0].1, "reference": bad[1].1});
        return print(&(serde_json::to_string_pretty(&value)? + "\n"));
    }
    let [r, g, b] = measures.mean_ratio;
    print(&format!(
        "RMSE            {:.6}\nrelMSE          {:.6}\nMAE             {:.6}\nHDR-FLIP        {mean_flip:.6}\n\
         ratio of means  {r:.5} {g:.5} {b:.5}\n",
        measures.rmse, measures.rel_mse, measures.mae
    ))
}

/// Decades of error that the colours span.
const DECADES: f32 = 5.0;
/// Distinct from all other colours.
const NAN_COLOR: [u8; 3] = [0, 255, 0];

fn write_heatmap(image: &Image, reference: &Image, file: &Path) -> Result<()> {
    let errors = relative_errors(image, reference)?;
    let bytes: Vec<u8> = errors
        .iter()
        .flat_map(|&error| {
            if error.is_nan() {
                NAN_COLOR
            } else {
                false_color(1.0 + error.max(1e-20).log10() / DECADES)
            }
        })
        .collect();
    Ok(write_rgb8([image.width(), image.height()], &bytes, file)?)
}

/// Colours of growing lightness, from dark blue over violet and orange to light yellow, for 0 to 1.
fn false_color(value: f32) -> [u8; 3] {
    const COLORS: [[f32; 3]; 6] = [
        [13.0, 8.0, 70.0],
        [92.0, 1.0, 166.0],
        [176.0, 42.0, 143.0],
        [225.0, 100.0, 98.0],
        [252.0, 166.0, 54.0],
        [240.0, 249.0, 120.0],
    ];
    let along = value.clamp(0.0, 1.0) * (COLORS.len() - 1) as f32;
    let low = (along as usize).min(COLORS.len() - 2);
    let part = along - low as f32;
    std::array::from_fn(|i| (COLORS[low][i] + part * (COLORS[low + 1][i] - COLORS[low][i])).round() as u8)
}
