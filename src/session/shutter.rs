//! Motion blur: each iteration renders the scene at one time while the shutter is open.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use super::{PreparedScene, Renderer, Session};
use crate::backend::{Backend, DeviceDescription, Figures, Resolved};
use crate::config::{Estimator, RenderConfig, SEQUENCES};
use crate::error::{Error, Result};
use crate::gather::default_method;
use crate::packing::PackedScene;
use crate::pipeline;
use crate::random::pcg4d;
use crate::record::Run;
use crate::scene::{Camera, Scene};
use crate::state::Blocks;

/// A scene that moves while the shutter is open.
pub trait Motion: Send {
    /// The scene and its camera, some part of the way from the shutter's opening (0) to its closing (1). Always in the render space
    /// of the scene that the session was made of, see [`SceneFile::at`](crate::SceneFile::at).
    ///
    /// # Errors
    /// A scene that can't be read.
    fn pose(&mut self, part: f64) -> Result<(Scene, Camera)>;
}

/// The time of an iteration, as a part of the time that the shutter is open. Each of [`SEQUENCES`] has its own sequence over all of
/// it, so that their spread tells the error by few times as well: multiples of the golden ratio from a random start. It is no sequence in
/// base 2, as pixels and lenses have: the same digits in both would tie times to places.
fn part_of(config: &RenderConfig, iteration: u32) -> f64 {
    /// 2³² over the golden ratio.
    const STEP: u32 = 0x9e37_79b9;
    const SHUTTER: u32 = 0x7368_7574;
    let [start, ..] = pcg4d([iteration % SEQUENCES, config.random_seed(), SHUTTER, 0]);
    let place = start.wrapping_add((iteration / SEQUENCES).wrapping_mul(STEP));
    f64::from(place) / 2f64.powi(32)
}

/// The scene at one time, in the device's layout.
type Pose = (PackedScene, Camera);

/// Makes poses.
struct Poses {
    motion: Mutex<Box<dyn Motion>>,
    /// The scene that the session began with.
    first: PackedScene,
}

impl Poses {
    fn at(&self, part: f64) -> Result<Pose> {
        let (scene, camera) = self.motion.lock().unwrap_or_else(PoisonError::into_inner).pose(part)?;
        if scene.normalisation.scale != self.first.scale {
            return Err(Error::Config("the scene moves to another render space".to_owned()));
        }
        let path = scene.files.first().map_or(Path::new(&scene.name), |file| file);
        let packed = self.first.moved(&scene).map_err(|what| Error::scene(path, what))?;
        Ok((packed, camera))
    }
}

/// A renderer of a scene that moves.
pub(super) struct Moving {
    pub renderer: pipeline::Renderer,
    config: RenderConfig,
    poses: Arc<Poses>,
    /// The scene that is on the device, and its iteration.
    shown: PackedScene,
    iteration: Option<u32>,
    /// The pose of a later iteration, which a thread makes while the device renders.
    next: Option<(u32, JoinHandle<Result<Pose>>)>,
}

impl Moving {
    pub fn new(
        renderer: pipeline::Renderer,
        config: RenderConfig,
        scene: &PackedScene,
        motion: Box<dyn Motion>,
    ) -> Self {
        let poses = Poses {
            motion: Mutex::new(motion),
            first: scene.clone(),
        };
        Self {
            renderer,
            config,
            poses: Arc::new(poses),
            shown: scene.clone(),
            iteration: None,
            next: None,
        }
    }

    /// Where everything is when the shutter opens and closes.
    pub fn ends(&self) -> Result<[Pose; 2]> {
        Ok([self.poses.at(0.0)?, self.poses.at(1.0)?])
    }

    /// Shows the scene at an iteration's time.
    fn show(&mut self, iteration: u32) -> Result<()> {
        if self.iteration == Some(iteration) {
            return Ok(());
        }
        let part = part_of(&self.config, iteration);
        let made = match self.next.take() {
            Some((next, thread)) if next == iteration => thread.join().ok(),
            _ => None,
        };
        // A thread that panicked has told so; here it does again.
        let (scene, camera) = made.unwrap_or_else(|| self.poses.at(part))?;
        self.renderer.pose(&self.poses.first, &self.shown, &scene, &camera)?;
        self.iteration = Some(iteration);
        self.shown = scene;
        let (poses, part) = (self.poses.clone(), part_of(&self.config, iteration + 1));
        self.next = Some((iteration + 1, thread::spawn(move || poses.at(part))));
        Ok(())
    }
}

impl Session {
    /// The same session with motion blur: each iteration renders the scene at a time of its own while the shutter is open.
    /// Radii and emission tables are found in `scene`, of which the session was made: that of the middle of the time.
    ///
    /// # Errors
    /// A session on the CPU, one of the estimator `ppm`, whose visible points are found once, or one with a gather method of the paper,
    /// whose grids are those of one scene; a scene that can't be read.
    pub fn moving(self, scene: &PreparedScene, motion: Box<dyn Motion>) -> Result<Self> {
        if self.config.estimator == Estimator::Ppm || self.config.gather != Some(default_method()) {
            let what = "motion blur needs the estimator sppm and the default gather method";
            return Err(Error::Config(what.to_owned()));
        }
        let Renderer::Device(renderer) = self.renderer else {
            return Err(Error::Config("motion blur needs a Vulkan device".to_owned()));
        };
        let moving = Moving::new(*renderer, self.config.clone(), scene.packed(), motion);
        let ends = moving.ends()?;
        Ok(Self {
            identity: self.identity.between(&self.config, &ends),
            renderer: Renderer::Moving(Box::new(moving)),
            ..self
        })
    }
}

impl Backend for Moving {
    fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        self.show(self.renderer.iterations())?;
        self.renderer.iterate_unless(stop)
    }

    fn resolve_all(&mut self) -> Result<Resolved> {
        self.renderer.resolve_all()
    }

    fn save(&mut self) -> Result<Blocks> {
        self.renderer.save()
    }

    fn restore(&mut self, learned: &Blocks) -> Result<()> {
        self.renderer.restore(learned)?;
        // The visible points of its last iteration are found again: at the time of that one.
        if let Some(last) = self.renderer.iterations().checked_sub(1) {
            self.show(last)?;
            self.renderer.restore(learned)?;
        }
        Ok(())
    }

    fn figures(&self) -> &Figures {
        self.renderer.figures()
    }

    fn aims(&self) -> bool {
        self.renderer.aims()
    }

    fn photon_maps(&self) -> u32 {
        self.renderer.photon_maps()
    }

    fn device(&self) -> DeviceDescription {
        self.renderer.device()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sequence_covers_the_shutter() {
        for seed in 0..20 {
            let config = RenderConfig {
                seed,
                ..RenderConfig::default()
            };
            for sequence in 0..SEQUENCES {
                let mut parts: Vec<f64> = (0..40)
                    .map(|turn| part_of(&config, SEQUENCES * turn + sequence))
                    .collect();
                parts.sort_unstable_by(f64::total_cmp);
                let around = parts[0] + 1.0 - parts[39];
                let widest = parts.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max);
                // 34 multiples of the golden ratio g leave gaps of g⁻⁷ and g⁻⁸, and further ones divide the longer ones.
                assert!(widest < 0.0345, "seed {seed}, sequence {sequence}: {widest}");
            }
        }
    }
}
