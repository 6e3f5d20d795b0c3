//! Motion blur, beside the mean of pictures at many times.

#[path = "program/animated.rs"]
mod animated;
#[path = "program/frames.rs"]
mod frames;
#[path = "program/mod.rs"]
mod program;

use std::path::Path;

use frames::{assert_frames_go_on_and_merge, picture, render};
use ppm_vk::{
    Camera, Image, LoadOptions, Motion, Normalisation, Platform, PreparedScene, RenderConfig, Rendered, Scene,
    SceneFile, Session, Until,
};
use program::{ppm_vk, stderr};
use tempfile::TempDir;

/// Of a picture with motion blur, and of all pictures of a mean together. Pictures of few iterations are biased by the shares of discs
/// that can receive photons, which few points estimate: 8 each.
const ITERATIONS: u32 = 64;
const TIMES: u32 = 8;

/// A file whose shutter is open from one time to another.
struct Open {
    file: SceneFile,
    times: [f64; 2],
    space: Normalisation,
}

impl Open {
    fn new(folder: &TempDir, times: [f64; 2]) -> Self {
        let path = folder.path().join("scene.gltf");
        let mut file = SceneFile::open(&path, LoadOptions::default()).expect("a file");
        let spaces = times.map(|time| file.at(Some(time), None).expect("a scene").normalisation);
        let space = Normalisation::around(&spaces);
        Self { file, times, space }
    }
}

impl Motion for Open {
    fn pose(&mut self, part: f64) -> ppm_vk::Result<(Scene, Camera)> {
        let [open, close] = self.times;
        let scene = self.file.at(Some(open + part * (close - open)), Some(self.space))?;
        let camera = scene.cameras[0].clone();
        Ok((scene, camera))
    }
}

/// Radii that do not shrink: an iteration of any render has the same expectation.
fn config(seed: u32) -> RenderConfig {
    RenderConfig {
        resolution: [48, 48],
        photons: 10_000,
        radius: Some(0.05),
        alpha: 0.9999,
        aims_anyway: true,
        seed,
        ..RenderConfig::default()
    }
}

fn blurred(folder: &TempDir, times: [f64; 2], seed: u32) -> (Rendered, bool) {
    let mut open = Open::new(folder, times);
    let (scene, camera) = open.pose(0.5).expect("a scene");
    let prepared = PreparedScene::new(&scene).expect("it fits");
    let session = Session::new(&prepared, &camera, &config(seed), &Platform::default()).expect("a session");
    let mut session = session.moving(&prepared, Box::new(open)).expect("a session");
    let rendered = session.render(Until::iterations(ITERATIONS)).expect("a picture");
    (rendered, session.is_aimed())
}

type Pixels = Vec<f64>;

fn pixels(image: &Image) -> Pixels {
    image.pixels().iter().flatten().map(|value| f64::from(*value)).collect()
}

/// The mean of pictures at equidistant times, each with a part of the iterations.
fn mean_of_times(folder: &TempDir, times: [f64; 2], seed: u32) -> Pixels {
    let mut open = Open::new(folder, times);
    let mut session: Option<Session> = None;
    let mut sum = vec![0.0; 3 * 48 * 48];
    for number in 0..TIMES {
        let (scene, camera) = open
            .pose((f64::from(number) + 0.5) / f64::from(TIMES))
            .expect("a scene");
        let prepared = PreparedScene::new(&scene).expect("it fits");
        let config = config(seed + number);
        let mut next = match session.take() {
            Some(before) => before.next(&prepared, &camera, &config, &|_| ()),
            None => Session::new(&prepared, &camera, &config, &Platform::default()),
        }
        .expect("a session");
        let rendered = next.render(Until::iterations(ITERATIONS / TIMES)).expect("a picture");
        for (sum, value) in sum.iter_mut().zip(pixels(rendered.image())) {
            *sum += value / f64::from(TIMES);
        }
        session = Some(next);
    }
    sum
}

/// Sum of the squared differences, relative as relMSE has them, of means over blocks of 4×4 pixels: those average noise, and keep
/// what moves.
fn distance2(one: &Pixels, other: &Pixels) -> f64 {
    let block = |pixels: &Pixels, x: usize, y: usize, channel: usize| {
        let places = (0..16).map(|place| (4 * y + place / 4) * 48 + 4 * x + place % 4);
        places.map(|pixel| pixels[3 * pixel + channel]).sum::<f64>() / 16.0
    };
    let floor = 0.01 * (one.iter().sum::<f64>() / one.len() as f64).powi(2);
    let mut sum = 0.0;
    for (x, y, channel) in (0..12 * 12 * 3).map(|index| (index / 3 % 12, index / 36, index % 3)) {
        let [a, b] = [one, other].map(|pixels| block(pixels, x, y, channel));
        sum += (a - b).powi(2) / ((0.5 * (a + b)).powi(2) + floor);
    }
    sum
}

fn mean(one: &Pixels, other: &Pixels) -> Pixels {
    one.iter().zip(other).map(|(a, b)| 0.5 * (a + b)).collect()
}

/// Two renders with motion blur and two means of times, all with seeds of their own: the means of both kinds differ by no more than
/// their noise, which the differences within a kind tell. Their ratio is 1 on average but for what few iterations of a time and
/// few times blur otherwise; by 144 blocks its standard deviation is about 0.15, so that noise alone reaches 2 in less than one of 10⁹
/// runs. Seeds are fixed, so a run repeats the one before; PPM_VK_TEST_SEED chooses others.
#[track_caller]
fn assert_blurs_as_the_mean_of_times(name: &str, node: &str, places: [[f32; 3]; 2], is_aimed: bool) {
    let folder = TempDir::new().expect("folder");
    animated::moving(folder.path(), name, node, places);
    let times = [0.25, 0.75];
    let first_seed = std::env::var("PPM_VK_TEST_SEED").map_or(0, |seed| seed.parse().expect("a number"));
    let [one, two] = [1, 2].map(|seed| blurred(&folder, times, 1000 * first_seed + seed));
    assert_eq!((one.1, two.1), (is_aimed, is_aimed), "aimed");
    let [a, b] = [&one.0, &two.0].map(|rendered| pixels(rendered.image()));
    let [c, d] = [100, 200].map(|seed| mean_of_times(&folder, times, 1000 * first_seed + seed));
    let noise2 = 0.25 * (distance2(&a, &b) + distance2(&c, &d));
    let ratio = distance2(&mean(&a, &b), &mean(&c, &d)) / noise2;
    let flicker = two.0.flicker(&one.0).expect("errors are known");
    let still = mean_of_times(&folder, [0.5, 0.5], 300);
    let without = distance2(&mean(&a, &b), &still) / noise2;
    println!("{name}: {ratio:.3} of the noise; without blur {without:.1}; {flicker}");
    assert!((0.5..2.0).contains(&ratio), "{name}: {ratio} of the noise; {flicker}");
    assert!(
        without > 5.0,
        "{name}: it is told from a picture without blur by {without} only"
    );
}

/// A ball of glass with its caustic; lights stand still, and photon paths stay aimed.
#[test]
fn a_ball_and_its_caustic_are_blurred_as_the_mean_of_pictures_at_many_times() {
    assert_blurs_as_the_mean_of_times(
        "cornell-spheres",
        "glass-sphere",
        [[0.4, 0.3805, 0.35], [-0.2, 0.7, 0.35]],
        true,
    );
}

/// The lamp: direct light, what it lights, and its own picture. Photon paths start by power.
#[test]
#[ignore = "takes a minute"]
fn a_lamp_is_blurred_as_the_mean_of_pictures_at_many_times() {
    assert_blurs_as_the_mean_of_times("cornell", "light", [[-0.2, -0.3, 0.0], [0.2, -0.3, 0.0]], false);
}

/// The camera: everything that is seen.
#[test]
#[ignore = "takes a minute"]
fn a_moving_camera_is_blurred_as_the_mean_of_pictures_at_many_times() {
    assert_blurs_as_the_mean_of_times("cornell", "camera", [[-0.2, 1.0, 3.9], [0.2, 1.0, 3.9]], true);
}

fn scene(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    path.to_str().expect("UTF-8").to_owned()
}

#[test]
fn where_nothing_moves_a_shutter_changes_no_bit() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell-spheres.gltf");
    let of = ["--frame-time", "0", "--iterations", "9"];
    render(&folder, &scene, &[&of[..], &["-o", "without.exr"]].concat());
    render(
        &folder,
        &scene,
        &[&of[..], &["-o", "with.exr", "--shutter", "-0.5,0.5"]].concat(),
    );
    assert!(picture(&folder, "with.exr") == picture(&folder, "without.exr"));
}

#[test]
fn frames_with_a_shutter_go_on_with_the_same_bits_and_merge() {
    let folder = TempDir::new().expect("folder");
    animated::cornell(folder.path());
    let of = ["--frames", "2..3", "--fps", "8", "--shutter", "0,0.5"];
    assert_frames_go_on_and_merge(&folder, &of, ["0002", "0003"]);
    assert!(picture(&folder, "whole.0002.exr") != picture(&folder, "whole.0003.exr"));
}

#[test]
fn a_shutter_without_a_time_or_with_what_has_none_is_refused() {
    let folder = TempDir::new().expect("folder");
    let scene = scene("cornell.gltf");
    for (arguments, words) in [
        (&["--shutter", "0,1"][..], &["--shutter", "--frames"][..]),
        (
            &["--frame-time", "0", "--shutter", "1,0"],
            &["--shutter", "close after"],
        ),
        (&["--frame-time", "0", "--shutter", "1"], &["OPEN,CLOSE"]),
        (
            &["--frame-time", "0", "--shutter", "0,1", "--backend", "cpu"],
            &["--backend cpu"],
        ),
        (
            &["--frame-time", "0", "--shutter", "0,1", "--estimator", "ppm"],
            &["--estimator ppm"],
        ),
        (
            &["--frame-time", "0", "--shutter", "0,1", "--gather", "cluster-grid"],
            &["--gather"],
        ),
    ] {
        let output = ppm_vk(folder.path(), &[&["--scene", &scene], arguments].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{arguments:?}: {text}");
    }
}
