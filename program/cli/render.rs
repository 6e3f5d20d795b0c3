//! Renders a scene to files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap::error::ErrorKind;
use glam::Vec2;

use ppm_vk::internals::files::Writing;
use ppm_vk::internals::film;
use ppm_vk::internals::gather::{self, METHODS, Runs};
use ppm_vk::{
    Camera, EmissionChoice, Estimator, Hooks, Platform, PreparedScene, RenderConfig, Rendered, Sampler, Scene, Session,
    Snapshots, State, Until, Warning,
};

use super::args::{Arguments, BackendChoice, RenderArguments};
use super::denoise::denoise;
use super::events::{Event, Events, Phase};
use super::outputs::{all, check_outputs};
use super::progress::{BUILDING, Meter, while_showing, with_prefix};
use super::scene::tell_remarks;
use super::watch::Watch;
use super::{Outcome, advice, interrupt};

/// Default number of iterations, without a time limit.
const DEFAULT_ITERATIONS: u32 = 64;

/// The render command.
pub fn render(arguments: &RenderArguments) -> Result<Outcome> {
    let path = arguments.scene.as_deref().context("--scene is missing")?;
    let (platform, gather) = choose_platform(arguments);
    let output = arguments.output.clone().unwrap_or_else(|| default_output(path));
    let watch = Watch::new(arguments, &output);
    let job = Job {
        arguments,
        path,
        output: &output,
        platform,
        gather,
        watch: &watch,
    };
    let outcome = watch.begin().and_then(|()| job.run());
    watch.end(&outcome);
    outcome
}

/// A render of a scene's file.
pub(super) struct Job<'a> {
    pub arguments: &'a RenderArguments,
    path: &'a Path,
    pub output: &'a Path,
    pub platform: Platform,
    gather: usize,
    pub watch: &'a Watch<'a>,
}

impl Job<'_> {
    fn run(&self) -> Result<Outcome> {
        let Self {
            arguments,
            path,
            output,
            gather,
            watch,
            ref platform,
        } = *self;
        let events = &watch.events;
        // Before any work: fail early if a picture can't be written.
        check_outputs(&arguments.read.inputs(path), outputs(arguments, output))?;
        let denoiser = arguments.denoise.open()?;
        interrupt::install()?;

        let quiet = arguments.quiet || arguments.has_events_on_stdout();
        events.begin(Phase::Load);
        let scene = arguments.read.load(path, quiet)?;
        let mut inputs = arguments.read.inputs(path);
        inputs.extend(scene.files.iter().map(PathBuf::as_path));
        check_outputs(&inputs, outputs(arguments, output))?;
        tell_remarks(&scene, events);
        let camera = camera(arguments, &scene)?;
        let config = config(arguments, gather, &camera);
        events.begin(Phase::Build);
        let prepared = while_showing(BUILDING, quiet, || PreparedScene::new(&scene))?;
        for note in prepared.notes() {
            events.note(note.clone());
        }
        let begins = |phase: ppm_vk::Phase| match phase {
            ppm_vk::Phase::Compile => events.begin(Phase::Compile),
            ppm_vk::Phase::Pilot => events.begin(Phase::Pilot),
            _ => {}
        };
        let open = || Session::watched(&prepared, &camera, &config, platform, &begins);
        let mut session = match open() {
            Err(error) if error.is_picture_too_large() => return self.in_crops(&prepared, &camera, &config, error),
            session => session?,
        };
        tell_warnings(events, session.warnings());
        if let Some(state) = &arguments.state {
            begin_with_state(events, &mut session, state, arguments.resume)?;
        }
        if arguments.radius.is_none() {
            say!("initial radius {:.6} scene units (automatic)", session.radius());
        }
        if config.emission == EmissionChoice::Aimed && !session.is_aimed() {
            say!(
                "photon paths start in proportion to the lights' power: aiming does not pay for its cost in this scene"
            );
        }

        let until = until(arguments);
        let takers = watch.takers();
        let meter = Meter::new(until, &session);
        let hooks = Hooks {
            stop: &interrupt::requested,
            progress: &|progress| events.tell(&Event::Iteration(meter.measure(progress))),
            profile: arguments.profile || arguments.profile_json.is_some() || arguments.trace.is_some(),
            snapshots: Some(Snapshots {
                wanted: &|| takers.want(),
                take: &|snapshot| takers.take(&snapshot),
            }),
        };
        events.begin(Phase::Iterate);
        let mut rendered = session.render_with(until, &hooks);
        if let Some(state) = arguments.state.as_deref().filter(|_| is_device_lost(&rendered)) {
            events.warning(format!(
                "the device was lost; the render goes on from {} on a device that is opened anew",
                state.display()
            ));
            session = open()?;
            session.resume(&State::read(state)?)?;
            events.begin(Phase::Iterate);
            rendered = session.render_with(until, &hooks);
        }
        events.begin(Phase::Write);
        let denoised = rendered
            .as_mut()
            .map_or(Ok(()), |rendered| denoise(rendered, denoiser.as_ref()));
        let rendered = rendered.map(Arc::new);
        takers.end(rendered.as_ref().ok());
        let rendered = rendered?;
        tell_warnings(events, &rendered.warnings());
        let state = arguments.state.as_ref().filter(|_| rendered.failure().is_none());
        let state = state.map(|file| {
            session.state()?.write(file)?;
            events.written(file, session.iterations());
            Ok(())
        });
        all([write_outputs(arguments, events, output, &rendered), denoised]
            .into_iter()
            .chain(state))?;
        Ok(if interrupt::requested() {
            Outcome::Interrupted
        } else {
            Outcome::Done
        })
    }
}

fn camera(arguments: &RenderArguments, scene: &Scene) -> Result<Camera> {
    let mut camera = scene.cameras[scene.camera_index(arguments.camera.as_deref())?].clone();
    if let Some(radius) = arguments.aperture {
        camera.lens = Some(scene.lens(&camera, radius, arguments.focus)?);
    }
    if let Some([x, y]) = arguments.shift {
        camera.shift = Vec2::new(x, y);
    }
    Ok(camera)
}

pub(super) fn until(arguments: &RenderArguments) -> Until {
    let endless = arguments.time.is_none() && arguments.target_error.is_none();
    Until {
        iterations: arguments.iterations.or_else(|| endless.then_some(DEFAULT_ITERATIONS)),
        time: arguments.time,
        error: arguments.target_error,
    }
}

/// Goes on from a state, if that is asked for and there is one.
fn begin_with_state(events: &Events, session: &mut Session, file: &Path, resume: bool) -> Result<()> {
    if !file.exists() {
        if resume {
            events.note(format!("there is no {} yet: the render begins", file.display()));
        }
    } else if resume {
        let state = State::read(file)?;
        session.resume(&state).with_context(|| file.display().to_string())?;
        say!("{}: going on after {} iterations", file.display(), session.iterations());
    } else {
        events.note(format!("{} will be replaced; --resume goes on from it", file.display()));
    }
    Ok(())
}

fn is_device_lost(rendered: &ppm_vk::Result<Rendered>) -> bool {
    let failure = |rendered: &Rendered| rendered.failure().is_some_and(|failure| failure.error.is_device_lost());
    rendered.as_ref().map_or_else(ppm_vk::Error::is_device_lost, failure)
}

/// Writes all outputs, even if some of them fail, and reports the render.
///
/// # Errors
/// All failures, including that of the render, in one line.
pub(super) fn write_outputs(
    arguments: &RenderArguments,
    events: &Events,
    output: &Path,
    rendered: &Rendered,
) -> Result<()> {
    let _writing = Writing::begin();
    let iterations = rendered.iterations();
    let pictures = arguments
        .picture_files(output)
        .write(rendered, |file| events.written(file, iterations));
    if pictures[0].is_ok() {
        say_rendered(output, rendered);
    }
    let (profile, subject) = (rendered.profile(), rendered.subject());
    let json = |file: &Option<PathBuf>, value: &dyn Fn() -> serde_json::Value| {
        file.as_ref()
            .map(|file| write_json(file, &value()).map(|()| events.written(file, iterations)))
    };
    let written = [
        rendered.failure().map(|failure| Err(advice::of_failure(failure))),
        arguments.profile.then(|| print_profile(arguments, rendered)),
        json(&arguments.profile_json, &|| profile.json(subject)),
        json(&arguments.trace, &|| profile.trace(subject)),
    ];
    all(pictures.into_iter().chain(written.into_iter().flatten()))
}

/// Prints the profile to stdout; where that has events only, to stderr, unless it goes to a file.
fn print_profile(arguments: &RenderArguments, rendered: &Rendered) -> Result<()> {
    let table = rendered.profile().table(rendered.subject());
    if !arguments.has_events_on_stdout() {
        return super::print(&table).map(|_| ());
    }
    if arguments.profile_json.is_none() {
        for line in table.lines() {
            say!("{line}");
        }
    }
    Ok(())
}

pub(super) fn tell_warnings(events: &Events, warnings: &[Warning]) {
    for warning in warnings {
        let text = advice::of_warning(warning);
        if warning.is_slight() {
            events.note(text);
        } else {
            events.warning(text);
        }
    }
}

fn say_rendered(output: &Path, rendered: &Rendered) {
    let subject = rendered.subject();
    let [width, height] = subject.resolution;
    let (emitted, seconds) = (subject.photons_emitted, rendered.seconds());
    let error = rendered.error();
    say!(
        "{}: {width}x{height}, {} iterations, {emitted} photon paths ({}), {seconds:.1} s ({} photon paths/s) on {}{}",
        output.display(),
        rendered.iterations(),
        subject.counters.photons(),
        with_prefix(emitted as f64 / seconds),
        subject.device.name,
        error.map_or(String::new(), |error| format!("; {error}")),
    );
    if let Some(error) = error.filter(|error| error.waiting > 0.0) {
        say!(
            "{:.2} % of the pixels have received no photon yet: for indirect light there, the error assumes one photon",
            100.0 * error.waiting
        );
    }
}

fn write_json(file: &Path, value: &serde_json::Value) -> Result<()> {
    Ok(film::write_whole(file, &serde_json::to_vec_pretty(value)?)?)
}

/// Backend and gather method: if the user names one of them, the other follows.
fn choose_platform(arguments: &RenderArguments) -> (Platform, usize) {
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

fn config(arguments: &RenderArguments, gather: usize, camera: &Camera) -> RenderConfig {
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
fn default_output(scene: &Path) -> PathBuf {
    let mut name = scene.file_stem().unwrap_or(scene.as_os_str()).to_owned();
    name.push(".exr");
    PathBuf::from(name)
}

fn outputs<'a>(arguments: &'a RenderArguments, output: &'a Path) -> impl Iterator<Item = &'a Path> {
    let others = [
        &arguments.png,
        &arguments.profile_json,
        &arguments.trace,
        &arguments.state,
    ];
    std::iter::once(output).chain(others.into_iter().filter_map(|file| file.as_deref()))
}
