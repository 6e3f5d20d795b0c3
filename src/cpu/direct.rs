//! What each visible point's path sees of the lights: by itself and, unless photons carry direct light too, by one
//! ray towards a light.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::camera::SeenSlice;
use super::gloss::Reflector;
use super::intersect::{Ray, is_blocked, nearest_hit};
use super::light::{choose_light, emits};
use super::random::{PathKind, Random};
use super::sampling::{cosine_direction, decode_direction, triangle_point};
use super::surface::{offset_origin, reach_of, surface_at};
use super::vector::{from_two_floats, rgb, to_two_floats, word, xyz};
use super::{Counts, FAR, Inputs};
use crate::config::Direct;
use crate::layout::{DirectSum, NO_LIGHT, NO_OBJECT, VisiblePoint};

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
            radiance += sample_direct(inputs, point, seen.reflector(slot), random.next4());
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

/// weight · Le · cos θ_surface over the density per solid angle of both ways to choose the ray: towards a point of a
/// light chosen in proportion to its flux, or along a direction of the BSDF.
fn sample_direct(
    inputs: &Inputs<'_>,
    point: &VisiblePoint,
    gloss: Option<(Reflector, DVec3)>,
    [choice, u, v, way]: [f64; 4],
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
    let (q, reflections) = match wide {
        Some((reflector, viewer)) => (0.5, reflector.reflection_probability(shading_normal.dot(viewer))),
        None => (f64::from(inputs.settings.bsdf_sampling), 0.0),
    };
    let by_bsdf = way < q;
    let leaves = |ray: DVec3| ray.dot(geometric_normal) > 0.0 && ray.dot(shading_normal) > 0.0;

    let emitter = if by_bsdf {
        let direction = match wide {
            Some((reflector, viewer)) if choice < reflections => {
                reflector.reflected_direction(shading_normal, viewer, [u, v])
            }
            _ => cosine_direction(shading_normal, u, v),
        };
        let hit = leaves(direction)
            .then(|| nearest_hit(inputs, Ray { origin, direction }, FAR, None))
            .flatten();
        hit.map(|hit| surface_at(inputs.scene, hit.triangle, hit.u, hit.v))
    } else {
        let light = choose_light(&inputs.scene.lights, choice).light;
        let (u, v) = triangle_point(u, v);
        let emitter = surface_at(inputs.scene, light.triangle, u, v);
        let front = (position - emitter.position).dot(emitter.geometric_normal) > 0.0;
        let towards_surface = if front {
            emitter.geometric_normal
        } else {
            -emitter.geometric_normal
        };
        let direction = offset_origin(emitter.position, towards_surface, emitter.reach) - origin;
        let ray = Ray { origin, direction };
        let reaches = leaves(direction) && !is_blocked(inputs, ray, 1.0 - ENDS_BEFORE, Some(light.triangle));
        reaches.then_some(emitter)
    };
    let Some(emitter) = emitter.filter(|emitter| emitter.light != NO_LIGHT) else {
        return DVec3::ZERO;
    };
    let light = &inputs.scene.lights[emitter.light as usize];
    let to_light = emitter.position - position;
    let distance2 = to_light.length_squared();
    let direction = to_light.normalize_or_zero();
    let cos_light = -direction.dot(emitter.geometric_normal);
    let cos_surface = direction.dot(shading_normal);
    if !emits(emitter.material, cos_light > 0.0) || cos_surface <= 0.0 || cos_light == 0.0 {
        return DVec3::ZERO;
    }
    let of_light = f64::from(light.probability) * distance2 / (f64::from(light.area) * cos_light.abs());
    let mut of_bsdf = (1.0 - reflections) * cos_surface / PI;
    if let Some((reflector, viewer)) = wide {
        of_bsdf += reflections * reflector.reflected_density(shading_normal, viewer, direction);
    }
    let brdf = gloss.map_or(DVec3::ONE, |(reflector, viewer)| {
        reflector.brdf(shading_normal, viewer, direction)
    });
    xyz(point.weight_normal)
        * brdf
        * rgb(emitter.material.emission)
        * (cos_surface / ((1.0 - q) * of_light + q * of_bsdf))
}
