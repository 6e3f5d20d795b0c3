//! Tone mappers: radiance to what a display shows.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::Image;
use crate::config::choices;

choices! {
    /// How radiance becomes a display's colours.
    pub enum Tone {
        /// Khronos PBR Neutral: colours up to 0.8 as they are, brighter ones compressed and desaturated.
        Neutral => "neutral",
        /// AgX, as in Blender: a film-like curve over 16.5 stops, in which bright colours turn white.
        Agx => "agx",
        /// The radiance itself, clipped at 1.
        Srgb => "srgb",
    }
}

/// How bright a picture is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exposure {
    /// So many stops brighter.
    Stops(f32),
    /// So that the picture's geometric mean is a middle grey.
    Auto,
}

/// How a picture is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// How bright.
    pub exposure: Exposure,
    /// By which curve.
    pub tone: Tone,
}

impl Default for Look {
    /// As it is, by [`Tone::Neutral`].
    fn default() -> Self {
        Self {
            exposure: Exposure::Stops(0.0),
            tone: Tone::Neutral,
        }
    }
}

/// Luminance that the geometric mean is shown as (Reinhard and others, «Photographic tone reproduction», 2002).
const MIDDLE_GREY: f64 = 0.18;
/// Stops of an automatic exposure at the most.
const MOST_STOPS: f64 = 60.0;

impl Exposure {
    /// In stops, for a picture. Black pixels, and values that are not finite, don't count; a black picture stays as it is.
    pub fn stops(self, image: &Image) -> f32 {
        if let Self::Stops(stops) = self {
            return stops;
        }
        // Rec. 709.
        let luminance = |&[r, g, b]: &[f32; 3]| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
        let luminances = image.pixels().iter().map(luminance);
        let (sum, count) = luminances
            .filter(|&luminance| luminance > 0.0 && luminance.is_finite())
            .fold((0.0, 0u32), |(sum, count), luminance| {
                (sum + luminance.log2(), count + 1)
            });
        if count == 0 {
            return 0.0;
        }
        (MIDDLE_GREY.log2() - sum / f64::from(count)).clamp(-MOST_STOPS, MOST_STOPS) as f32
    }
}

/// Replaces infinity: far above what a display distinguishes, far below the overflow of f32.
const BRIGHTEST: f32 = 1e20;

impl Tone {
    /// Maps any radiance to linear intensities of sRGB's primaries, 0 ..= 1. NaN and negative values become 0.
    pub fn map(self, radiance: [f32; 3]) -> [f32; 3] {
        // NaN fails the comparison.
        let color = radiance.map(|value| if value > 0.0 { value.min(BRIGHTEST) } else { 0.0 });
        match self {
            Self::Neutral => neutral(color),
            Self::Agx => agx(color),
            Self::Srgb => color.map(|value| value.min(1.0)),
        }
    }
}

/// Khronos PBR Neutral tone mapper (github.com/KhronosGroup/ToneMapping, PBR_Neutral): keeps hue and contrast up to
/// 0.8, then compresses the peak channel towards 1 and desaturates.
fn neutral(color: [f32; 3]) -> [f32; 3] {
    const START_COMPRESSION: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let darkest = color.into_iter().fold(BRIGHTEST, f32::min);
    // Subtracts the reflection of a black dielectric at normal incidence, 0.04, from the shadows.
    let offset = if darkest < 0.08 {
        darkest - 6.25 * darkest * darkest
    } else {
        0.04
    };
    let color = color.map(|value| value - offset);
    let peak = color.into_iter().fold(0.0, f32::max);
    if peak < START_COMPRESSION {
        return color;
    }
    let range = 1.0 - START_COMPRESSION;
    let new_peak = 1.0 - range * range / (peak + range - START_COMPRESSION);
    let whiteness = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.map(|value| {
        let compressed = value * (new_peak / peak);
        compressed + (new_peak - compressed) * whiteness
    })
}

/// Rec. 709 to Rec. 2020, both linear with white D65 (ITU-R BT.2087).
const TO_REC_2020: DMat3 = DMat3::from_cols(
    DVec3::new(0.6274, 0.0691, 0.0164),
    DVec3::new(0.3293, 0.9195, 0.0880),
    DVec3::new(0.0433, 0.0113, 0.8956),
);
/// The inverse.
static FROM_REC_2020: LazyLock<DMat3> = LazyLock::new(|| TO_REC_2020.inverse());
/// AgX turns and shrinks the primaries before its curve, so that saturated bright colours turn white; and back behind it.
const AGX_INSET: DMat3 = DMat3::from_cols(
    DVec3::new(0.856_627_153_315_983, 0.137_318_972_929_847, 0.111_898_212_999_95),
    DVec3::new(0.095_121_240_538_158_8, 0.761_241_990_602_591, 0.076_799_418_603_190_3),
    DVec3::new(0.048_251_606_145_858_3, 0.101_439_036_467_562, 0.811_302_368_396_859),
);
const AGX_OUTSET: DMat3 = DMat3::from_cols(
    DVec3::new(
        1.127_100_581_814_436_8,
        -0.141_329_763_498_438_3,
        -0.141_329_763_498_438_26,
    ),
    DVec3::new(
        -0.110_606_643_096_603_23,
        1.157_823_702_216_272,
        -0.110_606_643_096_602_94,
    ),
    DVec3::new(
        -0.016_493_938_717_834_573,
        -0.016_493_938_717_834_257,
        1.251_936_406_595_040_5,
    ),
);
/// Stops over which its curve goes from black to white.
const AGX_STOPS: [f64; 2] = [-12.473_93, 4.026_069];
/// The curve from the place between them to the signal, powers 6 to 0 of Wrensch's fit («Minimal AgX implementation», 2023).
const AGX_CURVE: [f64; 7] = [15.5, -40.14, 31.96, -6.868, 0.429_8, 0.119_1, -0.002_32];
/// The display's gamma, which the signal is for.
const AGX_GAMMA: f64 = 2.2;

/// AgX (Sobotka), the base look.
fn agx(color: [f32; 3]) -> [f32; 3] {
    let inset = AGX_INSET * (TO_REC_2020 * DVec3::from(color.map(f64::from)));
    let [first, last] = AGX_STOPS;
    let signal = inset.max(DVec3::splat(1e-10)).map(|value| {
        let place = ((value.log2() - first) / (last - first)).clamp(0.0, 1.0);
        AGX_CURVE.into_iter().fold(0.0, |sum, factor| sum * place + factor)
    });
    let shown = (AGX_OUTSET * signal)
        .max(DVec3::ZERO)
        .map(|value| value.powf(AGX_GAMMA));
    let display = *FROM_REC_2020 * shown;
    display.clamp(DVec3::ZERO, DVec3::ONE).as_vec3().to_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Choice as _;

    #[test]
    fn every_mapper_takes_black_to_black_and_the_brightest_to_white() {
        for &tone in Tone::ALL {
            let close = |radiance: f32, wanted: f32| {
                let shown = tone.map([radiance; 3]);
                assert!(
                    shown.iter().all(|value| (value - wanted).abs() < 0.012),
                    "{tone}: {radiance} is shown as {shown:?}"
                );
            };
            close(0.0, 0.0);
            close(f32::NAN, 0.0);
            close(-1.0, 0.0);
            close(f32::INFINITY, 1.0);
        }
    }

    #[test]
    fn brighter_greys_are_shown_brighter_and_grey() {
        for &tone in Tone::ALL {
            let mut before = -1.0;
            for stop in -10..=6 {
                let [r, g, b] = tone.map([0.18 * 2f32.powi(stop); 3]);
                assert!(
                    r >= before && (r - g).abs() < 2e-3 && (g - b).abs() < 2e-3,
                    "{tone}: {stop} stops: {r} {g} {b}"
                );
                before = r;
            }
        }
    }

    /// AgX shows a middle grey as such; neutral takes off the reflection of a black dielectric.
    #[test]
    fn a_middle_grey_stays_one() {
        let [agx, ..] = Tone::Agx.map([0.18; 3]);
        assert!((agx - 0.18).abs() < 0.04, "{agx}");
        let [neutral, ..] = Tone::Neutral.map([0.18; 3]);
        assert!((neutral - 0.14).abs() < 1e-6, "{neutral}");
    }

    #[test]
    fn automatic_exposure_shows_the_geometric_mean_as_a_middle_grey() {
        let image = |values: &[f32]| Image::new(values.len(), 1, values.iter().map(|&value| [value; 3]).collect());
        let stops = |values: &[f32]| Exposure::Auto.stops(&image(values));
        assert!((stops(&[0.18 * 4.0, 0.18 * 4.0]) + 2.0).abs() < 1e-5);
        assert!((stops(&[0.18 / 16.0, 0.18, 0.0, f32::INFINITY]) - 2.0).abs() < 1e-5);
        assert_eq!(stops(&[0.0]), 0.0);
        assert_eq!(Exposure::Stops(1.5).stops(&image(&[7.0])), 1.5);
    }
}
