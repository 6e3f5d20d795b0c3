//! Photon tracing, and moving the photons together.

use glam::DVec3;
use rayon::prelude::*;

use super::boundary::Boundary;
use super::contact::{Encounter, choose_part, has_coat};
use super::dispersion::disperse;
use super::emission::{emit, guide};
use super::gloss::Reflector;
use super::intersect::{PlacedTriangle, Ray};
use super::light::range_window;
use super::media::{Media, transmittance};
use super::sampling::{cosine_direction, encode_direction};
use super::texture::nearest_visible;
use super::vector::{mean, rgb, with_word};
use super::{Counts, Demand, FAR, Inputs};
use crate::config::Direct;
use crate::emission::PathValue;
use crate::layout::{CAUSTIC, FOLLOWED_ALPHA, GLOSSY_SURFACE, MATTE, MIRROR, Material, Photon};
use crate::random::Random;

/// Photon paths that are followed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Batch {
    /// The iteration.
    pub iteration: u32,
    /// Number within the iteration of its first path.
    pub first_path: u32,
    /// Its paths.
    pub paths: u32,
}

/// What a batch of photon paths left behind.
#[derive(Debug, Clone, Default)]
pub struct Traced {
    /// The photons of each lane, in path order: lane i of n follows the paths i, i + n, i + 2n, …
    pub lanes: Vec<Vec<Photon>>,
    /// What each path was worth, in path order: [`PathValue::packed`].
    pub values: Vec<u32>,
}

/// Follows a batch of photon paths.
pub fn photons(inputs: &Inputs<'_>, batch: Batch, counts: &Counts) -> Traced {
    let lanes = inputs.settings.photon_lanes;
    let follow_lane = |lane: u32| {
        let (mut photons, mut values) = (Vec::new(), Vec::new());
        for path in (lane..batch.paths).step_by(lanes as usize) {
            let value = follow(inputs, batch.first_path + path, batch.iteration, &mut photons, counts);
            values.push(value.packed());
        }
        (photons, values)
    };
    let (photons, of_lanes): (Vec<_>, Vec<_>) = (0..lanes).into_par_iter().map(follow_lane).unzip();
    let value_of = |path: u32| of_lanes[(path % lanes) as usize][(path / lanes) as usize];
    Traced {
        lanes: photons,
        values: (0..batch.paths).map(value_of).collect(),
    }
}

/// The photons of all lanes, one lane after the other.
pub fn compact(lanes: &[Vec<Photon>]) -> Vec<Photon> {
    lanes.concat()
}

struct Path {
    ray: Ray,
    flux: DVec3,
    ignored: Option<PlacedTriangle>,
    /// That it is in.
    media: Media,
    /// Of its light, nm.
    wavelength: Option<f64>,
    /// No bounce since the light: direct light, which the stage `direct` samples.
    seen_directly: bool,
    /// Mirrors and glass alone since the light.
    caustic: bool,
    /// Of the light, until the first surface.
    inverse_range: f64,
}

/// Russian roulette that keeps the photons' powers alike: a photon survives with the ratio of the largest channels of
/// the scattered and the arriving flux. `None` for one that doesn't.
fn roulette(arriving: DVec3, scattered: DVec3, u: f64) -> Option<DVec3> {
    let arriving = arriving.max_element();
    let probability = if arriving > 0.0 {
        (scattered.max_element() / arriving).min(1.0)
    } else {
        0.0
    };
    (u < probability).then(|| scattered / probability)
}

/// Returns what the path was worth, for where later ones are aimed.
fn follow(inputs: &Inputs<'_>, path: u32, iteration: u32, photons: &mut Vec<Photon>, counts: &Counts) -> PathValue {
    let mut value = PathValue { value: 0.0, rays: 0 };
    let settings = inputs.settings;
    let samples_lights = inputs.config.direct == Direct::Light;
    let mut random = Random::of_photon(inputs.config, path, iteration);
    let emission = emit(inputs, &mut random);
    let mut path = Path {
        ray: emission.ray,
        flux: emission.flux,
        ignored: emission.ignored,
        media: emission.media,
        wavelength: None,
        seen_directly: true,
        caustic: true,
        inverse_range: emission.inverse_range,
    };
    let mut depth = 0;
    while depth < settings.max_depth {
        if path.flux.max_element() <= 0.0 {
            return value;
        }
        value.rays += 1;
        let Some(hit) = nearest_visible(inputs, path.ray, FAR, path.ignored, &random) else {
            return value;
        };
        let incoming = path.ray.direction;
        let met = Encounter::new(inputs, hit, incoming, path.media, false, &random);
        let (surface, mut facing) = (met.surface, met.facing);
        let mut material = surface.material;
        path.flux *= transmittance(inputs, met.through, hit.t);
        // A range is how far the light itself reaches, not what it lights.
        path.flux *= range_window(path.inverse_range, hit.t);
        if path.flux.max_element() <= 0.0 {
            return value;
        }
        if met.hidden {
            path.flux *= met.tint;
            path.media = met.beyond;
            // No ray to a light passes it.
            path.seen_directly = false;
            path.ray.origin = surface.origin_towards(incoming);
            path.ignored = Some(surface.triangle);
            continue;
        }
        depth += 1;
        let mut u = random.next4();
        let (mixed, rest) = choose_part(&mut material, u[3]);
        u[3] = rest;
        let [choice, second, survival, _] = u;
        let scatters = |material: &Material| [MATTE, GLOSSY_SURFACE].contains(&material.surface);
        let wide_coat = material.coat > 0.0 && f64::from(material.coat_roughness).powi(2) >= FOLLOWED_ALPHA;
        let mut landing = path.flux;
        if mixed || wide_coat || scatters(&material) {
            landing *= facing.landing_correction(incoming);
            if !landing.as_vec3().is_finite() {
                counts.add_non_finite(1);
                return value;
            }
            if !(samples_lights && path.seen_directly) {
                counts.add_landed(1);
                let (map, map_bit) = if settings.photon_maps > 1 && path.caustic && !path.seen_directly {
                    (1, CAUSTIC)
                } else {
                    (0, 0)
                };
                let position = surface.position.as_vec3();
                let at = |demand: &Demand| demand.at(settings, position, surface.object, map);
                let wanted = inputs.demand.map_or(1.0, at);
                if wanted > 0.0 {
                    let worth = f64::from(wanted) * mean(landing).powi(2);
                    value.value = (f64::from(value.value) + worth).min(1e37) as f32;
                    // Across the ray: a coat has another shading normal than what lies below it.
                    let across = path.flux / -incoming.dot(facing.geometric_normal);
                    let flux = if has_coat(inputs, &surface) { across } else { landing };
                    photons.push(Photon {
                        position_object: with_word(surface.position, surface.object | map_bit),
                        // What is there in part is seen in part as well as met in part.
                        flux_direction: with_word(flux / met.share, encode_direction(incoming)),
                    });
                }
            }
        }
        let mut layer = 1.0;
        if material.coat > 0.0 {
            let [u, ..] = random.next4();
            layer = facing.choose_layer(&mut material, surface.coat_normal, incoming, u);
            landing = path.flux * layer * facing.landing_correction(incoming);
        }
        let kind = material.surface;
        let (mut media, mut wavelength) = (path.media, path.wavelength);
        let (direction, flux) = if scatters(&material) {
            // Drawn around the geometric normal, the outgoing direction needs no second correction.
            let cosine = cosine_direction(facing.geometric_normal, choice, second);
            let (outgoing, weight, guided) = if kind == GLOSSY_SURFACE {
                let (outgoing, weight) = facing.scatter(&Reflector::of_material(&material), incoming, u, cosine);
                (outgoing, weight, 1.0)
            } else {
                let position = surface.position;
                let (outgoing, guided) = guide(inputs, position, facing.geometric_normal, u, cosine);
                (outgoing, rgb(material.base_color), guided)
            };
            // Those that are aimed shall come there, with less flux each.
            let scattered = roulette(path.flux, landing * weight, survival).map(|flux| flux * guided);
            (
                outgoing,
                scattered.filter(|_| guided > 0.0 && outgoing.dot(facing.shading_normal) > 0.0),
            )
        } else if kind == MIRROR {
            let reflected = path.flux * layer * facing.mirror_reflectance(&material, incoming);
            (facing.reflect(incoming), roulette(path.flux, reflected, survival))
        } else {
            path.flux *= disperse(&mut material, &mut wavelength, &mut random);
            let boundary = Boundary::new(&facing, incoming, &material, met.outside, [u[1], u[3]]);
            let (direction, weight, side) = match boundary.refracted {
                Some(refracted) if choice >= boundary.reflectance => {
                    (refracted, met.tint * boundary.refracted_weight, met.beyond)
                }
                _ => (boundary.reflected, boundary.reflected_weight, met.through),
            };
            media = side;
            (direction, roulette(path.flux, path.flux * layer * weight, survival))
        };
        let Some(flux) = flux else { return value };
        path = Path {
            ray: Ray {
                origin: surface.origin_towards(direction),
                direction,
            },
            flux,
            ignored: Some(surface.triangle),
            media,
            wavelength,
            seen_directly: false,
            caustic: path.caustic && !scatters(&material),
            inverse_range: 0.0,
        };
    }
    counts.add_truncated(1);
    value
}
