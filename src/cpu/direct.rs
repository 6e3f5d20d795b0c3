//! What each visible point's path sees of the lights: by itself and, unless photons carry direct light too, by one
//! shadow ray to a point of a light chosen in proportion to its flux.

use glam::DVec3;
use rayon::prelude::*;

use super::intersect::{Ray, is_blocked};
use super::light::{choose_light, emits};
use super::random::{PathKind, Random};
use super::sampling::{decode_direction, triangle_point};
use super::surface::{offset_origin, surface_at};
use super::vector::{from_two_floats, rgb, to_two_floats, word, xyz};
use super::{Counts, Inputs};
use crate::config::Direct;
use crate::layout::{DirectSum, NO_OBJECT, VisiblePoint};

/// Adds an iteration's radiance to the sum of each slot.
pub fn direct(
    inputs: &Inputs<'_>,
    iteration: u32,
    visible_points: &[VisiblePoint],
    counts: &Counts,
    direct_sums: &mut [DirectSum],
) {
    let slots = direct_sums.par_iter_mut().zip(visible_points).enumerate();
    slots.for_each(|(slot, (sum, point))| {
        let mut radiance = xyz(point.emitted_normal);
        if inputs.config.direct == Direct::Light && word(point.position_object) != NO_OBJECT {
            let mut random = Random::new(PathKind::LightSample, slot as u32, iteration, inputs.settings.seed);
            radiance += sample_light(inputs, point, random.next4());
        }
        if radiance.is_finite() {
            (sum.high, sum.low) = to_two_floats(from_two_floats(sum.high, sum.low) + radiance);
        } else {
            counts.add_non_finite(1);
        }
    });
}

/// weight · Le · cos θ_surface · cos θ_light / distance², over the density per area of the chosen point.
fn sample_light(inputs: &Inputs<'_>, point: &VisiblePoint, [choice, u, v, _]: [f64; 4]) -> DVec3 {
    let light = choose_light(&inputs.scene.lights, choice);
    let (u, v) = triangle_point(u, v);
    let emitter = surface_at(inputs.scene, light.triangle, u, v);

    let position = xyz(point.position_object);
    let geometric_normal = decode_direction(word(point.weight_normal));
    let shading_normal = decode_direction(word(point.emitted_normal));
    let to_light = emitter.position - position;
    let distance2 = to_light.length_squared();
    if distance2 == 0.0 {
        return DVec3::ZERO;
    }
    let direction = to_light / distance2.sqrt();
    let cos_light = -direction.dot(emitter.geometric_normal);
    let cos_surface = direction.dot(shading_normal);
    let front = cos_light > 0.0;
    if !emits(emitter.material, front) || cos_surface <= 0.0 || direction.dot(geometric_normal) <= 0.0 {
        return DVec3::ZERO;
    }
    let towards_surface = if front {
        emitter.geometric_normal
    } else {
        -emitter.geometric_normal
    };
    let origin = offset_origin(position, geometric_normal);
    let shadow_ray = Ray {
        origin,
        direction: offset_origin(emitter.position, towards_surface) - origin,
    };
    if is_blocked(inputs, shadow_ray, 1.0, Some(light.triangle)) {
        return DVec3::ZERO;
    }
    let density = f64::from(light.probability) / f64::from(light.area);
    xyz(point.weight_normal) * rgb(emitter.material.emission) * cos_surface * cos_light.abs() / (distance2 * density)
}
