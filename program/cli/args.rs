//! Command line arguments.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};

use super::bench::{BenchFeatures, BenchGather, BenchKernels, BenchRandom};
use super::compare::Compare;
use super::converge::ConvergeArguments;
use super::denoise::DenoiseArguments;
use super::events::ProgressFormat;
use super::frames::{Frames, RenderFiles};
use super::manual::Manual;
use super::merge::MergeArguments;
use super::outputs::{PictureFiles, named};
use super::scene::SceneArguments;
use super::serve;
use super::shutter::Shutter;
use super::view::{self, Address};
use ppm_vk::internals::config::ranges;
use ppm_vk::internals::gather;
use ppm_vk::{
    Accel, Choice, Direct, EmissionChoice, Estimator, Exposure, Layer, Look, Part, PixelFilter, Region, RenderConfig,
    Sampler, Tone, TriangleTest,
};

/// Maximum shift of the film, in units of the picture's larger side.
const FARTHEST_SHIFT: f32 = 1000.0;

/// Progressive photon mapping on Vulkan: a glTF scene in, an OpenEXR picture out.
#[derive(Debug, Parser)]
#[command(
    name = "ppm-vk",
    version,
    args_conflicts_with_subcommands = true,
    arg_required_else_help = true
)]
pub struct Arguments {
    #[command(flatten)]
    pub render: RenderArguments,
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// Commands other than rendering.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// List the Vulkan devices, their limits, and whether the program runs on them.
    Devices {
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// List the gather methods.
    Gathers,
    /// Measure.
    #[command(subcommand)]
    Bench(Bench),
    /// Measure error against time.
    Converge(Box<ConvergeArguments>),
    /// Compare a picture with a reference.
    Compare(Compare),
    /// Merge the states of parts (--part K/N --state FILE) into a picture.
    Merge(MergeArguments),
    /// Write manual pages and completions for bash, zsh and fish.
    Manual(Manual),
    /// Show the contents of a scene.
    Inspect {
        /// glTF file (.gltf or .glb).
        scene: PathBuf,
        #[command(flatten)]
        read: SceneArguments,
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
}

/// The benches.
#[derive(Debug, Subcommand)]
pub enum Bench {
    /// The gather methods on one device: the paper's tables next to our figures, then all methods.
    Gather(Box<BenchGather>),
    /// χ² tests of random numbers. Exits with 1 if independent numbers fail.
    Random(BenchRandom),
    /// The cost of features that a scene does not need.
    Features(BenchFeatures),
    /// Statistics of compiled kernels by the driver: registers, spills, subgroups. Nothing is run.
    Kernels(BenchKernels),
}

/// The backend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BackendChoice {
    /// A Vulkan device.
    Vulkan,
    /// The CPU, without Vulkan: a plain renderer in f64, which the kernels are tested against.
    Cpu,
}

/// How a PNG shows the picture.
#[derive(Debug, Clone, Copy, Args)]
pub struct LookArguments {
    /// Exposure of the PNG, in stops; auto shows the geometric mean of the picture as a middle grey.
    #[arg(long, value_name = "EV|auto", default_value = "0", allow_negative_numbers = true, value_parser = exposure)]
    exposure: Exposure,
    /// Tone mapper of the PNG.
    #[arg(long, default_value_t = Tone::Neutral, value_parser = choice::<Tone>())]
    tone: Tone,
}

impl From<LookArguments> for Look {
    fn from(LookArguments { exposure, tone }: LookArguments) -> Self {
        Self { exposure, tone }
    }
}

/// A render.
#[derive(Debug, Args)]
pub struct RenderArguments {
    /// glTF file to render (.gltf or .glb).
    #[arg(long, value_name = "FILE", required = true)]
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub read: SceneArguments,
    /// Linear RGB OpenEXR picture [default: the scene's name with .exr, in the current folder].
    #[arg(short, long, value_name = "FILE.exr", value_parser = exr_file)]
    pub output: Option<PathBuf>,
    /// Tone-mapped picture.
    #[arg(long, value_name = "FILE.png", value_parser = png_file)]
    pub png: Option<PathBuf>,
    #[command(flatten)]
    pub look: LookArguments,
    #[command(flatten)]
    pub denoise: DenoiseArguments,
    /// Render frames A to B: frame i shows the scene's animations at i / FPS seconds. All files get its number: OUT.####.exr.
    /// Limits (--iterations, --time, --target-error) are those of each frame (docs/animation.md).
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, conflicts_with = "frame_time", value_parser = Frames::parse)]
    pub frames: Option<Frames>,
    /// Frames per second of --frames and --shutter [default: 24].
    #[arg(long, value_name = "F", allow_negative_numbers = true, value_parser = positive)]
    pub fps: Option<f64>,
    /// Motion blur: the shutter opens and closes at these times, in frames from the time of --frames or --frame-time, such as
    /// -0.25,0.25 (docs/animation.md).
    #[arg(long, value_name = "OPEN,CLOSE", allow_hyphen_values = true, value_parser = Shutter::parse)]
    pub shutter: Option<Shutter>,
    /// Radius of the camera's lens, in scene units, for depth of field [default: a pinhole].
    #[arg(long, value_name = "R", allow_negative_numbers = true, value_parser = positive)]
    pub aperture: Option<f64>,
    /// Focus distance along the direction of view, in scene units [default: that of the scene's centre].
    #[arg(long, value_name = "D", requires = "aperture", allow_negative_numbers = true, value_parser = positive)]
    pub focus: Option<f64>,
    /// Shift the film to the right and up, as a fraction of the picture's larger side, like Blender's shift.
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, value_parser = shift)]
    pub shift: Option<[f32; 2]>,
    /// Pixels [default: 1280 wide at the camera's aspect ratio].
    #[arg(long, value_name = "WxH", value_parser = resolution)]
    pub resolution: Option<[u32; 2]>,
    /// Render a part of the picture, from the pixel X,Y (0,0: upper left), with the same bits as in the whole. The EXR's data window
    /// tells its place.
    #[arg(long, value_name = "X,Y,WxH", value_parser = crop)]
    pub crop: Option<Region>,
    /// Camera, by name or index [default: the scene's first].
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Stop after this number of iterations [default: 64 without --time and --target-error].
    #[arg(long, value_name = "N", value_parser = count)]
    pub iterations: Option<u32>,
    /// Stop after this time, in seconds.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    pub time: Option<Duration>,
    /// Stop when the estimated relative error (root of relMSE) is at most this, from iteration 16 on.
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = positive)]
    pub target_error: Option<f64>,
    /// Photon paths emitted in an iteration.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.photons, value_parser = count)]
    pub photons: u32,
    /// New visible points in each iteration, or always the same ones as in the paper.
    #[arg(long, default_value_t = RenderConfig::DEFAULT.estimator, value_parser = choice::<Estimator>())]
    pub estimator: Estimator,
    /// Direct light by sampling the lights, or by photons as in the paper.
    #[arg(long, default_value_t = RenderConfig::DEFAULT.direct, value_parser = choice::<Direct>())]
    pub direct: Direct,
    /// α of equation 2: the share of an iteration's photons that a visible point keeps.
    #[arg(long, value_name = "A", default_value_t = RenderConfig::DEFAULT.alpha, allow_negative_numbers = true, value_parser = alpha)]
    pub alpha: f32,
    /// Initial radius in scene units [default: from the photons' density, printed].
    #[arg(long, value_name = "R", allow_negative_numbers = true, value_parser = positive)]
    pub radius: Option<f64>,
    /// How visible points find their photons (ppm-vk gathers lists the methods) [default: the fastest].
    #[arg(long, value_name = "METHOD", value_parser = gather_method)]
    pub gather: Option<usize>,
    /// Maximum number of photons per cell of --gather cluster-grid, as in the paper: photons beyond it are lost, and counted
    /// [default: unlimited].
    #[arg(long, value_name = "N", value_parser = count)]
    pub cell_photons: Option<u32>,
    /// Ray tracing method.
    #[arg(long, default_value_t = RenderConfig::DEFAULT.accel, value_parser = choice::<Accel>())]
    pub accel: Accel,
    /// Triangle test: havel is the paper's test with precomputed planes.
    #[arg(long, default_value_t = RenderConfig::DEFAULT.triangle_test, value_parser = choice::<TriangleTest>())]
    pub triangle_test: TriangleTest,
    /// Maximum number of bounces of a camera or photon path.
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.max_depth, value_parser = count)]
    pub max_depth: u32,
    /// Start of photon paths: learned, where the picture needs photons, or by the lights' power as in the paper [default: aimed,
    /// with --estimator ppm power].
    #[arg(long, value_parser = choice::<EmissionChoice>())]
    pub emission: Option<EmissionChoice>,
    /// Random numbers of paths [default: sobol, with --estimator ppm independent].
    #[arg(long, value_parser = choice::<Sampler>())]
    pub sampler: Option<Sampler>,
    /// Pixel filter.
    #[arg(long, default_value_t = RenderConfig::DEFAULT.filter, value_parser = choice::<PixelFilter>())]
    pub filter: PixelFilter,
    /// Layers of the EXR, separated by commas: albedo, normal, depth, position, object and material (Cryptomatte), direct, indirect,
    /// caustic, samples, error.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choice::<Layer>())]
    pub aov: Vec<Layer>,
    /// Name the EXR's channels as Blender names those of this view layer, such as NAME.Combined.R.
    #[arg(long, value_name = "NAME", value_parser = view_layer)]
    pub layer_name: Option<String>,
    /// Seed: the same seed on the same device gives the same picture, bit for bit (except with the paper's gathers that order
    /// photons by atomic counters).
    #[arg(long, value_name = "N", default_value_t = RenderConfig::DEFAULT.seed)]
    pub seed: u32,
    /// Vulkan device, by a part of its name or its index [default: the best].
    #[arg(long, value_name = "NAME|INDEX")]
    pub device: Option<String>,
    /// Backend [default: that of the gather method].
    #[arg(long, value_enum)]
    pub backend: Option<BackendChoice>,
    /// After the run, print the times of each stage.
    #[arg(long)]
    pub profile: bool,
    /// Write the profile as JSON.
    #[arg(long, value_name = "FILE", value_parser = named("json"))]
    pub profile_json: Option<PathBuf>,
    /// Write every launch as a Chrome or Perfetto trace (JSON).
    #[arg(long, value_name = "FILE", value_parser = named("json"))]
    pub trace: Option<PathBuf>,
    /// Keep what the render has learned in this file, to go on from it with --resume.
    #[arg(long, value_name = "FILE", value_parser = named("state"))]
    pub state: Option<PathBuf>,
    /// Write the picture so far, and the state, whenever this time has passed [default: 60 with --state].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    pub save_every: Option<Duration>,
    /// Go on from --state: the picture has the same bits as without the interruption. --iterations counts those of the state
    /// too.
    #[arg(long, requires = "state")]
    pub resume: bool,
    /// Render the K-th of N independent parts, for ppm-vk merge: N parts of n iterations have the noise and the radii of one
    /// render of N·n. Needs --state.
    #[arg(long, value_name = "K/N", requires = "state", default_value_t = Part::WHOLE, hide_default_value = true, value_parser = part)]
    pub part: Part,
    /// Tell of progress on stdout, as a JSON line for each event, instead of a bar (docs/watching.md). --profile then prints to
    /// stderr, and nothing with --profile-json.
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub progress: Option<ProgressFormat>,
    /// Show the picture so far in tev, an image viewer, at this address [without one: 127.0.0.1:14158].
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        default_missing_value = view::DEFAULT_ADDRESS,
        value_parser = Address::parse
    )]
    pub view: Option<Address>,
    /// Show the picture so far, its error and the times of stages on a page for browsers on this computer; with HOST, at that
    /// address, for all who reach it. There is no password.
    #[arg(long, value_name = "[HOST:]PORT", value_parser = serve::address)]
    pub serve: Option<Address>,
    /// No progress bar.
    #[arg(long)]
    pub quiet: bool,
}

impl RenderArguments {
    /// Whether an output needs the times of all launches.
    pub fn needs_profile(&self) -> bool {
        self.profile || self.profile_json.is_some() || self.trace.is_some()
    }

    /// The files of the picture.
    pub fn picture_files(&self, files: &RenderFiles) -> PictureFiles {
        PictureFiles {
            exr: files.exr.clone(),
            png: files.png.clone(),
            view_layer: self.layer_name.clone(),
            look: self.look.into(),
        }
    }
}

/// A parser of the names of a setting's values.
pub fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let values = T::ALL.iter().map(|choice| {
        let summary = choice.summary();
        PossibleValue::new(choice.name()).help(summary.strip_suffix('.').unwrap_or(summary))
    });
    PossibleValuesParser::new(values).try_map(|name| T::named(&name).ok_or("no such value"))
}

pub fn resolution(text: &str) -> Result<[u32; 2], String> {
    let parsed = text
        .split_once(['x', 'X'])
        .and_then(|(width, height)| Some([width.parse::<u32>().ok()?, height.parse::<u32>().ok()?]));
    parsed.map_or_else(
        || Err("expected WIDTHxHEIGHT, such as 1280x720".to_owned()),
        ranges::resolution,
    )
}

pub fn count(text: &str) -> Result<u32, String> {
    let whole = |_| format!("expected a whole number up to {}", u32::MAX);
    ranges::count(text.parse().map_err(whole)?)
}

fn part(text: &str) -> Result<Part, String> {
    let parsed = text
        .split_once('/')
        .and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
    let (number, of) = parsed.ok_or("expected K/N, such as 1/4")?;
    ranges::part(Part { number, of })
}

fn crop(text: &str) -> Result<Region, String> {
    let mut parts = text.splitn(3, ',');
    let mut next = || parts.next().map(str::trim);
    let parsed = (|| {
        let origin = [next()?.parse().ok()?, next()?.parse().ok()?];
        Some(Region {
            origin,
            size: resolution(next()?).ok()?,
        })
    })();
    parsed.ok_or_else(|| "expected X,Y,WIDTHxHEIGHT, such as 320,180,640x360".to_owned())
}

fn shift(text: &str) -> Result<[f32; 2], String> {
    let sides = text
        .split_once(',')
        .and_then(|(x, y)| Some([x.trim().parse::<f32>().ok()?, y.trim().parse::<f32>().ok()?]));
    match sides {
        Some(sides) if sides.iter().all(|side| side.abs() <= FARTHEST_SHIFT) => Ok(sides),
        Some(_) => Err(format!("each must lie between -{FARTHEST_SHIFT} and {FARTHEST_SHIFT}")),
        None => Err("expected X,Y, such as 0,0.25".to_owned()),
    }
}

pub fn number(text: &str) -> Result<f64, String> {
    text.parse::<f64>().map_err(|_| "expected a number".to_owned())
}

fn alpha(text: &str) -> Result<f32, String> {
    ranges::alpha(number(text)? as f32)
}

pub fn positive(text: &str) -> Result<f64, String> {
    ranges::positive(number(text)?)
}

pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = positive(text)?;
    match Duration::try_from_secs_f64(seconds) {
        Ok(time) if !time.is_zero() => Ok(time),
        Ok(_) => Err("must be a nanosecond or more".to_owned()),
        Err(_) => Err("is more than can be counted; leave it out for no limit".to_owned()),
    }
}

/// A file name whose ending fits the format.
pub fn exr_file(name: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(name);
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("exr") => Ok(path),
        _ => Err("an OpenEXR picture is written: its name must end in .exr (--png writes a PNG)".to_owned()),
    }
}

/// Likewise.
pub fn png_file(name: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(name);
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("png") => Ok(path),
        _ => Err("a PNG is written: its name must end in .png".to_owned()),
    }
}

pub fn view_layer(name: &str) -> Result<String, String> {
    if name.is_empty() || name.contains('.') {
        return Err("expected a name without a dot".to_owned());
    }
    Ok(name.to_owned())
}

fn exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Auto);
    }
    let stops = number(text).map_err(|_| "expected a number of stops, or auto".to_owned())? as f32;
    if stops.abs() <= 100.0 {
        Ok(Exposure::Stops(stops))
    } else {
        Err("must lie between -100 and 100".to_owned())
    }
}

pub fn gather_method(name: &str) -> Result<usize, String> {
    gather::method(name).ok_or_else(|| {
        let names: Vec<_> = gather::METHODS.iter().map(|method| method.name).collect();
        format!("no such method; there are {}", names.join(", "))
    })
}
