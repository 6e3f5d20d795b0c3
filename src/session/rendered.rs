//! The result of a render.

use std::fmt;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use super::Warning;
use super::layers::{LayersOf, SceneNames};
use super::state::Identity;
use super::work::Done;
use crate::backend::{DeviceDescription, Resolved};
use crate::config::{Layers, Region, RenderConfig, SequenceIterations};
use crate::denoise::{self, Denoiser, Guides};
use crate::error::{Error, Result};
#[cfg(test)]
use crate::estimate::OnePhoton;
use crate::estimate::{ErrorEstimate, RelativeError};
use crate::film::{self, Additions, Image, Look, Metadata, ViewLayer};
use crate::layout::SurfaceSum;
use crate::report::{Profile, Subject};

/// The failure that ended a render early.
#[derive(Debug)]
pub struct Failure {
    /// The error.
    pub error: Error,
    /// The iteration that failed, counted from 1.
    pub iteration: u32,
    /// Number of iterations in the picture.
    pub kept: u32,
}

impl Failure {
    /// What it means for the picture, in one line.
    pub fn consequence(&self) -> String {
        let Self { iteration, kept, .. } = self;
        format!("iteration {iteration} failed, and the picture is that of the first {kept}")
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(text, "{}: {}", self.error, self.consequence())
    }
}

/// What is known of a render before it begins.
pub(super) struct About {
    pub scene: String,
    pub names: Arc<SceneNames>,
    pub config: RenderConfig,
    pub gather: &'static str,
    pub device: DeviceDescription,
    pub estimate: ErrorEstimate,
    /// Rendering time before.
    pub spent: Duration,
    pub identity: Identity,
}

#[cfg(test)]
impl About {
    /// For tests of the work alone.
    pub fn of_nothing() -> Self {
        let config = RenderConfig::default();
        Self {
            scene: String::new(),
            names: Arc::default(),
            gather: "",
            device: DeviceDescription {
                name: String::new(),
                driver: String::new(),
                timestamp_period_ns: 1.0,
            },
            estimate: ErrorEstimate::new(&config, OnePhoton::default()),
            config,
            spent: Duration::ZERO,
            identity: Identity::default(),
        }
    }
}

/// What a [`Rendered`] is made of.
pub(super) struct Of {
    pub picture: Arc<Resolved>,
    pub layers: Layers,
    /// What it shows of a picture of this size.
    pub shown: Region,
    pub resolution: [u32; 2],
    pub names: Arc<SceneNames>,
    /// Without the error.
    pub metadata: Metadata,
    pub iterations: SequenceIterations,
    pub estimate: ErrorEstimate,
    pub subject: Subject,
    /// Camera paths of each pixel.
    pub samples: u32,
    pub max_depth: u32,
    pub profile: Profile,
    pub failure: Option<Failure>,
    /// Errors that are known by other means than the estimate.
    pub given: Option<GivenErrors>,
}

/// The errors of a picture that was put together.
pub(super) struct GivenErrors {
    pub of_pixels: Option<Image>,
    pub relative: Option<RelativeError>,
}

/// A picture with its errors, warnings and profile.
pub struct Rendered {
    of: Of,
    /// Estimated when it is first asked for: many snapshots need it on another thread than the render's, or never.
    error: OnceLock<Option<RelativeError>>,
    denoised: Option<Denoised>,
}

struct Denoised {
    image: Image,
    by: String,
}

impl From<Of> for Rendered {
    fn from(of: Of) -> Self {
        Self {
            of,
            error: OnceLock::new(),
            denoised: None,
        }
    }
}

impl Rendered {
    pub(super) fn new(about: &About, done: Done) -> Self {
        let subject = Subject {
            scene: about.scene.clone(),
            resolution: about.config.shown().size,
            gather: about.gather.to_owned(),
            photons: about.config.photons,
            photons_emitted: done.emitted,
            device: about.device.clone(),
            counters: done.counters,
        };
        Self::from(Of {
            metadata: Metadata {
                iterations: u64::from(done.iterations),
                photons_emitted: done.emitted,
                seed: u64::from(about.config.seed),
                device: subject.device.name.clone(),
                seconds: about.spent.as_secs_f64() + done.seconds,
                estimated_error: None,
                denoised_by: None,
            },
            iterations: done.iterations.into(),
            picture: done.picture,
            layers: about.config.layers,
            shown: about.config.shown(),
            resolution: about.config.resolution,
            names: about.names.clone(),
            samples: about.config.camera_paths() * done.iterations,
            estimate: about.estimate,
            subject,
            max_depth: about.config.max_depth,
            profile: done.profile,
            failure: done.failure,
            given: None,
        })
    }

    /// The picture: without its noise, if that has been [removed](Self::denoise).
    pub fn image(&self) -> &Image {
        self.denoised.as_ref().map_or(self.noisy(), |denoised| &denoised.image)
    }

    /// The picture as it was rendered. Errors and warnings are of this one.
    pub fn noisy(&self) -> &Image {
        &self.of.picture.image
    }

    /// Removes the picture's noise. Where its estimated error is smaller than what that changes, the picture is kept.
    ///
    /// # Errors
    /// As [`Denoiser::denoise`]. The picture stays as it is.
    pub fn denoise(&mut self, denoiser: &Denoiser) -> Result<()> {
        let guides = self.guides();
        let guides = guides.as_ref().map(|[albedo, normal]| Guides { albedo, normal });
        let denoised = denoiser.denoise(self.noisy(), guides)?;
        let image = match self.pixel_errors() {
            Some(errors) => denoise::blend(self.noisy(), &denoised, &errors),
            None => denoised,
        };
        let by = denoiser.name();
        self.denoised = Some(Denoised { image, by });
        Ok(())
    }

    /// Albedo and normals of what the picture shows, if it has layers that need them.
    fn guides(&self) -> Option<[Image; 2]> {
        let surfaces = &self.of.picture.layers.surfaces;
        let (width, height) = (self.noisy().width(), self.noisy().height());
        let image = |of: fn(&SurfaceSum) -> [f32; 3]| Image::new(width, height, surfaces.iter().map(of).collect());
        (!surfaces.is_empty()).then(|| [image(SurfaceSum::mean_albedo), image(SurfaceSum::mean_normal)])
    }

    /// Of each pixel, the share of its camera paths that met a surface.
    pub fn alpha(&self) -> &[f32] {
        &self.of.picture.alpha
    }

    /// What it shows of the whole picture.
    pub fn shown(&self) -> Region {
        self.of.shown
    }

    pub(super) fn into_parts(self) -> Of {
        self.of
    }

    /// Iterations in it.
    pub fn iterations(&self) -> u32 {
        self.of.metadata.iterations as u32
    }

    /// Seconds of rendering.
    pub fn seconds(&self) -> f64 {
        self.of.metadata.seconds
    }

    /// Its estimated error; `None` after fewer than four iterations, and if it is black.
    pub fn error(&self) -> Option<RelativeError> {
        let Of {
            estimate,
            iterations,
            picture,
            given,
            ..
        } = &self.of;
        if let Some(given) = given {
            return given.relative;
        }
        *self.error.get_or_init(|| estimate.relative(*iterations, picture))
    }

    /// The estimated error of each pixel, in units of radiance; `None` as in [`Rendered::error`].
    pub fn pixel_errors(&self) -> Option<Image> {
        match &self.of.given {
            Some(given) => given.of_pixels.clone(),
            None => self.of.estimate.of_pixels(self.of.iterations, &self.of.picture),
        }
    }

    /// The squared noise of each pixel's channels; `None` as in [`Rendered::error`].
    pub(super) fn noise2(&self) -> Option<Vec<[f64; 3]>> {
        // A picture that was put together has no sequences any more.
        let has_sequences = self.of.given.is_none();
        let of_pixels = || self.of.estimate.noise2_of_pixels(self.of.iterations, &self.of.picture);
        has_sequences.then(of_pixels).flatten()
    }

    /// Warnings about the picture.
    pub fn warnings(&self) -> Vec<Warning> {
        let Subject {
            counters,
            photons_emitted,
            ..
        } = &self.of.subject;
        let mut warnings = Warning::of(counters, *photons_emitted, self.of.max_depth);
        if self.noisy().pixels().iter().flatten().all(|&value| value == 0.0) {
            warnings.push(Warning::Black);
        }
        warnings
    }

    /// The failure that ended it early.
    pub fn failure(&self) -> Option<&Failure> {
        self.of.failure.as_ref()
    }

    /// The subject of its profile, with counters.
    pub fn subject(&self) -> &Subject {
        &self.of.subject
    }

    /// Every launch of the render call, if [`Hooks::profile`](super::Hooks::profile) is set.
    pub fn profile(&self) -> &Profile {
        &self.of.profile
    }

    /// Writes an OpenEXR file: linear RGB, alpha, the error of each pixel, the noisy picture if the noise was removed,
    /// [layers](RenderConfig::layers), and render metadata as attributes.
    ///
    /// # Errors
    /// A path that can't be written to, a full disk. The file is whole or absent.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        self.write_view_layer(path, None)
    }

    /// As [`Rendered::write_exr`], with the names of channels by which Blender knows those of a view layer.
    ///
    /// # Errors
    /// As [`Rendered::write_exr`].
    pub fn write_view_layer(&self, path: &Path, view_layer: Option<&str>) -> Result<()> {
        let errors = self.pixel_errors();
        let view_layer = ViewLayer(view_layer);
        let layers = LayersOf {
            layers: self.of.layers,
            picture: &self.of.picture,
            names: &self.of.names,
            samples: self.of.samples,
            view_layer,
        };
        let (channels, attributes) = layers.additions();
        let additions = Additions {
            alpha: Some(&self.of.picture.alpha),
            errors: errors.as_ref(),
            noisy: self.denoised.as_ref().map(|_| self.noisy()),
            channels,
            attributes,
            view_layer,
            place: Some((self.of.shown.origin, self.of.resolution)),
        };
        let metadata = Metadata {
            estimated_error: self.error().map(|error| error.total),
            denoised_by: self.denoised.as_ref().map(|denoised| denoised.by.clone()),
            ..self.of.metadata.clone()
        };
        film::write_exr(self.image(), additions, path, &metadata)
    }

    /// Writes a tone-mapped PNG.
    ///
    /// # Errors
    /// As [`Rendered::write_exr`].
    pub fn write_png(&self, path: &Path, look: Look) -> Result<()> {
        film::write_png(self.image(), path, look)
    }
}
