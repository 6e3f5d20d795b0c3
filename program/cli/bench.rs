//! The benches.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory};

use ppm_vk::Look;
use ppm_vk::internals::film::{write_png, write_whole};
use ppm_vk::internals::gather::{METHODS, method};
use ppm_vk::internals::packing::SceneFeatures;
use ppm_vk::internals::sizes::Probe;
use ppm_vk::{EmissionChoice, Platform, PreparedScene, RenderConfig, Scene};

use super::args::{Arguments, count, gather_method, png_file, positive, resolution};
use super::outputs::{all, check_outputs, named};
use super::scene::{SceneArguments, say_remarks};
use super::{Outcome, print};
use crate::bench::{self, GatherBench};

/// The default scene.
const CORNELL: [(&str, &[u8]); 2] = [
    ("cornell.gltf", include_bytes!("../../scenes/cornell.gltf")),
    ("cornell.bin", include_bytes!("../../scenes/cornell.bin")),
];

/// `ppm-vk bench gather`.
#[derive(Debug, Args)]
pub struct BenchGather {
    /// glTF file [default: the project's cornell].
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    read: SceneArguments,
    /// Pixels; may be given several times [default: the paper's, 320x280 and 1920x1080; with --scaling 320x280].
    #[arg(long, value_name = "WxH", value_parser = resolution)]
    resolution: Vec<[u32; 2]>,
    /// Photon paths.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.photons, value_parser = count)]
    photons: u32,
    /// Radius in scene units [default: from the photons' density].
    #[arg(long, value_name = "R", allow_negative_numbers = true, value_parser = positive)]
    radius: Option<f64>,
    /// Methods, separated by commas [default: all; with --scaling those that test nearby photons only].
    #[arg(long, value_name = "METHODS", value_delimiter = ',', value_parser = gather_method)]
    methods: Vec<usize>,
    /// Maximum number of photons per cell of cluster-grid, as in the paper [default: unlimited].
    #[arg(long, value_name = "N", value_parser = count)]
    cell_photons: Option<u32>,
    /// Number of runs of each method; the median time counts.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = count)]
    repeats: u32,
    /// Vary photons, visible points and radius instead.
    #[arg(long)]
    scaling: bool,
    /// With --scaling: maximum number of photon paths.
    #[arg(long, value_name = "N", default_value_t = 10_000_000, requires = "scaling", value_parser = clap::value_parser!(u32).range(31_623..))]
    most_photons: u32,
    /// Write all figures as JSON.
    #[arg(long, value_name = "FILE", value_parser = named("json"))]
    json: Option<PathBuf>,
    /// Draw the figures.
    #[arg(long, value_name = "FILE.svg", value_parser = named("svg"))]
    plot: Option<PathBuf>,
    /// Write a false-colour picture of the k-means clusters, at the last resolution.
    #[arg(long, value_name = "FILE.png", value_parser = png_file, conflicts_with = "scaling")]
    clusters: Option<PathBuf>,
    /// Vulkan device, by a part of its name or its index [default: the best].
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
}

/// Measures, prints the tables, writes the files.
pub fn gather(arguments: &BenchGather) -> Result<Outcome> {
    if arguments.scaling && arguments.resolution.len() > 1 {
        let text = "--scaling starts from one --resolution";
        Arguments::command().error(ErrorKind::ArgumentConflict, text).exit();
    }
    let outputs = [&arguments.json, &arguments.plot, &arguments.clusters];
    let inputs = arguments
        .scene
        .as_deref()
        .map_or_else(Vec::new, |scene| arguments.read.inputs(scene));
    check_outputs(&inputs, outputs.into_iter().filter_map(|file| file.as_deref()))?;
    let scene = load(arguments.scene.as_deref(), &arguments.read)?;
    let inputs: Vec<&Path> = scene.files.iter().map(PathBuf::as_path).collect();
    check_outputs(&inputs, outputs.into_iter().filter_map(|file| file.as_deref()))?;
    let prepared = PreparedScene::new(&scene)?;
    let bench = GatherBench {
        scene: &prepared,
        camera: scene.cameras.first().context("a scene without a camera")?,
        platform: Platform::Vulkan(arguments.device.clone()),
        config: RenderConfig {
            photons: arguments.photons,
            radius: arguments.radius,
            cell_photons: arguments.cell_photons,
            // The paper's photons.
            emission: EmissionChoice::Power,
            ..RenderConfig::default()
        },
        resolutions: resolutions(arguments),
        methods: if arguments.methods.is_empty() {
            (0..METHODS.len()).collect()
        } else {
            arguments.methods.clone()
        },
        repeats: arguments.repeats as usize,
    };
    let note = |what: &str| {
        say!("bench: {what}");
    };
    // Results that took minutes are printed first, so that a later failure does not lose them.
    let (json, plot): (Vec<u8>, Box<dyn Fn() -> ppm_vk::Result<String>>) = if arguments.scaling {
        let scaling = bench::scaling(&bench, arguments.most_photons, &note)?;
        print(&bench::scaling_table(&scaling))?;
        (
            serde_json::to_vec_pretty(&scaling)?,
            Box::new(move || bench::plot_scaling(&scaling)),
        )
    } else {
        let results = bench.run(&note)?;
        print(&bench::tables(&results))?;
        (
            serde_json::to_vec_pretty(&results)?,
            Box::new(move || bench::plot_methods(&results)),
        )
    };
    let written = [
        arguments.json.as_ref().map(|file| Ok(write_whole(file, &json)?)),
        arguments
            .plot
            .as_ref()
            .map(|file| Ok(write_whole(file, plot()?.as_bytes())?)),
        arguments.clusters.as_ref().map(|file| write_clusters(&bench, file)),
    ];
    all(written.into_iter().flatten())?;
    Ok(Outcome::Done)
}

/// `ppm-vk bench random`.
#[derive(Debug, Args)]
pub struct BenchRandom {
    /// Numbers per test.
    #[arg(long, value_name = "N", default_value_t = 1_000_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    numbers: u64,
    /// Seed of the numbers.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.seed)]
    seed: u32,
    /// As JSON.
    #[arg(long)]
    json: bool,
}

/// Tests the generators, prints the table.
pub fn random(arguments: &BenchRandom) -> Result<Outcome> {
    let battery = bench::battery(arguments.numbers, arguments.seed, &|what| {
        say!("bench: {what}");
    });
    if arguments.json {
        print(&(serde_json::to_string_pretty(&battery)? + "\n"))?;
    } else {
        print(&bench::battery_table(&battery))?;
    }
    let independent = battery.tests.iter().filter(|test| test.sampler == "independent");
    let failed = independent.filter(|test| !test.passes).count();
    ensure!(failed == 0, "{failed} tests of independent numbers failed");
    Ok(Outcome::Done)
}

/// `ppm-vk bench features`.
#[derive(Debug, Args)]
pub struct BenchFeatures {
    /// glTF file [default: a Cornell box].
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    read: SceneArguments,
    /// Pixels.
    #[arg(long, value_name = "WxH", default_value = "256x256", value_parser = resolution)]
    resolution: [u32; 2],
    /// Photon paths emitted in an iteration.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.photons, value_parser = count)]
    photons: u32,
    /// Iterations of each; medians count.
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = count)]
    repeats: u32,
    /// Vulkan device, by a part of its name or its index [default: the best].
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
    /// As JSON.
    #[arg(long)]
    json: bool,
}

/// Measures the cost of features that a scene does not need, prints the table.
pub fn features(arguments: &BenchFeatures) -> Result<Outcome> {
    let scene = load(arguments.scene.as_deref(), &arguments.read)?;
    let prepared = PreparedScene::new(&scene)?;
    let config = RenderConfig {
        resolution: arguments.resolution,
        photons: arguments.photons,
        ..RenderConfig::default()
    };
    let note = |what: &str| {
        say!("bench: {what}");
    };
    let costs = bench::feature_costs(
        &prepared,
        &scene.cameras[0],
        &Platform::Vulkan(arguments.device.clone()),
        &config,
        arguments.repeats,
        &note,
    )?;
    if arguments.json {
        print(&(serde_json::to_string_pretty(&costs)? + "\n"))?;
    } else {
        print(&bench::features_table(&costs))?;
    }
    Ok(Outcome::Done)
}

/// `ppm-vk bench kernels`.
#[derive(Debug, Args)]
pub struct BenchKernels {
    /// Features to compile in: none, all, or names as in `inspect`, separated by commas.
    #[arg(long, value_name = "FEATURES", default_value = "none", value_parser = features_named)]
    features: SceneFeatures,
    /// Vulkan device, by a part of its name or its index [default: the best].
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
    /// As JSON.
    #[arg(long)]
    json: bool,
}

fn features_named(text: &str) -> Result<SceneFeatures, String> {
    match text {
        "none" => return Ok(SceneFeatures::default()),
        "all" => return Ok(SceneFeatures::ALL),
        _ => (),
    }
    let mut known = SceneFeatures::default()
        .constants()
        .map(|(name, _)| (SceneFeatures::spell(name), false));
    for name in text.split(',') {
        match known.iter_mut().find(|(other, _)| other == name.trim()) {
            Some((_, present)) => *present = true,
            None => {
                let names = known.map(|(name, _)| name);
                return Err(format!("no feature «{name}»; there are {}", names.join(", ")));
            }
        }
    }
    Ok(SceneFeatures::of_constants(known.map(|(_, present)| present)))
}

/// Compiles the kernels, prints the driver's statistics.
pub fn kernels(arguments: &BenchKernels) -> Result<Outcome> {
    let compiled = bench::compiled_kernels(arguments.device.as_deref(), arguments.features)?;
    if arguments.json {
        print(&(serde_json::to_string_pretty(&compiled)? + "\n"))?;
    } else {
        print(&bench::kernels_table(&compiled))?;
    }
    Ok(Outcome::Done)
}

fn resolutions(arguments: &BenchGather) -> Vec<[u32; 2]> {
    match arguments.resolution.as_slice() {
        [] if arguments.scaling => vec![[320, 280]],
        [] => vec![[320, 280], [1920, 1080]],
        given => given.to_vec(),
    }
}

fn load(path: Option<&Path>, read: &SceneArguments) -> Result<Scene> {
    if let Some(path) = path {
        let scene = read.load(path, true)?;
        say_remarks(&scene);
        return Ok(scene);
    }
    let folder = tempfile::tempdir().context("a folder for the scene can't be made")?;
    for (name, bytes) in CORNELL {
        std::fs::write(folder.path().join(name), bytes).context("the scene can't be written")?;
    }
    read.load(&folder.path().join(CORNELL[0].0), true)
}

fn write_clusters(bench: &GatherBench, file: &Path) -> Result<()> {
    let resolution = bench.resolutions.last().context("no resolution")?;
    let mut session = bench.session(*resolution)?;
    let renderer = session.on_device().context("no Vulkan device")?;
    renderer.trace()?;
    let cluster_grid = method("cluster-grid").context("no method cluster-grid")?;
    renderer.gather(cluster_grid, Probe::default())?;
    let picture = bench::cluster_picture(renderer)?;
    Ok(write_png(&picture, file, Look::default())?)
}
