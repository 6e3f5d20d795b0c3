//! Motion blur: where the scene and the camera are while the shutter is open.

use std::path::Path;

use anyhow::Result;
use glam::Vec2;

use super::args::number;
use super::scene::SceneArguments;
use ppm_vk::{Camera, Environment, Lens, Motion, Normalisation, Scene, SceneFile};

/// Times at which the bounds of what moves are measured; between them it may go a little farther.
const PROBES: u32 = 9;
/// Longest time before or after a frame, in frames.
const FARTHEST: f64 = 1000.0;

/// When the shutter opens and closes, in frames from the time of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shutter {
    open: f64,
    close: f64,
}

impl Shutter {
    /// Parses OPEN,CLOSE.
    pub fn parse(text: &str) -> Result<Self, String> {
        let times = text
            .split_once(',')
            .and_then(|(open, close)| Some((number(open.trim()).ok()?, number(close.trim()).ok()?)));
        let (open, close) = times.ok_or("expected OPEN,CLOSE in frames, such as -0.25,0.25")?;
        if ![open, close].iter().all(|time| time.abs() <= FARTHEST) {
            return Err(format!("both must lie between -{FARTHEST} and {FARTHEST} frames"));
        }
        if close <= open {
            return Err("it has to close after it opens".to_owned());
        }
        Ok(Self { open, close })
    }

    /// The times in the scene's animations, in seconds.
    pub fn around(self, time: f64, fps: f64) -> [f64; 2] {
        [self.open, self.close].map(|of_shutter| time + of_shutter / fps)
    }
}

/// The render space of a file's scene from one time to another.
///
/// # Errors
/// A scene that can't be read.
pub fn render_space(file: &mut SceneFile, [open, close]: [f64; 2]) -> Result<Normalisation> {
    let spaces = (0..PROBES).map(|probe| {
        let part = f64::from(probe) / f64::from(PROBES - 1);
        Ok(file.at(Some(open + part * (close - open)), None)?.normalisation)
    });
    Ok(Normalisation::around(&spaces.collect::<Result<Vec<_>>>()?))
}

/// A scene's file while the shutter is open. Its lens, film and environment do not move.
pub struct Exposure {
    file: SceneFile,
    times: [f64; 2],
    render_space: Normalisation,
    environment: Option<Environment>,
    camera: usize,
    lens: Option<Lens>,
    shift: Vec2,
}

impl Exposure {
    /// Of a file between two times. `scene` and `camera`: those of the middle, by which the session was made.
    ///
    /// # Errors
    /// A file that can't be read.
    pub fn new(
        read: &SceneArguments,
        path: &Path,
        times: [f64; 2],
        (scene, index): (&Scene, usize),
        camera: &Camera,
    ) -> Result<Self> {
        Ok(Self {
            file: read.open(path)?,
            times,
            render_space: scene.normalisation,
            environment: scene.environment.clone(),
            camera: index,
            lens: camera.lens,
            shift: camera.shift,
        })
    }
}

impl Motion for Exposure {
    fn pose(&mut self, part: f64) -> ppm_vk::Result<(Scene, Camera)> {
        let [open, close] = self.times;
        let mut scene = self
            .file
            .at(Some(open + part * (close - open)), Some(self.render_space))?;
        scene.environment.clone_from(&self.environment);
        let camera = Camera {
            lens: self.lens,
            shift: self.shift,
            ..scene.cameras[self.camera].clone()
        };
        Ok((scene, camera))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shutter_is_given_in_frames() {
        let shutter = Shutter::parse("-0.25, 0.5").expect("a shutter");
        assert_eq!(shutter.around(2.0, 10.0), [1.975, 2.05]);
        for (text, word) in [
            ("0.5", "OPEN,CLOSE"),
            ("0,x", "OPEN,CLOSE"),
            ("0.5,0.5", "close"),
            ("nan,1", "between"),
            ("0,1e9", "between"),
        ] {
            let error = Shutter::parse(text).expect_err(text);
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
