//! Renders a scene to files.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap::error::ErrorKind;

use super::args::{Arguments, BackendChoice, RenderArguments};
use super::outputs::check_outputs;
use super::progress::{BUILDING, Limits, Progress, while_showing, with_prefix};
use super::{Outcome, interrupt};
use crate::backend::Backend;
use crate::config::{EmissionChoice, Estimator, RenderConfig, Sampler};
use crate::estimate::{ErrorEstimate, of_one_photon};
use crate::film::{self, Metadata};
use crate::gather::{self, METHODS, Runs};
use crate::gpu::Device;
use crate::pipeline::Renderer;
use crate::report::{Profile, Subject};
use crate::scene::{Camera, PackedScene};

/// Width of a picture without --resolution.
const DEFAULT_WIDTH: u32 = 1280;
/// Aspect ratio where neither the user nor the camera gives one.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;
/// Iterations where the user gives neither them nor a time.
const DEFAULT_ITERATIONS: u32 = 64;

/// The render command.
pub fn render(arguments: &RenderArguments) -> Result<Outcome> {
    let path = arguments.scene.as_deref().context("--scene is missing")?;
    let (backend_choice, gather) = choose_backend(arguments);
    let output = arguments.output.clone().unwrap_or_else(|| default_output(path));
    // Before any work: nobody wants to learn after an hour that the picture can't be written.
    check_outputs(&arguments.read.inputs(path), outputs(arguments, &output))?;
    interrupt::install()?;

    let quiet = arguments.quiet;
    let scene = arguments.read.load(path, quiet)?;
    let mut inputs = arguments.read.inputs(path);
    inputs.extend(scene.files.iter().map(PathBuf::as_path));
    check_outputs(&inputs, outputs(arguments, &output))?;
    for warning in &scene.warnings {
        say!("warning: {warning}");
    }
    let mut camera = scene.cameras[scene.camera_index(arguments.camera.as_deref())?].clone();
    if let Some(radius) = arguments.aperture {
        camera.lens = Some(scene.lens(&camera, radius, arguments.focus)?);
    }
    let camera = &camera;
    let config = config(arguments, gather, camera);
    let packed = while_showing(BUILDING, quiet, || PackedScene::new(&scene))
        .map_err(|what| crate::error::Error::scene(path, what))?;
    let features = &packed.features;
    let chooses = features.dispersion || features.alpha || features.partly_clear || features.coat;
    if config.estimator == Estimator::Ppm && chooses {
        say!(
            "warning: --estimator ppm finds visible points once: where a wavelength, alpha, a coat or a part of the light is chosen \
             by chance, each pixel keeps its first choice; use --estimator sppm"
        );
    }
    let mut backend = open(backend_choice, arguments.device.as_deref(), &packed, camera, &config)?;
    if arguments.radius.is_none() {
        say!(
            "initial radius {:.6} scene units (automatic)",
            f64::from(backend.radius()) / packed.scale
        );
    }
    if config.emission == EmissionChoice::Aimed && !backend.aims() {
        say!("photon paths start in proportion to the lights' power: aiming them isn't worth its cost in this scene");
    }
    let specular = features.mirror || features.dielectric;
    if specular && config.estimator == Estimator::Sppm && backend.photon_maps() == 1 {
        say!(
            "caustics have the radii of other light: at this --resolution a photon map of their own is larger than the device \
             binds"
        );
    }

    let start = Instant::now();
    let limits = Limits {
        iterations: arguments.iterations.or_else(|| {
            let endless = arguments.time.is_none() && arguments.target_error.is_none();
            endless.then_some(DEFAULT_ITERATIONS)
        }),
        time: arguments.time,
        error: arguments.target_error,
    };
    let progress = Progress::new(limits, arguments.quiet);
    let mut profile = Profile::default();
    let profiled = arguments.profile || arguments.profile_json.is_some() || arguments.trace.is_some();
    let estimate = ErrorEstimate::new(&config, of_one_photon(&packed, backend.as_ref(), &config));
    let mut error = None;
    while limits.done(backend.iterations(), start.elapsed(), error) < 1.0
        && !(interrupt::asked() && backend.iterations() > 0)
    {
        let run = backend.iterate()?;
        // A day's launches are gigabytes.
        if profiled {
            profile.add(run);
        }
        let iterations = backend.iterations();
        if ErrorEstimate::is_due(iterations) {
            let picture = backend.resolve_all()?;
            error = estimate.relative(iterations, &picture).map(|error| error.total);
        }
        progress.show(backend.as_ref(), error);
    }
    let seconds = start.elapsed().as_secs_f64();
    progress.finish();

    let resolved = backend.resolve_all()?;
    let image = &resolved.image;
    let estimated = estimate.relative(backend.iterations(), &resolved);
    let metadata = Metadata {
        iterations: u64::from(backend.iterations()),
        photons_emitted: backend.emitted(),
        seed: u64::from(arguments.seed),
        device: backend.device().name,
        seconds,
        estimated_error: estimated.map(|error| error.total),
    };
    film::write_exr(
        image,
        estimate.of_pixels(backend.iterations(), &resolved).as_ref(),
        &output,
        &metadata,
    )?;
    if let Some(png) = &arguments.png {
        film::write_png(image, png, arguments.exposure)?;
    }
    for warning in backend.counters().warnings(backend.emitted(), config.max_depth) {
        say!("warning: {warning}");
    }
    say!(
        "{}: {}x{}, {} iterations, {} photon paths ({}), {seconds:.1} s ({} photon paths/s) on {}{}",
        output.display(),
        image.width(),
        image.height(),
        backend.iterations(),
        backend.emitted(),
        backend.counters().photons(),
        with_prefix(backend.emitted() as f64 / seconds),
        backend.device().name,
        estimated.map_or(String::new(), |error| format!("; {error}")),
    );
    if let Some(error) = estimated.filter(|error| error.waiting > 0.0) {
        say!(
            "{:.2} % of the pixels have had no photon yet: of indirect light there the error says only what one photon would \
             bring",
            100.0 * error.waiting
        );
    }
    let subject = Subject {
        scene: scene.name.clone(),
        resolution: config.resolution,
        gather: METHODS[gather].name.to_owned(),
        photons: config.photons,
        device: backend.device(),
        counters: backend.counters(),
    };
    write_profile(arguments, &profile, &subject)?;
    Ok(if interrupt::asked() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}

/// What computes, and the gather method: each follows the other where the user names one alone.
fn choose_backend(arguments: &RenderArguments) -> (BackendChoice, usize) {
    let of_method = |method: usize| match METHODS[method].runs {
        Runs::Device { .. } => BackendChoice::Vulkan,
        Runs::CpuKdTree | Runs::CpuNaive => BackendChoice::Cpu,
    };
    let (backend, method) = match (arguments.backend, arguments.gather) {
        (backend, Some(method)) => (backend.unwrap_or(of_method(method)), method),
        (Some(BackendChoice::Cpu), None) => (BackendChoice::Cpu, gather::default_cpu_method()),
        (_, None) => (BackendChoice::Vulkan, gather::default_method()),
    };
    let conflict = if backend != of_method(method) {
        Some("this --gather doesn't run on this --backend; leave one of them out")
    } else if arguments.cell_photons.is_some() && METHODS[method].name != "cluster-grid" {
        Some("--cell-photons is of --gather cluster-grid")
    } else if arguments.aperture.is_some() && arguments.estimator == Estimator::Ppm {
        Some("--estimator ppm finds visible points once: it has no --aperture")
    } else if arguments.emission == Some(EmissionChoice::Aimed) && arguments.estimator == Estimator::Ppm {
        Some("--estimator ppm keeps all photons: its paths start by --emission power")
    } else if backend == BackendChoice::Cpu && arguments.device.is_some() {
        Some("the CPU backend has no --device")
    } else {
        None
    };
    if let Some(text) = conflict {
        Arguments::command().error(ErrorKind::ArgumentConflict, text).exit();
    }
    (backend, method)
}

fn open(
    backend: BackendChoice,
    device: Option<&str>,
    scene: &PackedScene,
    camera: &Camera,
    config: &RenderConfig,
) -> Result<Box<dyn Backend>> {
    Ok(match backend {
        BackendChoice::Vulkan => {
            let device = Device::open(device)?;
            Box::new(Renderer::new(device, scene, camera, config.clone())?)
        }
        BackendChoice::Cpu => Box::new(crate::cpu::Renderer::new(scene, camera, config.clone())?),
    })
}

fn config(arguments: &RenderArguments, gather: usize, camera: &Camera) -> RenderConfig {
    RenderConfig {
        resolution: arguments.resolution.unwrap_or_else(|| default_resolution(camera)),
        photons: arguments.photons,
        estimator: arguments.estimator,
        direct: arguments.direct,
        alpha: arguments.alpha,
        radius: arguments.radius,
        gather: Some(gather),
        cell_photons: arguments.cell_photons,
        accel: arguments.accel,
        triangle_test: arguments.triangle_test,
        max_depth: arguments.max_depth,
        drop_unwanted: true,
        aims_anyway: false,
        emission: arguments.emission.unwrap_or(EmissionChoice::of(arguments.estimator)),
        sampler: arguments.sampler.unwrap_or(Sampler::of(arguments.estimator)),
        seed: arguments.seed,
    }
}

/// A picture's size where the user gives none.
pub fn default_resolution(camera: &Camera) -> [u32; 2] {
    let height = DEFAULT_WIDTH as f32 / camera.aspect.unwrap_or(DEFAULT_ASPECT);
    [DEFAULT_WIDTH, (height.round() as u32).clamp(1, crate::config::MAX_SIDE)]
}

/// The scene's name with `.exr`, in the current folder.
fn default_output(scene: &Path) -> PathBuf {
    let mut name = scene.file_stem().unwrap_or(scene.as_os_str()).to_owned();
    name.push(".exr");
    PathBuf::from(name)
}

fn outputs<'a>(arguments: &'a RenderArguments, output: &'a Path) -> impl Iterator<Item = &'a Path> {
    let others = [&arguments.png, &arguments.profile_json, &arguments.trace];
    std::iter::once(output).chain(others.into_iter().filter_map(|file| file.as_deref()))
}

fn write_profile(arguments: &RenderArguments, profile: &Profile, subject: &Subject) -> Result<()> {
    if arguments.profile {
        super::print(&profile.table(subject))?;
    }
    for (file, value) in [
        (
            &arguments.profile_json,
            arguments.profile_json.as_ref().map(|_| profile.json(subject)),
        ),
        (
            &arguments.trace,
            arguments.trace.as_ref().map(|_| profile.trace(subject)),
        ),
    ] {
        if let (Some(file), Some(value)) = (file, value) {
            film::write_whole(file, &serde_json::to_vec_pretty(&value)?)?;
        }
    }
    Ok(())
}
