//! What a progressive renderer offers, whatever it runs on.

use crate::config::RenderConfig;
#[cfg(doc)]
use crate::config::SEQUENCES;
use crate::error::Result;
use crate::film::Image;
use crate::layout::{BehindGlass, Settings};
use crate::metrics;
use crate::packing::PackedScene;
use crate::radius::{MOST_FOOTPRINTS, PILOT_FOOTPRINTS};
use crate::record::Run;
use crate::scene::Camera;
use crate::scene::Lens;
use crate::scene::Projection;

/// A progressive render that is under way.
pub trait Backend {
    /// Does one iteration; returns what its stages took.
    ///
    /// # Errors
    /// Whatever the device can't do.
    fn iterate(&mut self) -> Result<Run> {
        self.iterate_unless(&|| false).map(Option::unwrap_or_default)
    }
    /// The same, unless `stop`, which is asked between batches of photon paths, says that there is no time for the rest. An
    /// iteration that is cut short is left out of the picture, and there is none to be returned; but the first one ends with
    /// the paths that it has emitted by then, so that there is a picture.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>>;
    /// The same, of a caller that will do another iteration before it asks for anything else: it may be begun already, so that
    /// the device doesn't wait for the host.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    fn iterate_before_another(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        self.iterate_unless(stop)
    }
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
    /// The median of the initial radii of global photons, render units.
    fn radius(&self) -> f32;
    /// Mean flux of the photons that visible points wanted before the first iteration, not divided by the emitted paths; `None`
    /// where there were none.
    fn photon_flux(&self) -> Option<f64>;
    /// Whether photon paths are aimed.
    fn aims(&self) -> bool;
    /// Photon maps: 2 where caustic photons are gathered apart from the others.
    fn photon_maps(&self) -> u32;
    /// What it runs on.
    fn device(&self) -> DeviceDescription;
}

/// A picture, and what tells its error.
#[derive(Debug, Clone)]
pub struct Resolved {
    /// The picture.
    pub image: Image,
    /// Of each pixel, the share of the camera paths that met a surface.
    pub alpha: Vec<f32>,
    /// Whether no photon has come yet to a pixel's surface, which isn't in the open.
    pub waits: Vec<bool>,
    /// Of each pixel, what tells whether it has its part of the light behind glass.
    pub behind_glass: Vec<BehindGlass>,
    /// RGB and curvature of each pixel by the iterations of each of [`SEQUENCES`] alone: one picture after another.
    pub sequences: Vec<[f32; 4]>,
}

impl Resolved {
    /// From a renderer's films, in rows from the top left: RGB and alpha, negative where a pixel waits; what tells of light behind
    /// glass, and the sequences' pictures.
    pub fn from_film(
        resolution: [u32; 2],
        film: &[[f32; 4]],
        behind_glass: Vec<BehindGlass>,
        sequences: Vec<[f32; 4]>,
    ) -> Self {
        Self {
            image: Image::from_film(resolution, film),
            alpha: film.iter().map(|pixel| pixel[3].abs()).collect(),
            waits: film.iter().map(|pixel| pixel[3] < 0.0).collect(),
            behind_glass,
            sequences,
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
    /// Photons that landed where visible points could be, in all iterations.
    pub photons_landed: u64,
    /// Those of them that a visible point might accept, and that were stored.
    pub photons_stored: u64,
    /// Photons that visible points had accepted when the picture was last made, as often as one did.
    pub photons_accepted: u64,
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
    /// What became of the photons, in words.
    pub fn photons(&self) -> String {
        let Self {
            photons_landed,
            photons_stored,
            photons_accepted,
            ..
        } = self;
        format!("{photons_landed} photons landed, {photons_stored} kept, {photons_accepted} times accepted")
    }
}

/// What relMSE has beside the squared radiance, of the picture so far; 1 of a black one. Photons are wanted by this measure.
pub fn demand_floor2(picture: &Image) -> f32 {
    let floor2 = metrics::floor_of(picture);
    if floor2 > 0.0 { floor2 as f32 } else { 1.0 }
}

/// Radii, in render units, between which R² and the flux over it stay far from f32's limits.
const SMALLEST_RADIUS: f64 = 1e-12;
const LARGEST_RADIUS: f64 = 1e6;

/// What the stages read of the configuration, the scene and the camera; the buffers' sizes are left at 0.
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
    let [right, up] = [camera.right * half_width, camera.up * half_height];
    let larger = 2.0 * half_width.max(half_height);
    let shift = larger * (camera.shift.x * camera.right + camera.shift.y * camera.up);
    // Rays of a perspective camera go through the film at distance 1; those of the other kind begin on it.
    let (position, forward) = if orthographic == 0.0 {
        (camera.position, camera.forward + shift)
    } else {
        (camera.position + shift, camera.forward)
    };
    let with = |v: glam::Vec3, w: f32| [v.x, v.y, v.z, w];
    Settings {
        camera_position: with(position, lens.radius),
        camera_right: with(right, lens.focus),
        camera_up: with(up, orthographic),
        camera_forward: with(forward, 0.0),
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
        first_footprints: [PILOT_FOOTPRINTS; 2],
        most_footprints: if config.radius.is_some() {
            [0.0; 2]
        } else {
            MOST_FOOTPRINTS
        },
        photon_maps: 1,
        pixel_spread: 2.0 * half_height / height as f32,
        demand_floor2: 1.0,
        near_light_count: scene.near_lights.len() as u32,
        light_source_count: scene.light_sources.len() as u32,
        padding0: 0,
        padding1: 0,
        padding2: 0,
        camera_media: scene.immersion.media_at(camera.position),
    }
}
