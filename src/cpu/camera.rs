//! Camera paths: through mirrors, glass and narrow lobes to visible points.

use glam::DVec3;

use super::bsdf::{Branch, Bsdf, Width};
use super::direct::narrow_reflection_of_lights;
use super::dispersion::disperse;
use super::environment::Environment;
use super::interaction::Interaction;
use super::intersect::{PlacedTriangle, Ray};
use super::lights::soft_light_along;
use super::media::{Media, transmittance};
use super::sampling::disc_point;
use super::surface::Surface;
use super::texture::nearest_visible_culled;
use super::vector::xyz;
use super::{FAR, Inputs};
use crate::config::{Estimator, PixelFilter};
use crate::layout::Settings;
use crate::random::{CameraTurn, PathKind, Random};

/// Where a camera path ends: the paper's hitpoint.
#[derive(Debug, Clone)]
pub struct VisiblePoint {
    /// Point of the surface.
    pub surface: Surface,
    /// Photons are gathered with its wide lobes.
    pub bsdf: Bsdf,
    /// Unit vector towards the path's previous vertex.
    pub viewer: DVec3,
    /// Factor from radiance at the point to radiance in the pixel.
    pub throughput: DVec3,
    /// Side of the pixel's footprint there, in render units.
    pub footprint: f64,
}

/// Result of a camera path with all its branches.
#[derive(Debug, Clone, Default)]
pub struct CameraPath {
    /// Emission along the path, in radiance.
    pub emitted: DVec3,
    /// Whether the path hit a surface.
    pub met: bool,
    /// Visible points, at most one per slot of the pixel.
    pub points: Vec<VisiblePoint>,
    /// Branches ended by the bounce limit.
    pub truncated: u64,
}

/// A path segment that has not been traced yet.
#[derive(Clone, Copy)]
struct Segment {
    ray: Ray,
    throughput: DVec3,
    distance: f64,
    depth: u32,
    ignored: Option<PlacedTriangle>,
    media: Media,
    /// Wavelength in nm, after dispersion.
    wavelength: Option<f64>,
    /// Whether the segment adds the emission of lights with an extent. False where direct lighting has sampled them.
    sees_lights: bool,
}

/// The ray through a position in a pixel (in [0, 1)², from its upper left corner) and a point of the lens.
fn camera_ray(settings: &Settings, pixel: [u32; 2], place: [f64; 2], lens: [f64; 4]) -> Ray {
    // −1 to 1, from left to right and from top to bottom.
    let film = |axis: usize| (f64::from(pixel[axis]) + place[axis]) / f64::from(settings.resolution[axis]) * 2.0 - 1.0;
    let (right, up) = (xyz(settings.camera_right), xyz(settings.camera_up));
    let on_film = film(0) * right - film(1) * up;
    let (mut origin, mut direction) = (xyz(settings.camera_position), xyz(settings.camera_forward));
    let is_parallel = settings.camera_up[3] != 0.0;
    *(if is_parallel { &mut origin } else { &mut direction }) += on_film;
    let radius = f64::from(settings.camera_position[3]);
    if radius > 0.0 {
        // All rays through one point of the image meet at the focal distance.
        let on_lens = radius * disc_point(lens[0], lens[1]);
        let off_axis = on_lens.x * right.normalize() + on_lens.y * up.normalize();
        origin += off_axis;
        direction = f64::from(settings.camera_right[3]) * direction - off_axis;
    }
    Ray {
        origin,
        direction: direction.normalize(),
    }
}

/// Traces one camera path of a pixel. At a surface with several lobes the path splits while the pixel has slots for all its
/// visible points; after that one lobe is chosen at random.
pub fn trace_camera_path(inputs: &Inputs<'_>, pixel: [u32; 2], turn: CameraTurn, pixel_slots: usize) -> CameraPath {
    let settings = inputs.settings;
    let number = pixel[1] * settings.resolution[0] + pixel[0];
    let mut random = Random::of_pixel(inputs.config, PathKind::Camera, number, turn);
    let [x, y, ..] = random.next4();
    let has_lens = settings.camera_position[3] > 0.0;
    let lens = if has_lens { random.next4() } else { [0.0; 4] };
    let place = match inputs.config.estimator {
        Estimator::Sppm if inputs.config.filter == PixelFilter::Box => [x, y],
        Estimator::Sppm => {
            let places = settings.filter_places.as_flattened();
            [x, y].map(|number| 0.5 + PixelFilter::place(places, number))
        }
        Estimator::Ppm => [0.5; 2],
    };
    let mut path = CameraPath::default();
    let mut pending = vec![Segment {
        ray: camera_ray(settings, pixel, place, lens),
        throughput: DVec3::ONE,
        distance: 0.0,
        depth: 0,
        ignored: None,
        media: Media::of(settings.camera_media),
        wavelength: None,
        sees_lights: true,
    }];
    while let Some(mut segment) = pending.pop() {
        let Some(met) = next_interaction(inputs, &mut segment, &mut path, &mut random) else {
            continue;
        };
        let (viewer, bsdf) = (-segment.ray.direction, met.bsdf(segment.wavelength));
        let [u, v, choice, _] = random.next4();
        let branches = bsdf.branches(viewer, [u, v]);
        if branches
            .iter()
            .any(|branch| branch.width == Width::Narrow && !branch.is_delta)
        {
            let seen = narrow_reflection_of_lights(inputs, &met, &bsdf, viewer, &random);
            path.emitted += segment.throughput * seen;
        }
        // End the path here, or continue it.
        let (wide, narrow): (Vec<Branch>, Vec<Branch>) =
            branches.into_iter().partition(|branch| branch.width == Width::Wide);
        let end_probability: f64 = wide.iter().map(|branch| branch.probability).sum();
        let mut choices: Vec<(f64, Option<Branch>)> = narrow
            .into_iter()
            .map(|branch| (branch.probability, Some(branch)))
            .collect();
        if end_probability > 0.0 {
            choices.insert(0, (end_probability, None));
        }
        let splits = path.points.len() + pending.len() + choices.len() <= pixel_slots;
        if !splits {
            let mut sum = 0.0;
            let chosen = choices.iter().position(|(probability, _)| {
                sum += probability;
                choice < sum
            });
            choices = choices
                .get(chosen.unwrap_or(choices.len().saturating_sub(1)))
                .copied()
                .into_iter()
                .collect();
        }
        for (probability, branch) in choices {
            let throughput = segment.throughput / if splits { 1.0 } else { probability };
            let Some(branch) = branch else {
                path.points.push(VisiblePoint {
                    surface: met.surface,
                    bsdf: bsdf.clone(),
                    viewer,
                    throughput,
                    footprint: footprint(settings, segment.distance),
                });
                continue;
            };
            // Radiance scales with the square of the refractive index: Veach, 1997, section 5.2.
            let throughput = throughput * branch.weight * branch.passes.map_or(1.0, |eta| eta * eta);
            if segment.depth + 1 >= settings.max_depth {
                path.truncated += 1;
            } else if throughput.max_element() > 0.0 {
                pending.push(Segment {
                    ray: Ray {
                        origin: met.surface.origin_towards(branch.direction),
                        direction: branch.direction,
                    },
                    throughput,
                    depth: segment.depth + 1,
                    ignored: Some(met.surface.triangle),
                    media: if branch.passes.is_some() {
                        met.beyond
                    } else {
                        met.through
                    },
                    sees_lights: branch.is_delta,
                    ..segment
                });
            }
        }
    }
    path
}

fn footprint(settings: &Settings, distance: f64) -> f64 {
    let is_parallel = settings.camera_up[3] != 0.0;
    f64::from(settings.pixel_spread) * if is_parallel { 1.0 } else { distance }
}

/// The next surface interaction of a segment. Adds the emission along the segment and at its end.
fn next_interaction(
    inputs: &Inputs<'_>,
    segment: &mut Segment,
    path: &mut CameraPath,
    random: &mut Random,
) -> Option<Interaction> {
    let culls = segment.depth == 0;
    loop {
        let hit = nearest_visible_culled(inputs, segment.ray, FAR, segment.ignored, culls, random);
        let end = hit.map_or(FAR, |hit| hit.t);
        if segment.sees_lights {
            let seen = soft_lights_along(inputs, segment.ray, end, segment.media);
            path.emitted += segment.throughput * seen;
        }
        let incoming = segment.ray.direction;
        let Some(hit) = hit else {
            let environment = Environment::of(&inputs.scene.environment).at(incoming);
            path.emitted += segment.throughput * environment.radiance;
            return None;
        };
        let met = Interaction::new(inputs, hit, incoming, segment.media, culls, random);
        segment.distance += hit.t;
        segment.throughput *= transmittance(inputs, met.through, hit.t);
        if met.hidden {
            segment.throughput *= met.tint;
            segment.media = met.beyond;
            segment.sees_lights = true;
            segment.ray.origin = met.surface.origin_towards(incoming);
            segment.ignored = Some(met.surface.triangle);
            continue;
        }
        path.met = true;
        path.emitted += segment.throughput * met.emitted(incoming);
        segment.throughput *= disperse(&met.surface.material, &mut segment.wavelength, random);
        return Some(met);
    }
}

/// Radiance of the lights with an extent that a ray (a unit vector) hits before `end`.
fn soft_lights_along(inputs: &Inputs<'_>, ray: Ray, end: f64, media: Media) -> DVec3 {
    let lights = inputs.scene.lights.iter().filter(|_| inputs.scene.features.soft);
    let met = lights.filter_map(|light| {
        let (radiance, distance) = soft_light_along(light, ray)?;
        (distance < end || end >= FAR).then(|| radiance * transmittance(inputs, media, distance))
    });
    met.sum()
}
