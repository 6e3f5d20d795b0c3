//! Renders a picture that a device can't render at once, in crops.

use std::sync::Arc;

use anyhow::{Error, Result, bail};
use ppm_vk::{Camera, Denoiser, Hooks, Mosaic, PreparedScene, Progress, RenderConfig, Rendered, Session, Until, crops};

use super::args::RenderArguments;
use super::denoise::denoise;
use super::events::{Event, Phase};
use super::frames::Shot;
use super::outputs::all;
use super::progress::Meter;
use super::render::{Job, tell_once, tell_warnings, write_outputs};
use super::settings::until;
use super::{advice, interrupt};

impl Job<'_> {
    /// Renders crops of a shot one after another, and writes the picture that they make. `too_large` says why the device can't
    /// render it at once.
    pub(super) fn in_crops(
        &self,
        shot: &Shot,
        denoiser: Option<&Denoiser>,
        (scene, camera, config): (&PreparedScene, &Camera, &RenderConfig),
        too_large: &Error,
    ) -> Result<Arc<Rendered>> {
        let (arguments, events) = (self.arguments, &self.watch.events);
        if let Some(flag) = needs_one_piece(arguments) {
            let why = advice::line(too_large);
            bail!("{why}. Without {flag}, the picture is rendered in crops");
        }
        let crops = crops(scene, config, &self.platform)?;
        let [width, height] = config.shown().size;
        say!(
            "{width}x{height} pixels are too many for the device at once: rendering {} crops of {}x{}, one after another",
            crops.len(),
            crops[0].size[0],
            crops[0].size[1]
        );
        let whole = until(arguments);
        let until = Until {
            time: whole.time.map(|time| time / crops.len() as u32),
            ..whole
        };
        let mut mosaic = Mosaic::new(config);
        for (number, &crop) in crops.iter().enumerate() {
            let config = RenderConfig {
                crop: Some(crop),
                ..config.clone()
            };
            let mut session = Session::watched(scene, camera, &config, &self.platform, &|_| ())?;
            if number == 0 {
                tell_once(events, session.warnings());
                events.begin(Phase::Iterate);
            }
            let meter = Meter::new(until, &session);
            let share = |progress: Progress| Progress {
                done: (number as f64 + progress.done) / crops.len() as f64,
                ..progress
            };
            let hooks = Hooks {
                stop: &interrupt::requested,
                progress: &|progress| events.tell(&Event::Iteration(meter.measure(share(progress)))),
                profile: arguments.needs_profile(),
                snapshots: None,
            };
            mosaic.add(session.render_with(until, &hooks)?);
            if interrupt::requested() || mosaic.failure().is_some() {
                let (done, of) = (number + 1, crops.len());
                events.warning(format!(
                    "{done} of {of} crops were rendered; the others are black, with alpha 0"
                ));
                break;
            }
        }
        events.begin(Phase::Write);
        let Some(mut rendered) = mosaic.finish() else {
            bail!("no crop was rendered");
        };
        let denoised = denoise(&mut rendered, denoiser);
        let rendered = Arc::new(rendered);
        self.watch.takers(&shot.files).end(Some(&rendered));
        tell_warnings(events, &rendered.warnings());
        all([write_outputs(arguments, events, &shot.files, &rendered), denoised])?;
        Ok(rendered)
    }
}

/// The flag that needs a picture in one piece.
fn needs_one_piece(arguments: &RenderArguments) -> Option<&'static str> {
    let flags = [
        (arguments.state.is_some(), "--state"),
        (arguments.shutter.is_some(), "--shutter"),
        (arguments.save_every.is_some(), "--save-every"),
        (arguments.view.is_some(), "--view"),
        (arguments.serve.is_some(), "--serve"),
    ];
    flags.into_iter().find_map(|(is_given, flag)| is_given.then_some(flag))
}
