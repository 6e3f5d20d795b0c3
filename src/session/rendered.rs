//! The result of a render.

use std::fmt;
use std::path::Path;

use super::work::Done;
use super::{Session, Warning};
use crate::backend::Resolved;
use crate::error::{Error, Result};
use crate::estimate::{ErrorEstimate, RelativeError};
use crate::film::{self, Image, Layers, Metadata};
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

/// A picture with its errors, warnings and profile.
pub struct Rendered {
    picture: Resolved,
    metadata: Metadata,
    estimate: ErrorEstimate,
    error: Option<RelativeError>,
    subject: Subject,
    max_depth: u32,
    profile: Profile,
    failure: Option<Failure>,
}

impl Rendered {
    pub(super) fn new(session: &Session, done: Done) -> Self {
        let backend = session.renderer.backend();
        let error = session.estimate.relative(done.iterations, &done.picture);
        let subject = Subject {
            scene: session.scene.clone(),
            resolution: session.config.resolution,
            gather: session.gather().to_owned(),
            photons: session.config.photons,
            photons_emitted: done.emitted,
            device: backend.device(),
            counters: backend.counters(),
        };
        Self {
            metadata: Metadata {
                iterations: u64::from(done.iterations),
                photons_emitted: done.emitted,
                seed: u64::from(session.config.seed),
                device: subject.device.name.clone(),
                seconds: (session.spent - done.time).as_secs_f64() + done.seconds,
                estimated_error: error.map(|error| error.total),
            },
            picture: done.picture,
            estimate: session.estimate,
            error,
            subject,
            max_depth: session.config.max_depth,
            profile: done.profile,
            failure: done.failure,
        }
    }

    /// The picture.
    pub fn image(&self) -> &Image {
        &self.picture.image
    }

    /// Of each pixel, the share of its camera paths that met a surface.
    pub fn alpha(&self) -> &[f32] {
        &self.picture.alpha
    }

    /// Iterations in it.
    pub fn iterations(&self) -> u32 {
        self.metadata.iterations as u32
    }

    /// Seconds of rendering.
    pub fn seconds(&self) -> f64 {
        self.metadata.seconds
    }

    /// Its estimated error; `None` after fewer than four iterations, and if it is black.
    pub fn error(&self) -> Option<RelativeError> {
        self.error
    }

    /// The estimated error of each pixel, in units of radiance; `None` as in [`Rendered::error`].
    pub fn pixel_errors(&self) -> Option<Image> {
        self.estimate.of_pixels(self.iterations(), &self.picture)
    }

    /// Warnings about the picture.
    pub fn warnings(&self) -> Vec<Warning> {
        let Subject {
            counters,
            photons_emitted,
            ..
        } = &self.subject;
        let mut warnings = Warning::of(counters, *photons_emitted, self.max_depth);
        if self.image().pixels().iter().flatten().all(|&value| value == 0.0) {
            warnings.push(Warning::Black);
        }
        warnings
    }

    /// The failure that ended it early.
    pub fn failure(&self) -> Option<&Failure> {
        self.failure.as_ref()
    }

    /// The subject of its profile, with counters.
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// Every launch of the render call, if [`Hooks::profile`](super::Hooks::profile) is set.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Writes an OpenEXR file: linear RGB, alpha, the error of each pixel, and render metadata as attributes.
    ///
    /// # Errors
    /// A path that can't be written to, a full disk. The file is whole or absent.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        let errors = self.pixel_errors();
        let layers = Layers {
            alpha: Some(&self.picture.alpha),
            errors: errors.as_ref(),
        };
        film::write_exr(self.image(), layers, path, &self.metadata)
    }

    /// Writes a tone-mapped PNG, with an exposure in stops.
    ///
    /// # Errors
    /// As [`Rendered::write_exr`].
    pub fn write_png(&self, path: &Path, exposure: f32) -> Result<()> {
        film::write_png(self.image(), path, exposure)
    }
}
