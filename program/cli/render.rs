//! Renders a scene to files.

use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result};
use clap::CommandFactory;
use clap::error::ErrorKind;
use glam::Vec2;

use super::args::{Arguments, BackendChoice, RenderArguments};
use super::outputs::{all, check_outputs};
use super::progress::{BUILDING, Limits, Progress, while_showing, with_prefix};
use super::scene::say_remarks;
use super::work::{Rendered, Work};
use super::{Outcome, interrupt};
use crate::backend::Backend;
use crate::config::{EmissionChoice, Estimator, RenderConfig, Sampler};
use crate::estimate::{ErrorEstimate, RelativeError, of_one_photon};
use crate::files::Writing;
use crate::film::{self, Image, Metadata};
use crate::gather::{self, METHODS, Runs};
use crate::gpu::Device;
use crate::packing::PackedScene;
use crate::pipeline::Renderer;
use crate::report::Subject;
use crate::scene::Camera;

/// Width of a picture without --resolution.
const DEFAULT_WIDTH: u32 = RenderConfig::DEFAULT.resolution[0];
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
    say_remarks(&scene);
    let mut camera = scene.cameras[scene.camera_index(arguments.camera.as_deref())?].clone();
    if let Some(radius) = arguments.aperture {
        camera.lens = Some(scene.lens(&camera, radius, arguments.focus)?);
    }
    if let Some([x, y]) = arguments.shift {
        camera.shift = Vec2::new(x, y);
    }
    let camera = &camera;
    let config = config(arguments, gather, camera);
    let packed = while_showing(BUILDING, quiet, || PackedScene::new(&scene))
        .map_err(|what| crate::error::Error::scene(path, what))?;
    for note in &packed.notes {
        say!("note: {note}");
    }
    let features = &packed.features;
    let chooses = features.dispersion || features.alpha || features.partly_clear || features.coat || features.soft;
    if config.estimator == Estimator::Ppm && chooses {
        say!(
            "warning: --estimator ppm finds visible points once: where a wavelength, alpha, a coat, a part of the light or a place \
             on a lamp is chosen by chance, each pixel keeps its first choice, and the picture stays grainy there, however long it \
             renders; use --estimator sppm"
        );
    }
    let mut backend = open(backend_choice, arguments.device.as_deref(), &packed, camera, &config)?;
    if arguments.radius.is_none() {
        say!(
            "initial radius {:.6} scene units (automatic)",
            f64::from(backend.radius()) / packed.scale
        );
    }
    let on_device = backend_choice == BackendChoice::Vulkan;
    if on_device && config.emission == EmissionChoice::Aimed && !backend.aims() {
        say!("photon paths start in proportion to the lights' power: aiming them isn't worth its cost in this scene");
    }
    let specular = features.mirror || features.dielectric;
    if on_device && specular && config.estimator == Estimator::Sppm && backend.photon_maps() == 1 {
        say!(
            "caustics have the radii of other light: at this --resolution a photon map of their own is larger than the device \
             binds"
        );
    }

    let limits = Limits {
        iterations: arguments.iterations.or_else(|| {
            let endless = arguments.time.is_none() && arguments.target_error.is_none();
            endless.then_some(DEFAULT_ITERATIONS)
        }),
        time: arguments.time,
        error: arguments.target_error,
    };
    let work = Work {
        limits,
        estimate: ErrorEstimate::new(&config, of_one_photon(&packed, backend.as_ref(), &config)),
        profiled: arguments.profile || arguments.profile_json.is_some() || arguments.trace.is_some(),
        asked: &interrupt::asked,
    };
    let progress = Progress::new(limits, quiet);
    let rendered = work.run(backend.as_mut(), &|backend, error| progress.show(backend, error));
    progress.finish();
    let rendered = rendered?;
    let subject = Subject {
        scene: scene.name.clone(),
        resolution: config.resolution,
        gather: METHODS[gather].name.to_owned(),
        photons: config.photons,
        photons_emitted: rendered.emitted,
        device: backend.device(),
        counters: backend.counters(),
    };
    for warning in backend.counters().warnings(rendered.emitted, config.max_depth) {
        say!("warning: {warning}");
    }
    if let Some(note) = backend.counters().note(rendered.emitted, config.max_depth) {
        say!("{note}");
    }
    if is_black(&rendered.picture.image) {
        say!(
            "warning: the picture is black: no light has come to what the camera sees; is there a light that shines there, and \
             nothing before the camera?"
        );
    }
    write_outputs(arguments, &output, &work.estimate, &rendered, &subject)?;
    Ok(if interrupt::asked() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}

/// Writes all that was asked for, whatever becomes of the others, and says what was rendered.
///
/// # Errors
/// All that failed, the render itself among it, in one line.
fn write_outputs(
    arguments: &RenderArguments,
    output: &Path,
    estimate: &ErrorEstimate,
    rendered: &Rendered,
    subject: &Subject,
) -> Result<()> {
    let _writing = Writing::begin();
    let image = &rendered.picture.image;
    let error = estimate.relative(rendered.iterations, &rendered.picture);
    let metadata = Metadata {
        iterations: u64::from(rendered.iterations),
        photons_emitted: rendered.emitted,
        seed: u64::from(arguments.seed),
        device: subject.device.name.clone(),
        seconds: rendered.seconds,
        estimated_error: error.map(|error| error.total),
    };
    let errors = estimate.of_pixels(rendered.iterations, &rendered.picture);
    let layers = film::Layers {
        alpha: Some(&rendered.picture.alpha),
        errors: errors.as_ref(),
    };
    let picture = film::write_exr(image, layers, output, &metadata);
    if picture.is_ok() {
        say_rendered(output, rendered, subject, error);
    }
    let (png, profile) = (arguments.png.as_ref(), &rendered.profile);
    let json = |file: &Option<PathBuf>, value: &dyn Fn() -> serde_json::Value| {
        file.as_ref().map(|file| write_json(file, &value()))
    };
    let written = [
        rendered.failure.clone().map(|failure| Err(Error::msg(failure))),
        Some(picture.map_err(Error::from)),
        png.map(|file| Ok(film::write_png(image, file, arguments.exposure)?)),
        arguments
            .profile
            .then(|| super::print(&profile.table(subject)).map(|_| ())),
        json(&arguments.profile_json, &|| profile.json(subject)),
        json(&arguments.trace, &|| profile.trace(subject)),
    ];
    all(written.into_iter().flatten())
}

fn is_black(image: &Image) -> bool {
    image.pixels().iter().flatten().all(|&value| value == 0.0)
}

fn say_rendered(output: &Path, rendered: &Rendered, subject: &Subject, error: Option<RelativeError>) {
    let [width, height] = subject.resolution;
    say!(
        "{}: {width}x{height}, {} iterations, {} photon paths ({}), {:.1} s ({} photon paths/s) on {}{}",
        output.display(),
        rendered.iterations,
        rendered.emitted,
        subject.counters.photons(),
        rendered.seconds,
        with_prefix(rendered.emitted as f64 / rendered.seconds),
        subject.device.name,
        error.map_or(String::new(), |error| format!("; {error}")),
    );
    if let Some(error) = error.filter(|error| error.waiting > 0.0) {
        say!(
            "{:.2} % of the pixels have had no photon yet: of indirect light there the error says only what one photon would \
             bring",
            100.0 * error.waiting
        );
    }
}

fn write_json(file: &Path, value: &serde_json::Value) -> Result<()> {
    Ok(film::write_whole(file, &serde_json::to_vec_pretty(value)?)?)
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
