//! Error against time.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};

use ppm_vk::internals::film::write_whole;
use ppm_vk::internals::gather::METHODS;
use ppm_vk::{Direct, EmissionChoice, Estimator, Platform, PreparedScene, RenderConfig, Sampler, read_exr};

use super::args::{count, seconds};
use super::outputs::{all, check_outputs, named};
use super::scene::{SceneArguments, say_remarks};
use super::{Outcome, interrupt, print};
use crate::bench::{Converge, Curve, converge, converge_table, csv, plot_convergence};

/// `ppm-vk converge`.
#[derive(Debug, Args)]
pub struct ConvergeArguments {
    /// glTF file.
    #[arg(long, value_name = "FILE")]
    scene: PathBuf,
    #[command(flatten)]
    read: SceneArguments,
    /// Reference, an OpenEXR picture; its size is rendered.
    #[arg(long, value_name = "FILE")]
    reference: PathBuf,
    /// Seconds of rendering, for each setting.
    #[arg(long, value_name = "SECONDS", default_value = "30", allow_negative_numbers = true, value_parser = seconds)]
    time: std::time::Duration,
    /// Stop after this number of iterations, if the time suffices for them.
    #[arg(long, value_name = "N", value_parser = count)]
    iterations: Option<u32>,
    /// Settings to compare; without it there is one curve, of the defaults.
    #[arg(long, value_enum)]
    vary: Option<Vary>,
    /// Photon paths emitted in an iteration.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.photons, value_parser = count)]
    photons: u32,
    /// Seed; not the reference's, if this program made it.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.seed)]
    seed: u32,
    /// Write the curves as comma-separated values.
    #[arg(long, value_name = "FILE", value_parser = named("csv"))]
    csv: Option<PathBuf>,
    /// Draw the curves.
    #[arg(long, value_name = "FILE.svg", value_parser = named("svg"))]
    plot: Option<PathBuf>,
    /// Camera, by name or index [default: the scene's first].
    #[arg(long, value_name = "NAME|INDEX")]
    camera: Option<String>,
    /// Vulkan device, by a part of its name or its index [default: the best].
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
}

/// Settings that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Vary {
    /// The defaults, and the paper's setting: ppm, direct light by photons.
    Paper,
    /// Gather methods that test nearby photons only.
    Gather,
    /// α of 0.5, 2/3, 0.8, 0.95.
    Alpha,
    /// A tenth, the same number, and ten times as many photon paths per iteration.
    Photons,
    /// sppm and ppm.
    Estimator,
    /// Direct light by sampling the lights, and by photons.
    Direct,
    /// Every source of random numbers.
    Sampler,
}

fn settings(base: &RenderConfig, vary: Option<Vary>) -> Vec<(String, RenderConfig)> {
    let with = |name: &str, change: &dyn Fn(&mut RenderConfig)| {
        let mut config = base.clone();
        change(&mut config);
        (name.to_owned(), config)
    };
    match vary {
        None => vec![with("defaults", &|_| ())],
        Some(Vary::Paper) => vec![
            with("defaults", &|_| ()),
            with("paper", &|config| {
                config.estimator = Estimator::Ppm;
                config.sampler = Sampler::of(Estimator::Ppm);
                config.emission = EmissionChoice::of(Estimator::Ppm);
                config.direct = Direct::Photons;
            }),
        ],
        Some(Vary::Gather) => METHODS
            .iter()
            .enumerate()
            .filter(|(_, method)| method.looks_nearby())
            .map(|(index, method)| with(method.name, &|config| config.gather = Some(index)))
            .collect(),
        Some(Vary::Alpha) => [
            ("alpha 2/3", 2.0 / 3.0),
            ("alpha 0.5", 0.5),
            ("alpha 0.8", 0.8),
            ("alpha 0.95", 0.95),
        ]
        .map(|(name, alpha)| with(name, &|config| config.alpha = alpha))
        .into(),
        Some(Vary::Photons) => {
            let counts = [base.photons, base.photons.div_ceil(10), base.photons.saturating_mul(10)];
            counts
                .map(|photons| with(&format!("{photons} photon paths"), &|config| config.photons = photons))
                .into()
        }
        Some(Vary::Estimator) => vec![
            with("sppm", &|config| config.estimator = Estimator::Sppm),
            with("ppm", &|config| {
                config.estimator = Estimator::Ppm;
                config.sampler = Sampler::of(Estimator::Ppm);
                config.emission = EmissionChoice::of(Estimator::Ppm);
            }),
        ],
        Some(Vary::Sampler) => vec![
            with("sobol", &|config| config.sampler = Sampler::Sobol),
            with("independent", &|config| config.sampler = Sampler::Independent),
            with("congruential", &|config| config.sampler = Sampler::Congruential),
        ],
        Some(Vary::Direct) => vec![
            with("direct light", &|config| config.direct = Direct::Light),
            with("direct photons", &|config| config.direct = Direct::Photons),
        ],
    }
}

/// Renders, prints the table, writes the files.
pub fn run(arguments: &ConvergeArguments) -> Result<Outcome> {
    let outputs = [&arguments.csv, &arguments.plot];
    let mut inputs = arguments.read.inputs(&arguments.scene);
    inputs.push(&arguments.reference);
    check_outputs(&inputs, outputs.into_iter().filter_map(|file| file.as_deref()))?;
    let reference = read_exr(&arguments.reference)?;
    let scene = arguments.read.load(&arguments.scene, true)?;
    inputs.extend(scene.files.iter().map(PathBuf::as_path));
    check_outputs(&inputs, outputs.into_iter().filter_map(|file| file.as_deref()))?;
    say_remarks(&scene);
    let prepared = PreparedScene::new(&scene)?;
    let side = |pixels: usize| u32::try_from(pixels).context("the reference is too large");
    let base = RenderConfig {
        resolution: [side(reference.width())?, side(reference.height())?],
        photons: arguments.photons,
        seed: arguments.seed,
        ..RenderConfig::default()
    };
    let what = Converge {
        scene: &prepared,
        camera: &scene.cameras[scene.camera_index(arguments.camera.as_deref())?],
        platform: Platform::Vulkan(arguments.device.clone()),
        reference: &reference,
        seconds: arguments.time.as_secs_f64(),
        iterations: arguments.iterations,
        settings: settings(&base, arguments.vary),
        stop: &interrupt::requested,
    };
    let note = |what: &str| {
        say!("converge: {what}");
    };
    interrupt::install()?;
    let mut table = String::new();
    // Later measurements write the file again, so a failure does not end the run.
    let mut written = Ok(());
    converge(&what, &note, &mut |convergence| {
        table = converge_table(convergence);
        let plot = |file| Ok(write_whole(file, plot_convergence(convergence)?.as_bytes())?);
        let files = [
            arguments
                .csv
                .as_deref()
                .map(|file| Ok(write_whole(file, csv(convergence).as_bytes())?)),
            arguments.plot.as_deref().map(plot),
        ];
        written = all(files.into_iter().flatten());
        let is_reference = |curve: &Curve| curve.points.last().is_some_and(|point| point.rel_mse == 0.0);
        if let Some(curve) = convergence.curves.iter().find(|curve| is_reference(curve)) {
            say!(
                "warning: {}: the picture is the reference, bit for bit; was that made with this seed? Use another --seed",
                curve.setting
            );
        }
        Ok(())
    })?;
    all([print(&table).map(|_| ()), written])?;
    Ok(if interrupt::requested() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}
