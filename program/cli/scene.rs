//! Common parts of the commands that read a scene.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use clap::Args;

use super::advice;
use super::args::{choice, number, positive};
use super::events::Events;
use super::progress::{READING, while_showing};
use ppm_vk::internals::loader::MEMORY_LIMIT;
use ppm_vk::{Environment, LightUnits, LoadOptions, Normalisation, Scene, SceneFile};

/// Arguments for reading a scene.
#[derive(Debug, Args)]
pub struct SceneArguments {
    /// Environment lighting: an equirectangular picture (.hdr or .exr) or one radiance (R,G,B) [default: none, or 1,1,1 for a
    /// scene without any light].
    #[arg(long, value_name = "FILE|R,G,B", value_parser = environment)]
    environment: Option<EnvironmentChoice>,
    /// Rotate the environment about +Y, from +Z towards +X. 90 matches Blender's world.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        value_parser = finite
    )]
    environment_rotation: f64,
    /// Multiply the environment's radiance.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 1.0,
        allow_negative_numbers = true,
        value_parser = positive
    )]
    environment_strength: f64,
    /// Units of points, spots and suns (KHR_lights_punctual): those of the specification; 683 times as large, as Blender's
    /// exporter writes them except with «Unitless»; or by the exporter that the file names.
    #[arg(long, default_value_t, value_parser = choice::<LightUnits>())]
    light_units: LightUnits,
    /// Treat closed meshes of glass without a volume (only KHR_materials_transmission, as Blender exports glass) as solid
    /// [default: thin walls, as in glTF].
    #[arg(long)]
    solid_glass: bool,
    /// Angular diameter of directional lights, in degrees: shadows have soft edges, and mirrors show a disc.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, value_parser = sun_angle)]
    sun_angle: f64,
    /// Radius of points and spots, in scene units: they emit, and look, like balls.
    #[arg(long, value_name = "R", default_value_t = 0.0, allow_negative_numbers = true, value_parser = light_radius)]
    light_radius: f64,
    /// Apply the scene's animations at this time, in seconds [default: everything at rest].
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub frame_time: Option<f64>,
    /// Maximum memory of the scene while it is read: buffers, geometry, images, environment. A small file can request any amount
    /// [default: 2].
    #[arg(long, value_name = "GIB", allow_negative_numbers = true, value_parser = positive)]
    memory_limit: Option<f64>,
    /// Materials of this variant (ppm-vk inspect lists a scene's) [default: each mesh's own].
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Scene of a file that has several [default: the file's default scene, or the first one with a mesh].
    #[arg(long, value_name = "NAME|INDEX")]
    scene_name: Option<String>,
}

/// The value of `--environment`.
#[derive(Debug, Clone, PartialEq)]
enum EnvironmentChoice {
    /// One radiance, linear RGB.
    Constant([f32; 3]),
    /// A picture.
    Picture(PathBuf),
}

impl SceneArguments {
    /// The files that are read, including the scene.
    pub fn inputs<'a>(&'a self, scene: &'a Path) -> Vec<&'a Path> {
        let mut inputs = vec![scene];
        if let Some(EnvironmentChoice::Picture(picture)) = &self.environment {
            inputs.push(picture);
        }
        inputs
    }

    /// Reads the scene.
    pub fn load(&self, path: &Path, quiet: bool) -> Result<Scene> {
        while_showing(READING, quiet, || {
            self.scene_at(&mut self.open(path)?, self.frame_time, None)
        })
    }

    /// The scene at a time of its animations, in a render space.
    pub fn scene_at(
        &self,
        file: &mut SceneFile,
        time: Option<f64>,
        render_space: Option<Normalisation>,
    ) -> Result<Scene> {
        let mut scene = file.at(time, render_space)?;
        self.place_environment(&mut scene)?;
        Ok(scene)
    }

    /// Opens the scene's file.
    pub fn open(&self, path: &Path) -> Result<SceneFile> {
        let memory_limit = self
            .memory_limit
            .map_or(MEMORY_LIMIT, |gibibytes| (gibibytes * f64::from(1 << 30)) as u64);
        let environment = match &self.environment {
            None => None,
            Some(EnvironmentChoice::Constant(radiance)) => Some(Environment::constant((*radiance).into())),
            Some(EnvironmentChoice::Picture(picture)) => Some(Environment::read(picture, memory_limit)?),
        };
        let options = LoadOptions {
            frame_time: self.frame_time,
            environment,
            memory_limit: Some(memory_limit),
            variant: self.variant.clone(),
            scene: self.scene_name.clone(),
            light_units: self.light_units,
            solid_glass: self.solid_glass,
            sun_angle: self.sun_angle,
            light_radius: self.light_radius,
        };
        Ok(SceneFile::open(path, options)?)
    }

    /// Scales and rotates the environment, also the default one of a scene without lights.
    fn place_environment(&self, scene: &mut Scene) -> Result<()> {
        let is_asked = [self.environment_rotation != 0.0, self.environment_strength != 1.0];
        if let Some(environment) = scene.environment.take() {
            let scaled = environment.scaled(self.environment_strength);
            let scaled = scaled.map_err(|what| anyhow!("--environment-strength: {what}"))?;
            scene.environment = Some(scaled.rotated(self.environment_rotation));
        } else if is_asked != [false; 2] {
            let flags = ["--environment-rotation", "--environment-strength"];
            let flags: Vec<&str> = flags
                .into_iter()
                .zip(is_asked)
                .filter(|(_, is)| *is)
                .map(|(flag, _)| flag)
                .collect();
            let note = format!(
                "{} without effect: there is no environment (--environment FILE or R,G,B)",
                match flags[..] {
                    [one] => format!("{one} is"),
                    _ => format!("{} are", flags.join(" and ")),
                }
            );
            scene.notes.push(note.into());
        }
        Ok(())
    }
}

/// Prints the notes and warnings of a scene.
pub fn say_remarks(scene: &Scene) {
    tell_remarks(scene, &Events::new(Vec::new()));
}

/// Tells of them.
pub fn tell_remarks(scene: &Scene, events: &Events) {
    for note in &scene.notes {
        events.note_once(advice::of_remark(note));
    }
    for warning in &scene.warnings {
        events.warning_once(advice::of_remark(warning));
    }
}

/// Three numbers, or otherwise the name of a file.
fn environment(text: &str) -> Result<EnvironmentChoice, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let Some(Ok(radiance)) = numbers.map(<[f32; 3]>::try_from) else {
        return Ok(EnvironmentChoice::Picture(text.into()));
    };
    let is_radiance = radiance.iter().all(|value| value.is_finite() && *value >= 0.0);
    if is_radiance && radiance != [0.0; 3] {
        Ok(EnvironmentChoice::Constant(radiance))
    } else {
        Err("a radiance must be finite and not negative, and above 0 in one channel".to_owned())
    }
}

fn sun_angle(text: &str) -> Result<f64, String> {
    let degrees = number(text)?;
    if (0.0..=180.0).contains(&degrees) {
        Ok(degrees)
    } else {
        Err("must lie between 0 and 180".to_owned())
    }
}

fn light_radius(text: &str) -> Result<f64, String> {
    let radius = number(text)?;
    if radius >= 0.0 && radius.is_finite() {
        Ok(radius)
    } else {
        Err("must be finite and not negative".to_owned())
    }
}

fn finite(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err("must be finite".to_owned())
    }
}
