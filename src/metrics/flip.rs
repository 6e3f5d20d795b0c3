//! HDR-FLIP: the visible difference of two pictures to a viewer who flips between them, 0 to 1 per pixel.
//!
//! Andersson and others, «FLIP: A Difference Evaluator for Alternating Images», 2020, and «Visualizing Errors in Rendered
//! High Dynamic Range Images», 2021; constants as in the authors' implementation, at their default viewing distance. The
//! tests compare with values of PyPI's flip-evaluator 1.7.

use rayon::prelude::*;

use crate::film::Image;

/// Pixels per degree of a 0.7 m wide 4K monitor seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;
/// Radiance is clamped here.
const BRIGHTEST: f64 = 65_536.0;
/// Tone-mapped luminance that the first and the last exposure give to the brightest and the median pixel.
const EXPOSURE_TARGET: f64 = 0.85;
/// D65.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];
/// Exponents of the colour and the feature pipeline, and the colour errors' redistribution.
const Q_COLOR: f64 = 0.7;
const Q_FEATURE: f64 = 0.5;
const P_COLOR: f64 = 0.4;
const P_TARGET: f64 = 0.95;

/// Samples of three channels, row by row.
struct Planes {
    width: usize,
    height: usize,
    pixels: Vec<[f64; 3]>,
}

impl Planes {
    fn map(&self, change: impl Fn([f64; 3]) -> [f64; 3] + Sync) -> Self {
        Self {
            width: self.width,
            height: self.height,
            pixels: self.pixels.par_iter().map(|&pixel| change(pixel)).collect(),
        }
    }

    /// Convolves each channel by its kernels along x and y; pixels beyond the edge repeat those at the edge.
    fn convolve(&self, along_x: [&[f64]; 3], along_y: [&[f64]; 3]) -> Self {
        let (width, height) = (self.width, self.height);
        let pass = |from: &[[f64; 3]], kernels: [&[f64]; 3], horizontal: bool| -> Vec<[f64; 3]> {
            let at = |x: isize, y: isize| {
                let (x, y) = (x.clamp(0, width as isize - 1), y.clamp(0, height as isize - 1));
                from[y as usize * width + x as usize]
            };
            let of_pixel = |index: usize| {
                let (x, y) = ((index % width) as isize, (index / width) as isize);
                std::array::from_fn(|channel| {
                    let radius = (kernels[channel].len() / 2) as isize;
                    let taps = (-radius..=radius).zip(kernels[channel]);
                    taps.map(|(offset, weight)| {
                        let pixel = if horizontal {
                            at(x + offset, y)
                        } else {
                            at(x, y + offset)
                        };
                        weight * pixel[channel]
                    })
                    .sum()
                })
            };
            (0..width * height).into_par_iter().map(of_pixel).collect()
        };
        let rows = pass(&self.pixels, along_x, true);
        Self {
            width,
            height,
            pixels: pass(&rows, along_y, false),
        }
    }
}

/// HDR-FLIP of each pixel of a picture against a reference of its size; NaN where either has a NaN, which counts as black
/// for the pixels around.
pub fn flip(image: &Image, reference: &Image) -> Vec<f32> {
    let is_nan = |pixel: &[f32; 3]| pixel.iter().any(|value| value.is_nan());
    let pairs = image.pixels().iter().zip(reference.pixels());
    let unknown: Vec<bool> = pairs.map(|(x, r)| is_nan(x) || is_nan(r)).collect();
    let [test, reference] = [image, reference].map(|image| Planes {
        width: image.width(),
        height: image.height(),
        pixels: image
            .pixels()
            .iter()
            // NaN fails the comparison.
            .map(|pixel| {
                pixel.map(|value| {
                    if value > 0.0 {
                        f64::from(value).min(BRIGHTEST)
                    } else {
                        0.0
                    }
                })
            })
            .collect(),
    });
    let filters = Filters::new();
    let mut worst = vec![0.0f64; reference.pixels.len()];
    for exposure in exposures(&reference) {
        let [test, reference] = [&test, &reference].map(|picture| picture.map(|pixel| tone_map(pixel, exposure)));
        for (worst, here) in worst.iter_mut().zip(filters.ldr_flip(&test, &reference)) {
            *worst = worst.max(here);
        }
    }
    let values = worst.into_iter().zip(unknown);
    values
        .map(|(value, unknown)| if unknown { f32::NAN } else { value as f32 })
        .collect()
}

/// Coefficients of the ACES approximation (Narkowicz, 2016) as a quotient of quadratic polynomials.
const ACES: [f64; 6] = [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14];

fn tone_map(pixel: [f64; 3], exposure: f64) -> [f64; 3] {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    pixel.map(|value| {
        let x = value * exposure.exp2();
        ((k0 * x * x + k1 * x + k2) / (k3 * x * x + k4 * x + k5)).clamp(0.0, 1.0)
    })
}

/// The range of exposures, in stops, that shows the reference's median and its brightest pixel well. If the median is black,
/// black pixels are left out, because no exposure shows them (the paper does not define this case).
fn exposures(reference: &Planes) -> Vec<f64> {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    let c0 = (k1 - k4 * EXPOSURE_TARGET) / (k0 - k3 * EXPOSURE_TARGET);
    let c1 = (k2 - k5 * EXPOSURE_TARGET) / (k0 - k3 * EXPOSURE_TARGET);
    let target = -0.5 * c0 + (0.25 * c0 * c0 - c1).sqrt();
    let mut luminances: Vec<f64> = reference
        .pixels
        .iter()
        .map(|pixel| pixel.iter().zip(LUMINANCE).map(|(value, weight)| value * weight).sum())
        .collect();
    luminances.sort_by(f64::total_cmp);
    let brightest = luminances[luminances.len() - 1];
    if brightest <= 0.0 {
        return vec![0.0];
    }
    let mut median = luminances[(luminances.len() - 1) / 2];
    if median <= 0.0 {
        let lit = &luminances[luminances.partition_point(|luminance| *luminance <= 0.0)..];
        median = lit[(lit.len() - 1) / 2];
    }
    let start = (target / brightest).log2();
    let stop = (target / median).log2();
    let count = (stop - start).ceil().max(2.0);
    let step = (stop - start) / (count - 1.0);
    (0..count as u32).map(|i| start + f64::from(i) * step).collect()
}

fn linear_to_xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
    [
        (10_135_552.0 * r + 8_788_810.0 * g + 4_435_075.0 * b) / 24_577_794.0,
        (2_613_072.0 * r + 8_788_810.0 * g + 887_015.0 * b) / 12_288_897.0,
        (1_425_312.0 * r + 8_788_810.0 * g + 70_074_185.0 * b) / 73_733_382.0,
    ]
}

fn xyz_to_linear([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.241_003_275 * x - 1.537_398_934 * y - 0.498_615_861 * z,
        -0.969_224_334 * x + 1.875_930_071 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_202 * y + 1.057_148_933 * z,
    ]
}

fn relative_to_white(xyz: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| xyz[i] / WHITE[i])
}

/// A luminance and two opponent channels from the parts of the white point.
fn opponent([x, y, z]: [f64; 3]) -> [f64; 3] {
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_to_ycxcz(rgb: [f64; 3]) -> [f64; 3] {
    opponent(relative_to_white(linear_to_xyz(rgb)))
}

fn ycxcz_to_linear([l, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    let xyz = [y + cx / 500.0, y, y - cz / 200.0];
    xyz_to_linear(std::array::from_fn(|i| xyz[i] * WHITE[i]))
}

/// L*a*b* with chroma growing with luminance (Hunt's effect).
fn linear_to_hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    let delta: f64 = 6.0 / 29.0;
    let curve = relative_to_white(linear_to_xyz(rgb)).map(|value| {
        if value > delta.powi(3) {
            value.cbrt()
        } else {
            value / (3.0 * delta * delta) + 4.0 / 29.0
        }
    });
    let [l, a, b] = opponent(curve);
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// HyAB distance: lightness and chroma separately.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Kernels of the two pipelines, all separable.
struct Filters {
    achromatic: Vec<f64>,
    red_green: Vec<f64>,
    /// Two Gaussians.
    blue_yellow: [Vec<f64>; 2],
    smooth: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
    /// The largest colour error, with its exponent.
    largest: f64,
}

fn gaussian(radius: isize, exponent: f64) -> Vec<f64> {
    (-radius..=radius).map(|x| (exponent * (x * x) as f64).exp()).collect()
}

fn scaled(kernel: &[f64], factor: f64) -> Vec<f64> {
    kernel.iter().map(|value| value * factor).collect()
}

/// Makes the positive weights add up to 1, and the negative ones to −1.
fn balanced(kernel: &[f64]) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|value| **value > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|value| **value < 0.0).sum::<f64>();
    let balance = |value: &f64| value / if *value < 0.0 { negative } else { positive };
    kernel.iter().map(balance).collect()
}

impl Filters {
    fn new() -> Self {
        let pi2 = std::f64::consts::PI.powi(2);
        // Contrast sensitivity: the widest Gaussian decides the radius of all.
        let radius = (3.0 * (0.04 / (2.0 * pi2)).sqrt() * PIXELS_PER_DEGREE).ceil() as isize;
        let sensitivity = |b: f64| gaussian(radius, -pi2 / (b * PIXELS_PER_DEGREE.powi(2)));
        let normalised = |kernel: Vec<f64>| scaled(&kernel, 1.0 / kernel.iter().sum::<f64>());
        let [wide, narrow] = [(34.1, 0.04), (13.5, 0.025)].map(|(a, b): (f64, f64)| {
            let kernel = sensitivity(b);
            let weight = a * (std::f64::consts::PI / b).sqrt();
            (weight * kernel.iter().sum::<f64>().powi(2), weight, kernel)
        });
        let whole = wide.0 + narrow.0;
        let blue_yellow = [wide, narrow].map(|(_, weight, kernel)| scaled(&kernel, (weight / whole).sqrt()));
        // Features: derivatives of a Gaussian as wide as the eye's edge detectors.
        let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
        let radius = (3.0 * deviation).ceil() as isize;
        let bell = gaussian(radius, -0.5 / (deviation * deviation));
        let derived = |factor: &dyn Fn(f64) -> f64| {
            let taps = (-radius..=radius).zip(&bell);
            balanced(&taps.map(|(x, value)| factor(x as f64) * value).collect::<Vec<f64>>())
        };
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(linear_to_hunt_lab);
        Self {
            achromatic: normalised(sensitivity(0.0047)),
            red_green: normalised(sensitivity(0.0053)),
            blue_yellow,
            edge: derived(&|x| -x),
            point: derived(&|x| x * x / (deviation * deviation) - 1.0),
            smooth: normalised(bell.clone()),
            largest: hyab(green, blue).powf(Q_COLOR),
        }
    }

    /// FLIP of two tone-mapped pictures.
    fn ldr_flip(&self, test: &Planes, reference: &Planes) -> Vec<f64> {
        let [test, reference] = [test, reference].map(|picture| picture.map(linear_to_ycxcz));
        let [test_color, reference_color] = [&test, &reference].map(|picture| self.seen_color(picture));
        let [test_features, reference_features] = [&test, &reference].map(|picture| self.features(picture));
        let colors = test_color.pixels.par_iter().zip(&reference_color.pixels);
        let features = test_features.par_iter().zip(&reference_features);
        colors
            .zip(features)
            .map(|((a, b), (f, g))| {
                let color = self.redistributed(hyab(*a, *b).powf(Q_COLOR));
                let feature = (f[0] - g[0]).abs().max((f[1] - g[1]).abs());
                let feature = (feature / std::f64::consts::SQRT_2).powf(Q_FEATURE);
                color.powf(1.0 - feature)
            })
            .collect()
    }

    fn seen_color(&self, picture: &Planes) -> Planes {
        let kernels = |blue_yellow| [&self.achromatic[..], &self.red_green[..], blue_yellow];
        let [wide, narrow] = &self.blue_yellow;
        let mut seen = picture.convolve(kernels(wide), kernels(wide));
        let other = picture.convolve(kernels(narrow), kernels(narrow));
        for (pixel, other) in seen.pixels.iter_mut().zip(&other.pixels) {
            pixel[2] += other[2];
        }
        seen.map(|pixel| linear_to_hunt_lab(ycxcz_to_linear(pixel).map(|value| value.clamp(0.0, 1.0))))
    }

    /// Strength of edges and of points.
    fn features(&self, picture: &Planes) -> Vec<[f64; 2]> {
        let luminance = picture.map(|[y, ..]| [(y + 16.0) / 116.0; 3]);
        let (smooth, edge, point) = (&self.smooth[..], &self.edge[..], &self.point[..]);
        let along_x = luminance.convolve([edge, point, smooth], [smooth, smooth, smooth]);
        let along_y = luminance.convolve([smooth, smooth, smooth], [edge, point, smooth]);
        let both = along_x.pixels.iter().zip(&along_y.pixels);
        both.map(|(x, y)| [x[0].hypot(y[0]), x[1].hypot(y[1])]).collect()
    }

    /// Small colour errors get most of the range.
    fn redistributed(&self, error: f64) -> f64 {
        let knee = P_COLOR * self.largest;
        if error < knee {
            P_TARGET / knee * error
        } else {
            P_TARGET + (error - knee) / (self.largest - knee) * (1.0 - P_TARGET)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture by formula, of four orders of magnitude, with edges.
    fn pattern(shift: f32) -> Image {
        let (width, height) = (60, 44);
        let pixel = |index: usize| {
            let (x, y) = ((index % width) as f32, (index / width) as f32);
            let wave = |a: f32, b: f32| 0.5 + 0.5 * (a * x + b * y + shift).sin();
            let bright = if (x - 30.0).abs() < 6.0 && (y - 20.0).abs() < 6.0 {
                50.0
            } else {
                0.5
            };
            [bright * wave(0.3, 0.1), bright * wave(0.05, 0.2), 0.02 + wave(0.7, 0.4)]
        };
        Image::new(width, height, (0..width * height).map(pixel).collect())
    }

    fn mean(values: &[f32]) -> f64 {
        values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let picture = pattern(0.0);
        assert!(flip(&picture, &picture).iter().all(|&value| value < 1e-6));
    }

    #[test]
    fn what_is_not_a_number_has_no_flip_and_leaves_the_rest_its_own() {
        let (mut pixels, picture) = (pattern(0.0).pixels().to_vec(), pattern(0.0));
        pixels[100][1] = f32::NAN;
        let values = flip(&Image::new(60, 44, pixels), &picture);
        assert!(values[100].is_nan());
        let others = values.iter().filter(|value| value.is_finite());
        assert_eq!(others.count(), values.len() - 1);
    }

    #[test]
    fn a_reference_that_is_mostly_or_all_black_is_seen_at_few_exposures() {
        let lit = |count: usize| {
            let pixel = |index: usize| if index < count { [0.5, 2.0, 1.0] } else { [0.0; 3] };
            Image::new(60, 44, (0..60 * 44).map(pixel).collect())
        };
        for count in [0, 1, 500] {
            let values = flip(&lit(700), &lit(count));
            let mean = mean(&values);
            assert!(mean > 0.01 && mean < 1.0, "{count} pixels are lit: {mean}");
        }
        let planes = |image: &Image| Planes {
            width: 60,
            height: 44,
            pixels: image.pixels().iter().map(|pixel| pixel.map(f64::from)).collect(),
        };
        assert!(exposures(&planes(&lit(500))).len() <= 2);
        assert_eq!(exposures(&planes(&lit(0))).len(), 1);
    }

    #[test]
    fn flip_is_that_of_the_published_implementation() {
        // flip-evaluator 1.7, evaluate(reference, test, "HDR"): the same formula for the pictures.
        let reference = pattern(0.0);
        for (shift, expected) in EXPECTED {
            let found = mean(&flip(&pattern(shift), &reference));
            assert!(
                (found - expected).abs() < 5e-4,
                "shift {shift}: {found}, flip-evaluator has {expected}"
            );
        }
    }

    const EXPECTED: [(f32, f64); 3] = [(0.01, 0.037_333), (0.2, 0.330_870), (2.0, 0.894_198)];
}
