//! What each visible point's path sees of the lights: by itself and, unless photons carry direct light too, by one
//! ray towards a light.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::camera::SeenSlice;
use super::environment::{Environment, Sky};
use super::gloss::Reflector;
use super::intersect::{PlacedTriangle, Ray};
use super::light::{Arriving, arriving_from, choose_light, emits, emitted_radiance, is_punctual};
use super::random::{PathKind, Random};
use super::sampling::{cosine_direction, decode_direction, triangle_point};
use super::surface::{offset_origin, reach_of, surface_at, surface_of};
use super::texture::{apply_textures, nearest_visible, share_there};
use super::vector::{from_two_floats, to_two_floats, word, xyz};
use super::{Counts, FAR, Inputs};
use crate::config::Direct;
use crate::layout::{DirectSum, ENVIRONMENT_LIGHT, NO_LIGHT, NO_OBJECT, VisiblePoint};

/// Adds an iteration's radiance to the sum of each slot.
pub fn direct<'a>(
    inputs: &Inputs<'_>,
    iteration: u32,
    seen: impl Into<SeenSlice<'a>>,
    counts: &Counts,
    direct_sums: &mut [DirectSum],
) {
    let seen = seen.into();
    let slots = direct_sums.par_iter_mut().zip(seen.points).enumerate();
    slots.for_each(|(slot, (sum, point))| {
        let mut radiance = xyz(point.emitted_normal);
        if inputs.config.direct == Direct::Light && word(point.position_object) != NO_OBJECT {
            let mut random = Random::of_pixel(inputs, PathKind::LightSample, slot as u32, iteration);
            let sample = random.next4();
            let digits = if inputs.scene.lights.len() > 1 {
                random.next4()
            } else {
                [0.0; 4]
            };
            radiance += sample_direct(inputs, point, seen.reflector(slot), sample, digits, &random);
        }
        if radiance.is_finite() {
            (sum.high, sum.low) = to_two_floats(from_two_floats(sum.high, sum.low) + radiance.extend(0.0));
        } else {
            counts.add_non_finite(1);
        }
    });
}

/// A shadow ray ends this part of its length before the light, as it does on a device.
const ENDS_BEFORE: f64 = 16.0 / 16_777_216.0;

/// weight · BRDF · L · cos θ_surface over the density per solid angle of both ways to choose the ray: towards a light
/// chosen in proportion to its flux, or along a direction of the BSDF, which never meets a light without extent.
fn sample_direct(
    inputs: &Inputs<'_>,
    point: &VisiblePoint,
    gloss: Option<(Reflector, DVec3)>,
    [choice, u, v, way]: [f64; 4],
    [first_digits, _, second_digits, _]: [f64; 4],
    random: &Random,
) -> DVec3 {
    let position = xyz(point.position_object);
    let geometric_normal = decode_direction(word(point.weight_normal));
    let shading_normal = decode_direction(word(point.emitted_normal));
    let origin = offset_origin(
        position,
        geometric_normal,
        reach_of(inputs.scene, word(point.position_object)),
    );
    // A reflection may be too narrow for points of lights to find it.
    let wide = gloss.filter(|(reflector, _)| reflector.alpha > 0.0);
    let (q, reflections) = match (wide, f64::from(inputs.settings.bsdf_sampling)) {
        (Some((reflector, viewer)), q) if q > 0.0 => {
            (0.5, reflector.reflection_probability(shading_normal.dot(viewer)))
        }
        (_, q) => (q, 0.0),
    };
    let leaves = |ray: DVec3| ray.dot(geometric_normal) > 0.0 && ray.dot(shading_normal) > 0.0;
    let is_free = |direction: DVec3, end: f64, ignored: Option<PlacedTriangle>| {
        leaves(direction) && nearest_visible(inputs, Ray { origin, direction }, end, ignored, random).is_none()
    };
    // What a unit of irradiance across a direction adds.
    let response = |direction: DVec3| {
        let brdf = gloss.map_or(DVec3::ONE, |(reflector, viewer)| {
            reflector.brdf(shading_normal, viewer, direction)
        });
        xyz(point.weight_normal) * brdf * direction.dot(shading_normal)
    };
    let seen = |Sky { radiance, density }: Sky, direction: DVec3| {
        let mut of_bsdf = (1.0 - reflections) * direction.dot(shading_normal) / PI;
        if let Some((reflector, viewer)) = wide {
            of_bsdf += reflections * reflector.reflected_density(shading_normal, viewer, direction);
        }
        response(direction) * radiance / ((1.0 - q) * density + q * of_bsdf)
    };
    let sky = |sky: Sky, direction: DVec3| {
        let probability = inputs.scene.lights.last().map_or(0.0, |light| light.probability);
        let density = sky.density * f64::from(probability);
        seen(Sky { density, ..sky }, direction)
    };
    let environment = Environment::of(&inputs.scene.environment);

    let by_bsdf = way < q;
    let mut emitter = if by_bsdf {
        let direction = match wide {
            Some((reflector, viewer)) if choice < reflections => {
                reflector.reflected_direction(shading_normal, viewer, [u, v])
            }
            _ => cosine_direction(shading_normal, u, v),
        };
        if !leaves(direction) {
            return DVec3::ZERO;
        }
        let Some(hit) = nearest_visible(inputs, Ray { origin, direction }, FAR, None, random) else {
            return sky(environment.at(direction), direction);
        };
        surface_of(inputs.scene, hit)
    } else {
        let light = choose_light(&inputs.scene.lights, choice, [first_digits, second_digits]).light;
        if is_punctual(light) {
            let Arriving { ray, end, irradiance } = arriving_from(light, origin);
            return if is_free(ray, end, None) {
                response(ray.normalize()) * irradiance / (f64::from(light.probability) * (1.0 - q))
            } else {
                DVec3::ZERO
            };
        }
        if light.kind == ENVIRONMENT_LIGHT {
            let (direction, sampled) = environment.sample(u, v);
            return if is_free(direction, FAR, None) {
                sky(sampled, direction)
            } else {
                DVec3::ZERO
            };
        }
        let (u, v) = triangle_point(u, v);
        let emitter = surface_at(inputs.scene, PlacedTriangle::unplaced(light.triangle), u, v);
        let direction = emitter.origin_towards(position - emitter.position) - origin;
        if !is_free(
            direction,
            1.0 - ENDS_BEFORE,
            Some(PlacedTriangle::unplaced(light.triangle)),
        ) {
            return DVec3::ZERO;
        }
        emitter
    };
    if emitter.light == NO_LIGHT {
        return DVec3::ZERO;
    }
    apply_textures(inputs.scene, &mut emitter);
    // A ray that met the light had its chance to pass it.
    let there = if by_bsdf {
        1.0
    } else {
        share_there(inputs.scene, &emitter)
    };
    let light = &inputs.scene.lights[emitter.light as usize];
    let to_light = emitter.position - position;
    let direction = to_light.normalize_or_zero();
    let cos_light = -direction.dot(emitter.geometric_normal);
    if !emits(&emitter.material, cos_light > 0.0) || direction.dot(shading_normal) <= 0.0 || cos_light == 0.0 {
        return DVec3::ZERO;
    }
    let radiance = there * emitted_radiance(&emitter.material, cos_light.abs());
    let density = f64::from(light.probability) * to_light.length_squared() / (f64::from(light.area) * cos_light.abs());
    seen(Sky { radiance, density }, direction)
}
