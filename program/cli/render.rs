//! Renders a scene to files.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};

use ppm_vk::internals::files::Writing;
use ppm_vk::internals::film;
use ppm_vk::{
    Denoiser, EmissionChoice, Hooks, Platform, PreparedScene, Rendered, Scene, SceneFile, Session, Snapshots, State,
    Warning,
};

use super::args::RenderArguments;
use super::denoise::denoise;
use super::events::{Event, Events, Frame, Phase};
use super::frames::{RenderFiles, Shot};
use super::outputs::{all, check_outputs};
use super::progress::{BUILDING, Meter, READING, while_showing, with_prefix};
use super::scene::tell_remarks;
use super::settings::{camera, choose_platform, config, default_output, until};
use super::shutter::{Exposure, render_space};
use super::watch::Watch;
use super::{Outcome, advice, interrupt};

/// The render command.
pub fn render(arguments: &RenderArguments) -> Result<Outcome> {
    let path = arguments.scene.as_deref().context("--scene is missing")?;
    let (platform, gather) = choose_platform(arguments);
    let output = arguments.output.clone().unwrap_or_else(|| default_output(path));
    let watch = Watch::new(arguments, &output);
    let job = Job {
        arguments,
        path,
        shots: Shot::all(arguments, &output),
        file: Cell::new(None),
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
    shots: Vec<Shot>,
    /// The scene's file, between two frames.
    file: Cell<Option<SceneFile>>,
    pub platform: Platform,
    gather: usize,
    pub watch: &'a Watch<'a>,
}

/// A shot that is done, and whose files are written.
struct Made {
    /// `None` if it was rendered in crops.
    session: Option<Session>,
    rendered: Arc<Rendered>,
    frame: Option<u32>,
}

impl Job<'_> {
    fn run(&self) -> Result<Outcome> {
        let Self { arguments, path, .. } = *self;
        // Before any work: fail early if a picture can't be written.
        for shot in &self.shots {
            check_outputs(&arguments.read.inputs(path), shot.files.all())?;
        }
        let denoiser = arguments.denoise.open()?;
        interrupt::install()?;
        let mut made: Option<Made> = None;
        for shot in &self.shots {
            if made.is_some() && interrupt::requested() {
                break;
            }
            shot.begin(&self.watch.events);
            let next = self.make(shot, denoiser.as_ref(), made);
            made = Some(match shot.frame {
                Some(Frame { frame, .. }) => next.with_context(|| format!("frame {frame}"))?,
                None => next?,
            });
        }
        Ok(if interrupt::requested() {
            Outcome::Interrupted
        } else {
            Outcome::Done
        })
    }

    /// Renders a shot and writes its files. `before`: the frame before it.
    fn make(&self, shot: &Shot, denoiser: Option<&Denoiser>, before: Option<Made>) -> Result<Made> {
        let Self {
            arguments, path, watch, ..
        } = *self;
        let events = &watch.events;
        let quiet = arguments.quiet || arguments.has_events_on_stdout();
        events.begin(Phase::Load);
        let scene = while_showing(READING, quiet, || self.read(shot))?;
        let mut inputs = arguments.read.inputs(path);
        inputs.extend(scene.files.iter().map(PathBuf::as_path));
        check_outputs(&inputs, shot.files.all())?;
        tell_remarks(&scene, events);
        let (camera, index) = camera(arguments, &scene)?;
        let config = config(arguments, self.gather, &camera);
        events.begin(Phase::Build);
        let prepared = while_showing(BUILDING, quiet, || PreparedScene::new(&scene))?;
        for note in prepared.notes() {
            events.note_once(note.clone());
        }
        // A state is of this frame alone, and may have more iterations.
        let is_still = |made: &Made| {
            let session = made.session.as_ref();
            shot.files.state.is_none()
                && shot.shutter.is_none()
                && session.is_some_and(|session| session.is_of(&prepared, &camera, &config))
        };
        let before = match before {
            Some(made) if is_still(&made) => return self.repeat(shot, made),
            before => before,
        };
        let begins = |phase: ppm_vk::Phase| match phase {
            ppm_vk::Phase::Compile => events.begin(Phase::Compile),
            ppm_vk::Phase::Pilot => events.begin(Phase::Pilot),
            _ => {}
        };
        let expose = |session: Session| -> Result<Session> {
            let Some(times) = shot.shutter else { return Ok(session) };
            let motion = Exposure::new(&arguments.read, path, times, (&scene, index), &camera)?;
            Ok(session.moving(&prepared, Box::new(motion))?)
        };
        let open = || expose(Session::watched(&prepared, &camera, &config, &self.platform, &begins)?);
        let (session, before) = match before {
            Some(Made {
                session: Some(session),
                rendered,
                ..
            }) => (
                session
                    .next(&prepared, &camera, &config, &begins)
                    .map_err(anyhow::Error::from)
                    .and_then(expose),
                Some(rendered),
            ),
            Some(Made { rendered, .. }) => (open(), Some(rendered)),
            None => (open(), None),
        };
        let frame = shot.frame.map(|frame| frame.frame);
        let mut session = match session {
            Err(error) if is_picture_too_large(&error) => {
                let rendered = self.in_crops(shot, denoiser, (&prepared, &camera, &config), &error)?;
                shot.tell_done(events, &rendered, before.as_deref(), None);
                return Ok(Made {
                    session: None,
                    rendered,
                    frame,
                });
            }
            session => session?,
        };
        tell_once(events, session.warnings());
        if let Some(state) = &shot.files.state {
            begin_with_state(events, &mut session, state, arguments.resume)?;
        }
        say_how(arguments, events, &session);

        let until = until(arguments);
        let takers = watch.takers(&shot.files);
        let meter = Meter::new(until, &session);
        let hooks = Hooks {
            stop: &interrupt::requested,
            progress: &|progress| events.tell(&Event::Iteration(meter.measure(progress))),
            profile: arguments.needs_profile(),
            snapshots: Some(Snapshots {
                wanted: &|| takers.want(),
                take: &|snapshot| takers.take(&snapshot),
            }),
        };
        events.begin(Phase::Iterate);
        let mut rendered = session.render_with(until, &hooks);
        if let Some(state) = shot.files.state.as_deref().filter(|_| is_device_lost(&rendered)) {
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
        let denoised = rendered.as_mut().map_or(Ok(()), |rendered| denoise(rendered, denoiser));
        let rendered = rendered.map(Arc::new);
        takers.end(rendered.as_ref().ok());
        let rendered = rendered?;
        tell_warnings(events, &rendered.warnings());
        let state = shot.files.state.as_ref().filter(|_| rendered.failure().is_none());
        let state = state.map(|file| {
            session.state()?.write(file)?;
            events.written(file, session.iterations());
            Ok(())
        });
        all([write_outputs(arguments, events, &shot.files, &rendered), denoised]
            .into_iter()
            .chain(state))?;
        shot.tell_done(events, &rendered, before.as_deref(), None);
        Ok(Made {
            session: Some(session),
            rendered,
            frame,
        })
    }

    /// Reads the scene of a shot: that of the middle of the time in which the shutter is open.
    fn read(&self, shot: &Shot) -> Result<Scene> {
        let read = &self.arguments.read;
        let mut file = self.file.take().map_or_else(|| read.open(self.path), Ok)?;
        let scene = match shot.shutter {
            None => read.scene_at(&mut file, shot.time, None)?,
            Some([open, close]) => {
                let space = render_space(&mut file, [open, close])?;
                read.scene_at(&mut file, Some(0.5 * (open + close)), Some(space))?
            }
        };
        if self.shots.len() > 1 {
            self.file.set(Some(file));
        }
        Ok(scene)
    }

    /// Writes the picture of the frame before: nothing has moved since, and another render would have the same bits.
    fn repeat(&self, shot: &Shot, made: Made) -> Result<Made> {
        let events = &self.watch.events;
        events.begin(Phase::Write);
        write_outputs(self.arguments, events, &shot.files, &made.rendered)?;
        shot.tell_done(events, &made.rendered, Some(&made.rendered), made.frame);
        Ok(made)
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

fn is_picture_too_large(error: &anyhow::Error) -> bool {
    let error = error.downcast_ref::<ppm_vk::Error>();
    error.is_some_and(ppm_vk::Error::is_picture_too_large)
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
    files: &RenderFiles,
    rendered: &Rendered,
) -> Result<()> {
    let _writing = Writing::begin();
    let iterations = rendered.iterations();
    let pictures = arguments
        .picture_files(files)
        .write(rendered, |file| events.written(file, iterations));
    if pictures[0].is_ok() {
        say_rendered(&files.exr, rendered);
    }
    let (profile, subject) = (rendered.profile(), rendered.subject());
    let json = |file: &Option<PathBuf>, value: &dyn Fn() -> serde_json::Value| {
        file.as_ref()
            .map(|file| write_json(file, &value()).map(|()| events.written(file, iterations)))
    };
    let written = [
        rendered.failure().map(|failure| Err(advice::of_failure(failure))),
        arguments.profile.then(|| print_profile(arguments, rendered)),
        json(&files.profile_json, &|| profile.json(subject)),
        json(&files.trace, &|| profile.trace(subject)),
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

/// Tells of warnings about a picture.
pub(super) fn tell_warnings<'a>(events: &Events, warnings: impl IntoIterator<Item = &'a Warning>) {
    for warning in warnings {
        let text = advice::of_warning(warning);
        if warning.is_slight() {
            events.note(text);
        } else {
            events.warning(text);
        }
    }
}

/// Tells of those that were not told of another frame.
pub(super) fn tell_once(events: &Events, warnings: &[Warning]) {
    let is_new = |warning: &&Warning| events.is_new(&advice::of_warning(warning));
    tell_warnings(events, warnings.iter().filter(is_new));
}

/// Says how photons are gathered and start.
fn say_how(arguments: &RenderArguments, events: &Events, session: &Session) {
    if arguments.radius.is_none() {
        say!("initial radius {:.6} scene units (automatic)", session.radius());
    }
    let by_power =
        "photon paths start in proportion to the lights' power: aiming does not pay for its cost in this scene";
    if session.config().emission == EmissionChoice::Aimed && !session.is_aimed() && events.is_new(by_power) {
        say!("{by_power}");
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
