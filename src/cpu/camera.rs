//! Camera paths: over mirrors, glass and narrow reflections to their visible points.

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
use super::texture::nearest_seen;
use super::vector::xyz;
use super::{FAR, Inputs};
use crate::config::Estimator;
use crate::layout::Settings;
use crate::random::{CameraTurn, PathKind, Random};

/// Where a camera path ends: the paper's hitpoint.
#[derive(Debug, Clone)]
pub struct VisiblePoint {
    /// Place.
    pub surface: Surface,
    /// Its wide lobes gather.
    pub bsdf: Bsdf,
    /// Unit vector to where the path came from.
    pub viewer: DVec3,
    /// Of what leaves the point, in the pixel.
    pub throughput: DVec3,
    /// Side of the pixel there, render units.
    pub footprint: f64,
}

/// What a path, with its branches, has found.
#[derive(Debug, Clone, Default)]
pub struct CameraPath {
    /// Radiance that it saw by itself.
    pub emitted: DVec3,
    /// Whether it met a surface.
    pub met: bool,
    /// Where it ends: as many as there is room for.
    pub points: Vec<VisiblePoint>,
    /// Branches that the bounce limit ended.
    pub truncated: u64,
}

/// A part of a path that is still to be followed.
#[derive(Clone, Copy)]
struct Segment {
    ray: Ray,
    throughput: DVec3,
    way: f64,
    depth: u32,
    ignored: Option<PlacedTriangle>,
    media: Media,
    /// Of its light, nm.
    wavelength: Option<f64>,
    /// No ray to a light has been asked instead of this one.
    sees_lights: bool,
}

/// The ray through a place of a pixel, both parts in [0, 1) from its upper left corner, and of the lens.
fn camera_ray(settings: &Settings, pixel: [u32; 2], place: [f64; 2], lens: [f64; 4]) -> Ray {
    // −1 to 1 from left to right and from top to bottom.
    let film = |axis: usize| (f64::from(pixel[axis]) + place[axis]) / f64::from(settings.resolution[axis]) * 2.0 - 1.0;
    let (right, up) = (xyz(settings.camera_right), xyz(settings.camera_up));
    let on_film = film(0) * right - film(1) * up;
    let (mut origin, mut direction) = (xyz(settings.camera_position), xyz(settings.camera_forward));
    let is_parallel = settings.camera_up[3] != 0.0;
    *(if is_parallel { &mut origin } else { &mut direction }) += on_film;
    let radius = f64::from(settings.camera_position[3]);
    if radius > 0.0 {
        // All rays of a place in the picture meet where it is in focus.
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

/// Follows one of an iteration's paths of a pixel. Where it can go several ways it goes all of them as long as there is room for
/// so many visible points, and then one by chance.
pub fn trace_camera_path(inputs: &Inputs<'_>, pixel: [u32; 2], turn: CameraTurn, room: usize) -> CameraPath {
    let settings = inputs.settings;
    let number = pixel[1] * settings.resolution[0] + pixel[0];
    let mut random = Random::of_pixel(inputs.config, PathKind::Camera, number, turn);
    let [x, y, ..] = random.next4();
    let has_lens = settings.camera_position[3] > 0.0;
    let lens = if has_lens { random.next4() } else { [0.0; 4] };
    let place = match inputs.config.estimator {
        Estimator::Sppm => [x, y],
        Estimator::Ppm => [0.5; 2],
    };
    let mut path = CameraPath::default();
    let mut pending = vec![Segment {
        ray: camera_ray(settings, pixel, place, lens),
        throughput: DVec3::ONE,
        way: 0.0,
        depth: 0,
        ignored: None,
        media: Media::of(settings.camera_media),
        wavelength: None,
        sees_lights: true,
    }];
    while let Some(mut segment) = pending.pop() {
        let Some(met) = meet(inputs, &mut segment, &mut path, &mut random) else {
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
        // To end there, or to go on.
        let (wide, narrow): (Vec<Branch>, Vec<Branch>) =
            branches.into_iter().partition(|branch| branch.width == Width::Wide);
        let ends: f64 = wide.iter().map(|branch| branch.probability).sum();
        let mut ways: Vec<(f64, Option<Branch>)> = narrow
            .into_iter()
            .map(|branch| (branch.probability, Some(branch)))
            .collect();
        if ends > 0.0 {
            ways.insert(0, (ends, None));
        }
        let splits = path.points.len() + pending.len() + ways.len() <= room;
        if !splits {
            let mut sum = 0.0;
            let chosen = ways.iter().position(|(probability, _)| {
                sum += probability;
                choice < sum
            });
            ways = ways
                .get(chosen.unwrap_or(ways.len().saturating_sub(1)))
                .copied()
                .into_iter()
                .collect();
        }
        for (probability, branch) in ways {
            let throughput = segment.throughput / if splits { 1.0 } else { probability };
            let Some(branch) = branch else {
                path.points.push(VisiblePoint {
                    surface: met.surface,
                    bsdf: bsdf.clone(),
                    viewer,
                    throughput,
                    footprint: footprint(settings, segment.way),
                });
                continue;
            };
            // Radiance is compressed on its way into the denser medium: Veach, 1997, section 5.2.
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

fn footprint(settings: &Settings, way: f64) -> f64 {
    let is_parallel = settings.camera_up[3] != 0.0;
    f64::from(settings.pixel_spread) * if is_parallel { 1.0 } else { way }
}

/// What a segment meets, and what it sees by itself on its way there and of it.
fn meet(inputs: &Inputs<'_>, segment: &mut Segment, path: &mut CameraPath, random: &mut Random) -> Option<Interaction> {
    let culls = segment.depth == 0;
    loop {
        let hit = nearest_seen(inputs, segment.ray, FAR, segment.ignored, culls, random);
        let end = hit.map_or(FAR, |hit| hit.t);
        if segment.sees_lights {
            let seen = soft_lights_along(inputs, segment.ray, end, segment.media);
            path.emitted += segment.throughput * seen;
        }
        let incoming = segment.ray.direction;
        let Some(hit) = hit else {
            let sky = Environment::of(&inputs.scene.environment).at(incoming);
            path.emitted += segment.throughput * sky.radiance;
            return None;
        };
        let met = Interaction::new(inputs, hit, incoming, segment.media, culls, random);
        segment.way += hit.t;
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

/// Radiance of lights with an extent that a ray along a unit vector meets within `end`.
fn soft_lights_along(inputs: &Inputs<'_>, ray: Ray, end: f64, media: Media) -> DVec3 {
    let lights = inputs.scene.lights.iter().filter(|_| inputs.scene.features.soft);
    let met = lights.filter_map(|light| {
        let (radiance, way) = soft_light_along(light, ray)?;
        (way < end || end >= FAR).then(|| radiance * transmittance(inputs, media, way))
    });
    met.sum()
}
