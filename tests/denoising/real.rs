//! The library itself.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use ppm_vk::{Denoiser, Guides, Image};

use super::{assert_done, denoised_by, render};

const SIZE: [usize; 2] = [96, 64];

/// The library, named by PPM_VK_OIDN, or where the system has it; tests that take minutes install it.
fn library() -> Option<PathBuf> {
    if env::var_os("PPM_VK_LONG").is_some() && env::var_os("PPM_VK_OIDN").is_none() {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/oidn");
        let output = Command::new(script).output().expect("scripts/oidn runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        return Some(String::from_utf8_lossy(&output.stdout).trim_end().into());
    }
    env::var_os("PPM_VK_OIDN").map(PathBuf::from)
}

fn denoiser() -> Option<Denoiser> {
    match Denoiser::open(library().as_deref()) {
        Ok(denoiser) => Some(denoiser),
        Err(error) => {
            println!(
                "skipped: {error}; PPM_VK_OIDN=$(scripts/oidn), or scripts/test --long, which installs it below target"
            );
            None
        }
    }
}

fn image(pixel: impl Fn(usize, usize) -> [f32; 3]) -> Image {
    let [width, height] = SIZE;
    let pixels = (0..width * height).map(|index| pixel(index % width, index / width));
    Image::new(width, height, pixels.collect())
}

/// Light that falls off to the right, on tiles.
fn albedo(x: usize, y: usize) -> [f32; 3] {
    if (x / 3 + y / 3).is_multiple_of(2) {
        [0.8, 0.6, 0.4]
    } else {
        [0.3, 0.35, 0.5]
    }
}

fn clean(x: usize, y: usize) -> [f32; 3] {
    albedo(x, y).map(|of_tile| of_tile * 2.0 / (1.0 + x as f32 / 30.0))
}

/// A hash of the pixel, -1 to 1.
fn random(x: usize, y: usize, channel: usize) -> f32 {
    let mut bits = (x * 73 + y * 19_349 + channel * 83_492) as u32;
    for _ in 0..3 {
        bits = (bits ^ bits >> 16).wrapping_mul(0x45d9_f3b5);
    }
    (bits >> 8) as f32 / 8_388_608.0 - 1.0
}

fn noisy(x: usize, y: usize) -> [f32; 3] {
    let clean = clean(x, y);
    std::array::from_fn(|channel| clean[channel] * (1.0 + 0.7 * random(x, y, channel)))
}

fn squared_error(image: &Image) -> f64 {
    let [width, _] = SIZE;
    let of_pixel = |(index, pixel): (usize, &[f32; 3])| {
        let clean = clean(index % width, index / width);
        (0..3)
            .map(|channel| f64::from(pixel[channel] - clean[channel]).powi(2))
            .sum::<f64>()
    };
    image.pixels().iter().enumerate().map(of_pixel).sum()
}

#[test]
fn noise_is_removed_and_guides_keep_edges() {
    let Some(denoiser) = denoiser() else { return };
    let picture = image(noisy);
    let before = squared_error(&picture);
    let alone = squared_error(&denoiser.denoise(&picture, None).expect("a picture"));
    assert!(alone < 0.5 * before, "without guides {alone}, before {before}");
    let albedo = image(|x, y| albedo(x, y).map(|value| value * (1.0 + 0.1 * random(y, x, 7))));
    let normal = image(|_, _| [0.0, 0.0, 1.0]);
    let guides = Guides {
        albedo: &albedo,
        normal: &normal,
    };
    let guided = squared_error(&denoiser.denoise(&picture, Some(guides)).expect("a picture"));
    assert!(guided < 0.5 * alone, "with guides {guided}, without {alone}");
}

#[test]
fn a_picture_gives_the_same_bits_again_with_any_number_of_threads() {
    if denoiser().is_none() {
        return;
    }
    let denoised = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        let run = || denoiser().expect("it was there").denoise(&image(noisy), None);
        pool.install(run).expect("a picture")
    };
    let first = denoised(1);
    for threads in [1, 2, 3] {
        assert!(denoised(threads) == first, "{threads} threads differ from one");
    }
}

#[test]
fn brightness_does_not_matter() {
    let Some(denoiser) = denoiser() else { return };
    let denoised = |scale: f32| {
        let picture = image(|x, y| noisy(x, y).map(|value| value * scale));
        denoiser.denoise(&picture, None).expect("a picture")
    };
    let plain = denoised(1.0);
    for exponent in [-60, -20, 20, 60] {
        let scale = 2.0f32.powi(exponent);
        let expected: Vec<[f32; 3]> = plain
            .pixels()
            .iter()
            .map(|pixel| pixel.map(|value| value * scale))
            .collect();
        assert!(denoised(scale).pixels() == expected, "at 2^{exponent}");
    }
}

#[test]
fn values_that_are_no_numbers_do_not_spread() {
    let Some(denoiser) = denoiser() else { return };
    let bad = image(|x, y| match (x, y) {
        (10, 10) => [f32::NAN; 3],
        (0, 63) => [f32::INFINITY, 1.0, f32::NEG_INFINITY],
        _ => noisy(x, y),
    });
    let denoised = denoiser.denoise(&bad, None).expect("a picture");
    assert!(
        denoised.pixels().iter().flatten().all(|value| value.is_finite()),
        "not finite"
    );
    let good = squared_error(&denoiser.denoise(&image(noisy), None).expect("a picture"));
    let error = squared_error(&denoised);
    assert!((error / good - 1.0).abs() < 0.02, "{error}, without bad values {good}");
    let nothing = denoiser.denoise(&image(|_, _| [f32::NAN; 3]), None).expect("a picture");
    assert!(nothing.pixels().iter().flatten().all(|&value| value == 0.0));
}

#[test]
fn pictures_of_any_shape_are_denoised() {
    let Some(denoiser) = denoiser() else { return };
    let expected = [0.25, 0.5, 1.0];
    for (width, height) in [(1, 1), (1, 7), (300, 1), (17, 31), (100, 100)] {
        let picture = Image::new(width, height, vec![expected; width * height]);
        let denoised = denoiser.denoise(&picture, None).expect("a picture");
        assert_eq!((denoised.width(), denoised.height()), (width, height));
        // The library's own error in plain pictures is 0.3 %; without a margin the corners were off by 17 %.
        let ratios = || {
            denoised
                .pixels()
                .iter()
                .flat_map(|pixel| pixel.iter().zip(expected).map(|(value, is)| value / is))
        };
        let (least, most) = (ratios().fold(1.0, f32::min), ratios().fold(1.0, f32::max));
        assert!(
            least > 0.98 && most < 1.02,
            "{width}x{height}: {least} to {most} of the plain picture"
        );
    }
}

#[test]
fn a_render_names_the_library_that_denoised_it() {
    if denoiser().is_none() {
        return;
    }
    let folder = tempfile::TempDir::new().expect("folder");
    let library = library().unwrap_or_default();
    assert_done(&render(folder.path(), &library, &["--denoise"]));
    let by = denoised_by(&folder.path().join("o.exr")).unwrap_or_default();
    assert!(by.starts_with("Open Image Denoise 2."), "«{by}»");
}
