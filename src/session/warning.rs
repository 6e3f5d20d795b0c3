//! Warnings about a picture.

use std::fmt;

use crate::backend::Counters;
use crate::config::{Estimator, RenderConfig};
use crate::packing::SceneFeatures;

/// Minimum share of missing light for a warning: less is invisible.
const TELLING_SHARE: f64 = 0.001;

/// A defect of a picture, as one line. It names no flags of a program: those follow from its kind.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The paper's estimator keeps the first of all random choices: permanent grain.
    KeptChoices,
    /// Caustics have the radii of other light: a picture of this size has one photon map.
    OneMap,
    /// Rays are traced by the BVH, because the device can't build the acceleration structures for ray queries.
    WithoutRayQueries(String),
    /// Paths reached [`RenderConfig::max_depth`].
    Truncated {
        /// Their number.
        paths: u64,
        /// Total number of photon paths.
        emitted: u64,
        /// The limit.
        max_depth: u32,
    },
    /// Paths that the driver's loop limit ended.
    Cut {
        /// Their number.
        paths: u64,
        /// Total number of photon paths.
        emitted: u64,
    },
    /// Photons beyond [`RenderConfig::cell_photons`].
    Lost {
        /// Their number.
        photons: u64,
        /// Number of stored photons.
        stored: u64,
        /// Number of full cells.
        cells: u64,
    },
    /// Values that were NaN or infinite.
    NonFinite {
        /// Their number.
        values: u64,
    },
    /// No light at all.
    Black,
}

impl Warning {
    /// Warnings about a render before it begins.
    pub(super) fn before(features: &SceneFeatures, config: &RenderConfig, photon_maps: u32) -> Vec<Self> {
        let chooses = features.dispersion || features.alpha || features.partly_clear || features.coat || features.soft;
        let specular = features.mirror || features.dielectric;
        let is_paper = config.estimator == Estimator::Ppm;
        let warnings = [
            (is_paper && chooses).then_some(Self::KeptChoices),
            (!is_paper && specular && photon_maps == 1).then_some(Self::OneMap),
        ];
        warnings.into_iter().flatten().collect()
    }

    /// Warnings from the counters of a render, with its number of photon paths.
    pub fn of(counters: &Counters, emitted: u64, max_depth: u32) -> Vec<Self> {
        let warnings = [
            (counters.truncated_paths > 0).then_some(Self::Truncated {
                paths: counters.truncated_paths,
                emitted,
                max_depth,
            }),
            (counters.cut_paths > 0).then_some(Self::Cut {
                paths: counters.cut_paths,
                emitted,
            }),
            (counters.lost_photons > 0).then_some(Self::Lost {
                photons: counters.lost_photons,
                stored: counters.photons_stored,
                cells: counters.full_cells,
            }),
            (counters.non_finite > 0).then_some(Self::NonFinite {
                values: counters.non_finite,
            }),
        ];
        warnings.into_iter().flatten().collect()
    }

    /// Whether the missing share of the picture is negligible.
    pub fn is_slight(&self) -> bool {
        match self {
            Self::OneMap | Self::WithoutRayQueries(_) => true,
            // About the same share of light continues at each bounce, so the truncated paths would carry about as much light as
            // all paths at the start. So their share of the paths, as if all were photon paths, is their share of the light.
            Self::Truncated { paths, emitted, .. } => share(*paths, *emitted) < TELLING_SHARE,
            _ => false,
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::WithoutRayQueries(ref why) => write!(text, "rays are traced by the BVH instead of ray queries: {why}"),
            Self::KeptChoices => text.write_str(
                "the estimator ppm finds visible points once: where a wavelength, alpha, a coat, a lobe or a point of a lamp \
                 is chosen at random, each pixel keeps its first choice, and the picture remains grainy there",
            ),
            Self::OneMap => text.write_str(
                "caustics have the radii of other light: at this resolution, the device can't bind a separate map for caustic \
                 photons",
            ),
            Self::Truncated { paths, max_depth, .. } if self.is_slight() => write!(
                text,
                "{paths} paths ended at the limit of {max_depth} bounces: less than {} of the light",
                percent(TELLING_SHARE)
            ),
            Self::Truncated {
                paths,
                emitted,
                max_depth,
            } => write!(
                text,
                "{paths} camera and photon paths reached the limit of {max_depth} bounces, {} of {emitted} photon paths; \
                 about that share of the light is missing, more in places that are seen by many bounces",
                percent(share(paths, emitted))
            ),
            Self::Cut { paths, emitted } => write!(
                text,
                "{paths} paths were ended by the driver's loop limit, {} of {emitted} photon paths; about that share of the \
                 light is missing",
                percent(share(paths, emitted))
            ),
            Self::Lost { photons, stored, cells } => write!(
                text,
                "{photons} of {stored} photons, {}, were beyond the maximum of {cells} grid cells; that share of the photons' \
                 light is missing",
                percent(share(photons, stored))
            ),
            Self::NonFinite { values } => write!(
                text,
                "{values} values were NaN or infinite and count as black: a light or a texture of this scene is out of the \
                 range of floats (10^38, or too small)"
            ),
            Self::Black => text.write_str(
                "the picture is black: no light reaches what the camera sees; check that a light does, and that nothing is in \
                 front of the camera",
            ),
        }
    }
}

fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent < 0.1 {
        format!("{percent:.1e} %")
    } else {
        format!("{percent:.1} %")
    }
}
