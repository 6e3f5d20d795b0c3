//! Renders whose buffers are all searched for invalid values.

use ppm_vk::internals::backend::{Backend, Counters};
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::film::Image;
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::layout::{DirectSum, Gathered, NO_OBJECT, Photon, Statistics, VisiblePoint};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::scene::Scene;
use ppm_vk::internals::stage::BufferId;

use super::bench::packed;

/// A small square picture.
pub fn square(side: u32, photons: u32) -> RenderConfig {
    RenderConfig {
        resolution: [side, side],
        photons,
        ..RenderConfig::default()
    }
}

/// The results of a render.
pub struct Rendered {
    pub image: Image,
    pub counters: Counters,
    pub renderer: Renderer,
}

/// Renders the view of a scene's camera. All buffers are valid, and nothing was left out except paths that are too long.
#[track_caller]
pub fn render(scene: &Scene, camera: usize, iterations: u32, config: RenderConfig) -> Rendered {
    render_within(None, scene, camera, iterations, config)
}

/// The same with photon buffers of at most this size in bytes.
#[track_caller]
pub fn render_within(
    bytes: Option<u64>,
    scene: &Scene,
    camera: usize,
    iterations: u32,
    config: RenderConfig,
) -> Rendered {
    let packed = packed(scene);
    let device = Device::open(None).expect("a Vulkan device");
    let camera = &scene.cameras[camera];
    let mut renderer = match bytes {
        Some(bytes) => Renderer::within(bytes, device, &packed, camera, config),
        None => Renderer::new(device, &packed, camera, config),
    }
    .expect("a renderer");
    for _ in 0..iterations {
        renderer.iterate().expect("an iteration");
    }
    let image = assert_sound(&mut renderer);
    let counters = renderer.counters();
    assert_eq!(counters.cut_paths, 0, "paths cut by the driver's loop limit");
    Rendered {
        image,
        counters,
        renderer,
    }
}

impl Rendered {
    pub fn download<T: bytemuck::AnyBitPattern>(&mut self, id: BufferId) -> Vec<T> {
        self.renderer.gpu().download(id, None).expect("a buffer")
    }

    /// The photons of the last batch.
    pub fn photons(&mut self) -> Vec<Photon> {
        photons(&mut self.renderer)
    }
}

fn photons(renderer: &mut Renderer) -> Vec<Photon> {
    let gpu = renderer.gpu();
    let count: Vec<u32> = gpu
        .download(BufferId::PhotonCount, None)
        .expect("the number of photons");
    gpu.download(BufferId::Photons, Some(count[0] as usize))
        .expect("photons")
}

/// Resolves the picture. It contains no NaN, infinity or negative value, nor do the buffers that it is made of, and none was left
/// out.
#[track_caller]
pub fn assert_sound(renderer: &mut Renderer) -> Image {
    let image = renderer.resolve().expect("a picture");
    assert_eq!(renderer.counters().non_finite, 0, "NaN or infinity in a stage");
    let slots = renderer.sizes().slots() as usize;
    let photons = photons(renderer);
    let points: Vec<VisiblePoint> = download(renderer, BufferId::VisiblePoints, slots);
    let statistics: Vec<Statistics> = download(renderer, BufferId::StatisticsOf, slots);
    let gathered: Vec<Gathered> = download(renderer, BufferId::GatheredOf, slots);
    let sums: Vec<DirectSum> = download(renderer, BufferId::DirectSums, slots);

    let first3 = |v: [f32; 4]| [v[0], v[1], v[2]];
    assert_numbers("positions of Photons", photons.iter().map(|photon| photon.position));
    assert_amounts("flux of Photons", photons.iter().map(|photon| photon.flux));
    assert_numbers("positions of VisiblePoints", points.iter().map(|point| point.position));
    assert_amounts("weights of VisiblePoints", points.iter().map(|point| point.weight));
    assert_amounts("radiance of VisiblePoints", points.iter().map(|point| point.emitted));
    assert_amounts("R² of StatisticsOf", statistics.iter().map(|s| [s.radius2_high; 3]));
    assert_amounts("τ of StatisticsOf", statistics.iter().map(|s| first3(s.flux_high)));
    assert_numbers(
        "rest of τ of StatisticsOf",
        statistics.iter().map(|s| first3(s.flux_low)),
    );
    assert_numbers(
        "rest of R² of StatisticsOf",
        statistics.iter().map(|s| [s.radius2_low; 3]),
    );
    assert_amounts("GatheredOf", gathered.iter().map(|gathered| gathered.flux));
    assert_amounts("DirectSums", sums.iter().map(|sum| first3(sum.high)));
    assert_numbers("rest of DirectSums", sums.iter().map(|sum| first3(sum.low)));
    assert_amounts("Film", image.pixels().iter().copied());
    for (slot, (s, point)) in statistics.iter().zip(&points).enumerate() {
        let sees_a_surface = point.object != NO_OBJECT;
        let has_photons = (s.accepted_low | s.accepted_high) != 0;
        assert!(
            !(sees_a_surface && has_photons) || s.radius2_high > 0.0,
            "slot {slot} of StatisticsOf: R² is 0"
        );
    }
    image
}

fn download<T: bytemuck::AnyBitPattern>(renderer: &mut Renderer, id: BufferId, count: usize) -> Vec<T> {
    renderer.gpu().download(id, Some(count)).expect("a buffer")
}

#[track_caller]
fn assert_numbers(what: &str, values: impl Iterator<Item = [f32; 3]>) {
    for (index, value) in values.enumerate() {
        assert!(
            value.iter().all(|v| v.is_finite()),
            "{what}, element {index}: {value:?}"
        );
    }
}

#[track_caller]
fn assert_amounts(what: &str, values: impl Iterator<Item = [f32; 3]>) {
    for (index, value) in values.enumerate() {
        let sound = value.iter().all(|v| v.is_finite() && *v >= 0.0);
        assert!(sound, "{what}, element {index}: {value:?}");
    }
}

/// Mean of independent samples, and its standard deviation.
pub fn mean_of(samples: &[f64]) -> (f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|sample| (sample - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Checks the mean of independent samples. The probability of exceeding 6 standard deviations of the mean, measured from the
/// samples, is 2 in 10⁹, and below 10⁻⁶ for all comparisons of a test. `known`: a bound of the systematic error, which is added.
#[track_caller]
pub fn assert_mean(what: &str, samples: &[f64], expected: f64, known: f64) {
    let (mean, deviation) = mean_of(samples);
    println!(
        "{what}: {mean} ± {deviation:.1e} of {} samples, {expected} expected",
        samples.len()
    );
    assert!(samples.len() >= 500, "{what}: only {} samples", samples.len());
    assert!(
        (mean - expected).abs() <= 6.0 * deviation + known,
        "{what}: the mean of {} samples is {mean} ± {deviation}, {expected} expected",
        samples.len()
    );
}
