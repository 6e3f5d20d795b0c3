//! What a progressive renderer offers, whatever it runs on.

use crate::config::RenderConfig;
use crate::error::Result;
use crate::film::Image;
use crate::layout::Settings;
use crate::record::Run;
use crate::scene::{Camera, Lens, PackedScene, Projection};

/// A progressive render that is under way.
pub trait Backend {
    /// Does one iteration; returns what its stages took.
    ///
    /// # Errors
    /// Whatever the device can't do.
    fn iterate(&mut self) -> Result<Run>;
    /// The picture so far (eq. 4), and what tells its bias.
    ///
    /// # Errors
    /// Whatever the device can't do.
    fn resolve_all(&mut self) -> Result<Resolved>;
    /// The picture so far.
    ///
    /// # Errors
    /// Whatever the device can't do.
    fn resolve(&mut self) -> Result<Image> {
        self.resolve_all().map(|resolved| resolved.image)
    }
    /// Iterations done.
    fn iterations(&self) -> u32;
    /// Photon paths emitted in all iterations.
    fn emitted(&self) -> u64;
    /// What happened besides the picture.
    fn counters(&self) -> Counters;
    /// The initial radius, render units.
    fn radius(&self) -> f32;
    /// What it runs on.
    fn device(&self) -> DeviceDescription;
}

/// A picture, and what tells its bias.
#[derive(Debug, Clone)]
pub struct Resolved {
    /// The picture.
    pub image: Image,
    /// Of each pixel, its photons' flux weighed with 1 − 2 distance²/R², as radiance: see [`crate::estimate`]. Infinite where
    /// no photon has come yet.
    pub curvature: Vec<f32>,
}

impl Resolved {
    /// Pixels that see a surface to which no photon has come yet.
    pub fn without_photons(&self) -> usize {
        self.curvature
            .iter()
            .filter(|curvature| curvature.is_infinite())
            .count()
    }

    /// From a renderer's film: RGB and curvature, in rows from the top left.
    pub fn from_film(resolution: [u32; 2], film: &[[f32; 4]]) -> Self {
        Self {
            image: Image::from_film(resolution, film),
            curvature: film.iter().map(|pixel| pixel[3]).collect(),
        }
    }
}

/// What a render runs on, for reports.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DeviceDescription {
    /// Name.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Nanoseconds of a timestamp tick.
    pub timestamp_period_ns: f32,
}

/// What happened in a render besides its picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Photons stored in all iterations.
    pub photons_stored: u64,
    /// Paths that the bounce limit ended.
    pub truncated_paths: u64,
    /// Paths that the driver's loop limit ended.
    pub cut_paths: u64,
    /// Values that were NaN or infinite and were left out.
    pub non_finite: u64,
    /// Photons beyond the maximum of a grid cell, which weren't gathered.
    pub lost_photons: u64,
    /// Grid cells that had more photons than their maximum, in all iterations.
    pub full_cells: u64,
    /// Iterations done again because photons didn't fit or the driver cut loops short.
    pub repeated_iterations: u64,
}

impl Counters {
    /// What of it a user has to know, one line each.
    pub fn warnings(&self, emitted: u64, max_depth: u32) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.truncated_paths > 0 {
            warnings.push(format!(
                "{} camera and photon paths reached --max-depth {max_depth} ({emitted} photon paths were emitted); their \
                 further light is missing",
                self.truncated_paths
            ));
        }
        if self.cut_paths > 0 {
            warnings.push(format!(
                "{} paths were ended by the driver's loop limit; their light is missing: use another --device",
                self.cut_paths
            ));
        }
        if self.lost_photons > 0 {
            warnings.push(format!(
                "{} of {} photons were beyond --cell-photons in {} grid cells; their light is missing",
                self.lost_photons, self.photons_stored, self.full_cells
            ));
        }
        if self.non_finite > 0 {
            warnings.push(format!(
                "{} values were NaN or infinite and were left out",
                self.non_finite
            ));
        }
        warnings
    }
}

/// Radii, in render units, between which R² and the flux over it stay far from f32's limits.
const SMALLEST_RADIUS: f64 = 1e-12;
const LARGEST_RADIUS: f64 = 1e6;

/// What the stages read of the configuration, the scene and the camera; the buffers' sizes are left at 0. The initial R²
/// is 0 where it has to be found.
pub fn settings(config: &RenderConfig, scene: &PackedScene, camera: &Camera, loop_limit: u32) -> Settings {
    let [width, height] = config.resolution;
    let (half_height, orthographic) = match camera.projection {
        Projection::Perspective { tan_half_fov } => (tan_half_fov, 0.0),
        Projection::Orthographic { half_height } => (half_height, 1.0),
    };
    let lens = camera.lens.unwrap_or(Lens {
        radius: 0.0,
        focus: 1.0,
    });
    let half_width = half_height * width as f32 / height as f32;
    let with = |v: glam::Vec3, w: f32| [v.x, v.y, v.z, w];
    Settings {
        camera_position: with(camera.position, lens.radius),
        camera_right: with(camera.right * half_width, lens.focus),
        camera_up: with(camera.up * half_height, orthographic),
        camera_forward: with(camera.forward, 0.0),
        resolution: config.resolution,
        slots_per_pixel: 1,
        seed: config.seed,
        light_count: scene.lights.len() as u32,
        instance_count: scene.instances.len() as u32,
        max_depth: config.max_depth,
        triangle_count: scene.own_triangles,
        photon_lanes: 0,
        lane_capacity: 0,
        photon_capacity: 0,
        cell_bits: 0,
        alpha: config.alpha,
        initial_radius2: config.radius.map_or(0.0, |radius| {
            (radius * scene.scale).clamp(SMALLEST_RADIUS, LARGEST_RADIUS).powi(2) as f32
        }),
        loop_limit,
        bsdf_sampling: scene.bsdf_sampling,
    }
}
