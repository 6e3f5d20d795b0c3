//! The interface of progressive renderers, on a device or on the CPU.

#[cfg(doc)]
use crate::config::SEQUENCES;
use crate::config::{RenderConfig, Totals};
use crate::error::Result;
use crate::film::Image;
#[cfg(doc)]
use crate::layout::IDS_OF_PIXEL;
use crate::layout::{BehindGlass, IdCount, LightParts, Settings, SurfaceSum};
use crate::metrics;
use crate::packing::PackedScene;
use crate::radius::{MOST_FOOTPRINTS, PILOT_FOOTPRINTS};
use crate::record::Run;
use crate::scene::{Camera, Lens, Projection};
use crate::state::Blocks;

/// What a session does before its first iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// It uploads the scene and compiles the kernels.
    Compile,
    /// It finds the first visible points, where photons are needed, and the radii.
    Pilot,
}

/// A progressive render.
pub trait Backend {
    /// Runs one iteration; returns the times of its stages.
    ///
    /// # Errors
    /// Whatever the device can't do.
    fn iterate(&mut self) -> Result<Run> {
        self.iterate_unless(&|| false).map(Option::unwrap_or_default)
    }
    /// The same, unless `stop`, which is called between batches of photon paths, interrupts it. An interrupted iteration is left
    /// out of the picture, and `None` is returned; but the first one ends with the paths that it has emitted, so that there is a
    /// picture.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    fn iterate_unless(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>>;
    /// The same for a caller that runs another iteration before any other request: that one may be submitted ahead, so that the
    /// device does not wait for the host.
    ///
    /// # Errors
    /// As [`Backend::iterate`].
    fn iterate_before_another(&mut self, stop: &dyn Fn() -> bool) -> Result<Option<Run>> {
        self.iterate_unless(stop)
    }
    /// The picture so far (equation 4), and the data for its error.
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
    /// What it has learned: another renderer of the same scene with the same settings can go on with it.
    ///
    /// # Errors
    /// Whatever the device can't do.
    fn save(&mut self) -> Result<Blocks>;
    /// Goes on from what another renderer has learned: further iterations have the same bits as that one's on the same device.
    ///
    /// # Errors
    /// Blocks of another kind of renderer or picture; whatever the device can't do.
    fn restore(&mut self, learned: &Blocks) -> Result<()>;
    /// Its figures so far.
    fn figures(&self) -> &Figures;
    /// Totals of all iterations.
    fn totals(&self) -> Totals {
        self.figures().totals
    }
    /// Iterations done.
    fn iterations(&self) -> u32 {
        self.totals().iterations
    }
    /// Photon paths emitted in all iterations.
    fn emitted(&self) -> u64 {
        self.totals().emitted
    }
    /// Counters of the render.
    fn counters(&self) -> Counters {
        self.figures().counters
    }
    /// The median of the initial radii of global photons, render units.
    fn radius(&self) -> f32 {
        self.figures().radius
    }
    /// Mean flux of the photons that visible points accepted before the first iteration, not divided by the emitted paths; `None`
    /// if there were none.
    fn photon_flux(&self) -> Option<f64> {
        self.figures().photon_flux
    }
    /// Whether photon paths are aimed.
    fn aims(&self) -> bool;
    /// Number of photon maps: 2 if caustic photons have one of their own.
    fn photon_maps(&self) -> u32;
    /// The device that it runs on.
    fn device(&self) -> DeviceDescription;
}

/// A picture, and the data for its error.
#[derive(Debug, Clone)]
pub struct Resolved {
    /// The picture.
    pub image: Image,
    /// For each pixel, the share of the camera paths that met a surface.
    pub alpha: Vec<f32>,
    /// Whether a pixel's surface, which is not in the open, has received no photon yet.
    pub waits: Vec<bool>,
    /// For each pixel, the data for the missing light behind glass.
    pub behind_glass: Vec<BehindGlass>,
    /// RGB and curvature of each pixel by the iterations of each of [`SEQUENCES`] alone: one picture after another.
    pub sequences: Vec<[f32; 4]>,
    /// Data for layers.
    pub layers: LayerFilms,
}

/// Data for a picture's layers, in rows from the top left; empty if no layer needs it.
#[derive(Debug, Clone, Default)]
pub struct LayerFilms {
    /// What camera paths meet.
    pub surfaces: Vec<SurfaceSum>,
    /// [`IDS_OF_PIXEL`] objects and as many materials a pixel.
    pub ids: Vec<IdCount>,
    /// Radiance by the way that light takes.
    pub light: Vec<LightParts>,
}

impl Resolved {
    /// From a renderer's films, in rows from the top left: RGB and alpha, negative if a pixel waits for its first photon; the
    /// data for light behind glass; the pictures of the sequences.
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
            layers: LayerFilms::default(),
        }
    }
}

/// The device of a render, for reports.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DeviceDescription {
    /// Name.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Nanoseconds of a timestamp tick.
    pub timestamp_period_ns: f32,
}

/// Figures of a render so far, the same on a device and on the CPU.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct Figures {
    /// See [`Backend::totals`].
    pub totals: Totals,
    /// See [`Backend::counters`].
    pub counters: Counters,
    /// See [`Backend::radius`].
    pub radius: f32,
    /// See [`Backend::photon_flux`].
    pub photon_flux: Option<f64>,
}

/// Counters of a render.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Photons that landed on surfaces that can have visible points, in all iterations.
    pub photons_landed: u64,
    /// Those that a visible point might accept, and that were stored.
    pub photons_stored: u64,
    /// Photons accepted by visible points when the picture was last made, counted once per visible point.
    pub photons_accepted: u64,
    /// Paths that the bounce limit ended.
    pub truncated_paths: u64,
    /// Paths that the driver's loop limit ended.
    pub cut_paths: u64,
    /// Values that were NaN or infinite and were left out.
    pub non_finite: u64,
    /// Photons beyond the maximum of a grid cell, which were not gathered.
    pub lost_photons: u64,
    /// Grid cells that had more photons than their maximum, in all iterations.
    pub full_cells: u64,
    /// Iterations that were repeated because photons did not fit or the driver cut loops short.
    pub repeated_iterations: u64,
}

impl Counters {
    /// Adds those of another part of a render.
    pub fn add(&mut self, other: &Self) {
        // Every field: one that is added has to be added up here.
        let Self {
            photons_landed,
            photons_stored,
            photons_accepted,
            truncated_paths,
            cut_paths,
            non_finite,
            lost_photons,
            full_cells,
            repeated_iterations,
        } = other;
        self.photons_landed += photons_landed;
        self.photons_stored += photons_stored;
        self.photons_accepted += photons_accepted;
        self.truncated_paths += truncated_paths;
        self.cut_paths += cut_paths;
        self.non_finite += non_finite;
        self.lost_photons += lost_photons;
        self.full_cells += full_cells;
        self.repeated_iterations += repeated_iterations;
    }

    /// A summary of the photons, as text.
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

/// relMSE's denominator without the squared radiance, for the picture so far; 1 for a black one. Demand for photons uses it.
pub fn demand_floor2(picture: &Image) -> f32 {
    let floor2 = metrics::floor_of(picture);
    if floor2 > 0.0 { floor2 as f32 } else { 1.0 }
}

/// Radii, in render units, between which R² and the flux over it stay far from f32's limits.
const SMALLEST_RADIUS: f64 = 1e-12;
const LARGEST_RADIUS: f64 = 1e6;

/// The kernels' settings from the configuration, the scene and the camera; buffer sizes remain 0.
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
    // Rays of a perspective camera pass the film at distance 1; those of an orthographic camera begin on it.
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
        seed: config.random_seed(),
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
            let radius2 = (radius * scene.scale).clamp(SMALLEST_RADIUS, LARGEST_RADIUS).powi(2) as f32;
            radius2 * config.part.radius2_factor(config.alpha)
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
        guide_step: config.guides().step,
        guides: config.guides().size,
        region_origin: config.region().origin,
        region_size: config.region().size,
        filter_places: bytemuck::cast(config.filter.places()),
        camera_media: scene.immersion.media_at(camera.position),
    }
}
