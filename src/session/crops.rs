//! Pictures that a device can't render at once: in crops, one after another.

use super::rendered::{GivenErrors, Of};
use super::{Failure, Platform, PreparedScene, Rendered};
use crate::backend::{LayerFilms, Resolved};
use crate::config::{Region, RenderConfig};
use crate::error::Result;
use crate::estimate::RelativeError;
use crate::film::Image;
use crate::gpu::Device;
use crate::layout::IDS_OF_PIXEL;
use crate::metrics::{floor_of, relative2};
use crate::pipeline;

/// The crops of a picture that a device can render, as values of [`RenderConfig::crop`]; one if it can render it at once.
///
/// # Errors
/// No such device; one that can render no crop.
pub fn crops(scene: &PreparedScene, config: &RenderConfig, platform: &Platform) -> Result<Vec<Region>> {
    match platform {
        Platform::Cpu => Ok(vec![config.shown()]),
        Platform::Vulkan(device) => {
            let device = Device::open(device.as_deref())?;
            pipeline::crops(scene.packed(), config, device.summary())
        }
    }
}

/// A picture put together from crops.
pub struct Mosaic {
    shown: Region,
    image: Vec<[f32; 3]>,
    alpha: Vec<f32>,
    errors: Option<Vec<[f32; 3]>>,
    films: LayerFilms,
    relative: Vec<(f64, RelativeError)>,
    /// What all crops have in common, with their sums.
    of: Option<Of>,
}

impl Mosaic {
    /// An empty one, for what is shown of a picture.
    pub fn new(config: &RenderConfig) -> Self {
        let shown = config.shown();
        let pixels = shown.pixels() as usize;
        Self {
            shown,
            image: vec![[0.0; 3]; pixels],
            alpha: vec![0.0; pixels],
            errors: Some(vec![[0.0; 3]; pixels]),
            films: LayerFilms::default(),
            relative: Vec::new(),
            of: None,
        }
    }

    /// Adds a crop. Its failure becomes that of the mosaic.
    pub fn add(&mut self, crop: Rendered) {
        let place = crop.shown();
        let relative = crop.error();
        self.relative
            .extend(relative.map(|relative| (place.pixels() as f64, relative)));
        let (shown, pixels) = (self.shown, self.shown.pixels() as usize);
        shown.paste(&place, crop.noisy().pixels(), &mut self.image, 1);
        shown.paste(&place, crop.alpha(), &mut self.alpha, 1);
        // An error of only some pixels would mislead.
        self.errors = match (self.errors.take(), crop.pixel_errors()) {
            (Some(mut errors), Some(of_crop)) => {
                shown.paste(&place, of_crop.pixels(), &mut errors, 1);
                Some(errors)
            }
            _ => None,
        };
        let of = crop.into_parts();
        let films = &of.picture.layers;
        paste_film(&shown, &place, &films.surfaces, &mut self.films.surfaces, pixels, 1);
        let ids = 2 * IDS_OF_PIXEL as usize;
        paste_film(&shown, &place, &films.ids, &mut self.films.ids, pixels, ids);
        paste_film(&shown, &place, &films.light, &mut self.films.light, pixels, 1);
        match &mut self.of {
            None => self.of = Some(of),
            Some(all) => add(all, of),
        }
    }

    /// The failure of a crop.
    pub fn failure(&self) -> Option<&Failure> {
        self.of.as_ref().and_then(|of| of.failure.as_ref())
    }

    /// The picture; `None` without any crop. What no crop has shown is black, with alpha 0.
    pub fn finish(self) -> Option<Rendered> {
        let [width, height] = self.shown.size.map(|side| side as usize);
        let image = Image::new(width, height, self.image);
        let errors = self.errors.map(|errors| Image::new(width, height, errors));
        let relative = errors.as_ref().and_then(|errors| joint(&image, errors, &self.relative));
        let mut of = self.of?;
        of.picture = Resolved {
            waits: Vec::new(),
            behind_glass: Vec::new(),
            sequences: Vec::new(),
            alpha: self.alpha,
            layers: self.films,
            image,
        }
        .into();
        of.shown = self.shown;
        of.subject.resolution = self.shown.size;
        of.given = Some(GivenErrors {
            of_pixels: errors,
            relative,
        });
        Some(of.into())
    }
}

/// Pastes a crop's film, if it has one, into that of the mosaic, which has `each` elements a pixel.
fn paste_film<T: Copy + bytemuck::Zeroable>(
    shown: &Region,
    place: &Region,
    film: &[T],
    into: &mut Vec<T>,
    pixels: usize,
    each: usize,
) {
    if !film.is_empty() {
        into.resize(pixels * each, T::zeroed());
        shown.paste(place, film, into, each);
    }
}

fn add(all: &mut Of, crop: Of) {
    // Those that every pixel has.
    all.metadata.iterations = all.metadata.iterations.min(crop.metadata.iterations);
    all.samples = all.samples.min(crop.samples);
    all.metadata.photons_emitted += crop.metadata.photons_emitted;
    all.metadata.seconds += crop.metadata.seconds;
    all.subject.photons_emitted += crop.subject.photons_emitted;
    all.subject.counters.add(&crop.subject.counters);
    all.profile.append(crop.profile);
    all.failure = all.failure.take().or(crop.failure);
}

/// The relative error of a whole picture, whose parts are in the proportions of those of the crops, given with their pixels. Crops'
/// own errors are relative to their own mean.
fn joint(image: &Image, errors: &Image, crops: &[(f64, RelativeError)]) -> Option<RelativeError> {
    let floor = floor_of(image);
    if floor <= 0.0 || crops.is_empty() {
        return None;
    }
    let total = relative2(image, errors, floor).sqrt();
    let sum = |part: fn(&RelativeError) -> f64| -> f64 {
        crops.iter().map(|(pixels, error)| pixels * part(error).powi(2)).sum()
    };
    let whole = sum(|error| error.total).max(f64::MIN_POSITIVE);
    let part = |part: fn(&RelativeError) -> f64| total * (sum(part) / whole).sqrt();
    let pixels: f64 = crops.iter().map(|(pixels, _)| pixels).sum();
    Some(RelativeError {
        total,
        noise: part(|error| error.noise),
        bias: part(|error| error.bias),
        aliasing: part(|error| error.aliasing),
        missing: part(|error| error.missing),
        waiting: crops.iter().map(|(pixels, error)| pixels * error.waiting).sum::<f64>() / pixels,
    })
}
