//! The settings of a render, from its arguments.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::CommandFactory;
use clap::error::ErrorKind;
use glam::Vec2;

use ppm_vk::internals::gather::{self, METHODS, Runs};
use ppm_vk::{Camera, EmissionChoice, Estimator, Platform, RenderConfig, Sampler, Scene, Until};

use super::args::{Arguments, BackendChoice, RenderArguments};

/// Default number of iterations, without a time limit.
const DEFAULT_ITERATIONS: u32 = 64;

/// The scene's camera as the arguments have it, and its index.
///
/// # Errors
/// A camera that the scene does not have; a lens that can't be focused.
pub fn camera(arguments: &RenderArguments, scene: &Scene) -> Result<(Camera, usize)> {
    let index = scene.camera_index(arguments.camera.as_deref())?;
    let mut camera = scene.cameras[index].clone();
    if let Some(radius) = arguments.aperture {
        camera.lens = Some(scene.lens(&camera, radius, arguments.focus)?);
    }
    if let Some([x, y]) = arguments.shift {
        camera.shift = Vec2::new(x, y);
    }
    Ok((camera, index))
}

/// The limits of a render.
pub fn until(arguments: &RenderArguments) -> Until {
    let endless = arguments.time.is_none() && arguments.target_error.is_none();
    Until {
        iterations: arguments.iterations.or_else(|| endless.then_some(DEFAULT_ITERATIONS)),
        time: arguments.time,
        error: arguments.target_error,
    }
}

/// Backend and gather method: if the user names one of them, the other follows.
pub fn choose_platform(arguments: &RenderArguments) -> (Platform, usize) {
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
        Some("this --gather does not run on this --backend; leave one of them out")
    } else if arguments.cell_photons.is_some() && METHODS[method].name != "cluster-grid" {
        Some("--cell-photons needs --gather cluster-grid")
    } else if arguments.aperture.is_some() && arguments.estimator == Estimator::Ppm {
        Some("--estimator ppm finds visible points once: it has no --aperture")
    } else if arguments.emission == Some(EmissionChoice::Aimed) && arguments.estimator == Estimator::Ppm {
        Some("--estimator ppm keeps all photons: its paths start by --emission power")
    } else if arguments.aov.iter().any(|layer| layer.needs_device()) && backend == BackendChoice::Cpu {
        Some("--backend cpu has the layers samples and error alone")
    } else if arguments.aov.iter().any(|layer| layer.needs_device()) && !arguments.part.is_whole() {
        Some("parts have no layers but samples and error: ppm-vk merge would leave them out")
    } else if arguments.fps.is_some() && arguments.frames.is_none() && arguments.shutter.is_none() {
        Some("--fps needs --frames or --shutter")
    } else if arguments.shutter.is_some() && arguments.frames.is_none() && arguments.read.frame_time.is_none() {
        Some("--shutter opens around a time: it needs --frames or --frame-time")
    } else if arguments.shutter.is_some() && backend == BackendChoice::Cpu {
        Some("--backend cpu has no --shutter")
    } else if arguments.shutter.is_some() && arguments.estimator == Estimator::Ppm {
        Some("--estimator ppm finds visible points once: it has no --shutter")
    } else if arguments.shutter.is_some() && method != gather::default_method() {
        Some("--shutter needs the default --gather")
    } else if backend == BackendChoice::Cpu && arguments.crop.is_some() {
        Some("--backend cpu renders whole pictures: it has no --crop")
    } else if backend == BackendChoice::Cpu && arguments.device.is_some() {
        Some("the CPU backend has no --device")
    } else {
        None
    };
    if let Some(text) = conflict {
        Arguments::command().error(ErrorKind::ArgumentConflict, text).exit();
    }
    let platform = match backend {
        BackendChoice::Vulkan => Platform::Vulkan(arguments.device.clone()),
        BackendChoice::Cpu => Platform::Cpu,
    };
    (platform, method)
}

/// The settings of a render by this camera.
pub fn config(arguments: &RenderArguments, gather: usize, camera: &Camera) -> RenderConfig {
    RenderConfig {
        resolution: arguments.resolution.unwrap_or(RenderConfig::of(camera).resolution),
        crop: arguments.crop,
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
        filter: arguments.filter,
        layers: arguments.aov.iter().copied().collect(),
        part: arguments.part,
    }
}

/// The scene's name with `.exr`, in the current folder.
pub fn default_output(scene: &Path) -> PathBuf {
    let mut name = scene.file_stem().unwrap_or(scene.as_os_str()).to_owned();
    name.push(".exr");
    PathBuf::from(name)
}
