//! What each visible point's path sees of the lights: by itself and, unless photons carry direct light too, by one
//! ray towards a light. Where glass alone stands between, photons have to bring that light: what it would be unbent is kept.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::camera::SeenSlice;
use super::contact::Interface;
use super::environment::{Environment, Sky};
use super::gloss::Reflector;
use super::intersect::{Hit, PlacedTriangle, Ray};
use super::light::{
    Arriving, arriving_from, choose_light, emits, emitted_radiance, is_punctual, light_at_place, point_of_light,
};
use super::light_sources::{self, choose_light_for, choose_light_of, probability_for};
use super::media::{Media, transmittance};
use super::resolve::photons_of;
use super::sampling::{cosine_direction, decode_direction};
use super::surface::{offset_origin, reach_of, surface_at, surface_of};
use super::texture::{apply_textures, nearest_visible, share_there};
use super::vector::{from_two_floats, rgb, to_two_floats, word, xyz};
use super::{Counts, FAR, Inputs};
use crate::config::Direct;
use crate::layout::{
    ASKS_EVERY, DIELECTRIC, DIRECT_CROSSINGS, DirectSum, ENDS_BEFORE, ENVIRONMENT_LIGHT, LightSource, NO_LIGHT,
    NO_OBJECT, SEASONED, Statistics, TRIANGLE_LIGHT, VisiblePoint,
};
use crate::random::{CameraTurn, PathKind, Random};

/// Adds the radiance that one of an iteration's paths of each pixel saw to the sum of each slot, and to that of the
/// iteration's sequence.
pub fn direct<'a>(
    inputs: &Inputs<'_>,
    turn: CameraTurn,
    seen: impl Into<SeenSlice<'a>>,
    statistics: &[Statistics],
    counts: &Counts,
    direct_sums: &mut [DirectSum],
    sums: &mut [[f32; 4]],
) {
    let seen = seen.into();
    // The photons that may have brought light behind glass.
    let of_last_map = &statistics[statistics.len() - seen.points.len()..];
    let slots = direct_sums
        .par_iter_mut()
        .zip(sums)
        .zip(seen.points)
        .zip(of_last_map)
        .enumerate();
    slots.for_each(|(slot, (((sum, of_sequence), point), statistics))| {
        let mut radiance = xyz(point.emitted_normal);
        let mut unbent = 0.0;
        let mut asks = false;
        if inputs.config.direct == Direct::Light && word(point.position_object) != NO_OBJECT {
            let mut random = Random::of_pixel(inputs.config, PathKind::LightSample, slot as u32, turn);
            asks = inputs.scene.features.dielectric
                && turn.path == 0
                && inputs.config.asks_behind_glass(turn.iteration)
                && (turn.iteration.is_multiple_of(ASKS_EVERY) || photons_of(statistics) < SEASONED);
            // Each of few sources, or whichever light is chosen.
            let few = inputs.scene.features.few_sources;
            let sources = inputs.scene.light_sources.iter().filter(|_| few).map(Some);
            for source in sources.chain((!few).then_some(None)) {
                let sample = random.next4();
                let digits = if inputs.scene.lights.len() > 1 {
                    random.next4()
                } else {
                    [0.0; 4]
                };
                let gloss = seen.reflector(slot);
                let (sampled, behind_glass) =
                    sample_direct(inputs, point, gloss, source, [sample, digits], asks, &random);
                if behind_glass {
                    let mean = sampled.element_sum() / 3.0;
                    unbent += if mean.is_finite() { mean } else { 0.0 };
                } else {
                    radiance += sampled;
                }
            }
        }
        radiance /= f64::from(turn.paths);
        // As a device has it.
        if radiance.as_vec3().is_finite() {
            let (unbent_before, asked_before) = (sum.high[3], sum.low[3]);
            (sum.high, sum.low) = to_two_floats(from_two_floats(sum.high, sum.low) + radiance.extend(0.0));
            sum.high[3] = unbent_before + unbent as f32;
            sum.low[3] = asked_before + f32::from(asks);
            for (of_sequence, channel) in of_sequence.iter_mut().zip(radiance.to_array()) {
                *of_sequence += channel as f32;
            }
        } else {
            counts.add_non_finite(1);
        }
    });
}

/// What a ray meets beyond glass.
struct Beyond {
    hit: Option<Hit>,
    /// The glass's colours, where there is any.
    tint: Option<DVec3>,
}

impl Beyond {
    /// What light from there adds, and whether glass stands before it.
    fn of(&self, light: DVec3) -> (DVec3, bool) {
        (light * self.tint.unwrap_or(DVec3::ONE), self.tint.is_some())
    }
}

/// Follows a ray through glass as if that didn't bend it; where `lights_end_it`, to the first surface of a light. Unless it `asks`,
/// it ends on glass.
fn look(
    inputs: &Inputs<'_>,
    ray: Ray,
    end: f64,
    ignored: Option<PlacedTriangle>,
    asks: bool,
    lights_end_it: bool,
    random: &Random,
) -> Beyond {
    let (mut from, mut tint, mut crossings) = (ray, None, 0);
    loop {
        let passed = (from.origin - ray.origin).dot(ray.direction) / ray.direction.length_squared();
        let hit = nearest_visible(inputs, from, end - passed, ignored, random);
        let met = hit.map(|hit| surface_of(inputs.scene, hit)).filter(|met| {
            asks && crossings < DIRECT_CROSSINGS
                && met.material.surface == DIELECTRIC
                && !(lights_end_it && met.light != NO_LIGHT)
        });
        let Some(met) = met else {
            return Beyond { hit, tint };
        };
        tint = Some(tint.unwrap_or(DVec3::ONE) * rgb(met.material.base_color));
        from.origin = met.origin_towards(ray.direction);
        crossings += 1;
    }
}

/// Whether a light is so near that the squared distance to its points varies much. In f32, as on a device: it decides.
fn is_near_light(inputs: &Inputs<'_>, position: DVec3) -> bool {
    let position = position.as_vec3();
    let is_within = |&[x, y, z, radius2]: &[f32; 4]| position.distance_squared(Vec3::new(x, y, z)) <= radius2;
    inputs.scene.near_lights.iter().any(is_within)
}

/// weight · BRDF · L · cos θ_surface over the density per solid angle of both ways to choose the ray: towards a light
/// chosen in proportion to its flux, or along a direction of the BSDF, which never meets a light without extent. And whether
/// glass stands before the light, so that this is what it would bring unbent.
fn sample_direct(
    inputs: &Inputs<'_>,
    point: &VisiblePoint,
    gloss: Option<(Reflector, DVec3)>,
    source: Option<&LightSource>,
    [[choice, u, v, way], [first_digits, _, second_digits, _]]: [[f64; 4]; 2],
    asks: bool,
    random: &Random,
) -> (DVec3, bool) {
    let nothing = (DVec3::ZERO, false);
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
        Some((reflector, viewer)) if !inputs.scene.near_lights.is_empty() => {
            (0.5, reflector.reflection_probability(shading_normal.dot(viewer)))
        }
        _ if is_near_light(inputs, position) => (f64::from(inputs.settings.bsdf_sampling), 0.0),
        _ => (0.0, 0.0),
    };
    // No direction of the BSDF meets a punctual light.
    let meets = source.is_none_or(|source| [TRIANGLE_LIGHT, ENVIRONMENT_LIGHT].contains(&source.kind));
    let q = if meets { q } else { 0.0 };
    let leaves = |ray: DVec3| ray.dot(geometric_normal) > 0.0 && ray.dot(shading_normal) > 0.0;
    // Where nothing but glass stands in the way, that.
    let look_for = |direction: DVec3, end: f64, ignored: Option<PlacedTriangle>| {
        let seen = || look(inputs, Ray { origin, direction }, end, ignored, asks, false, random);
        leaves(direction).then(seen).filter(|seen| seen.hit.is_none())
    };
    // What a unit of irradiance across a direction adds.
    let response = |direction: DVec3| {
        let brdf = gloss.map_or(DVec3::ONE, |(reflector, viewer)| {
            reflector.brdf(shading_normal, viewer, direction)
        });
        xyz(point.weight_normal) * brdf * direction.dot(shading_normal)
    };
    let response_to = |Sky { radiance, density }: Sky, direction: DVec3| {
        let mut of_bsdf = (1.0 - reflections) * direction.dot(shading_normal) / PI;
        if let Some((reflector, viewer)) = wide {
            of_bsdf += reflections * reflector.reflected_density(shading_normal, viewer, direction);
        }
        response(direction) * radiance / ((1.0 - q) * density + q * of_bsdf)
    };
    // 0 of one that isn't of the source that is asked.
    let probability_of = |light: u32| match source {
        Some(source) => light_sources::probability_of(inputs, source, light),
        None if inputs.scene.features.many_sources => probability_for(inputs, position, shading_normal, light),
        None => inputs.scene.lights[light as usize].probability.into(),
    };
    let sky = |sky: Sky, direction: DVec3| {
        // The environment is the last light.
        let last = inputs.scene.lights.len().checked_sub(1);
        let probability = last.map_or(0.0, |light| probability_of(light as u32));
        if source.is_some() && probability == 0.0 {
            return DVec3::ZERO;
        }
        let density = sky.density * probability;
        response_to(Sky { density, ..sky }, direction)
    };
    // What is between them is what the light is in.
    let between = |light: usize, way: f64| transmittance(inputs, Media::of(inputs.scene.media_of_lights[light]), way);
    let environment = Environment::of(&inputs.scene.environment);

    let by_bsdf = way < q;
    let (mut emitter, asked_light, seen_light) = if by_bsdf {
        let direction = match wide {
            Some((reflector, viewer)) if choice < reflections => {
                reflector.reflected_direction(shading_normal, viewer, [u, v])
            }
            _ => cosine_direction(shading_normal, u, v),
        };
        if !leaves(direction) {
            return nothing;
        }
        let seen = look(inputs, Ray { origin, direction }, FAR, None, asks, true, random);
        let Some(hit) = seen.hit else {
            return seen.of(sky(environment.at(direction), direction));
        };
        let met = Interface::new(inputs, hit, direction, Media::VACUUM, false, random);
        (met.surface, None, seen)
    } else {
        let (index, probability) = match source {
            Some(source) => choose_light_of(inputs, source, first_digits),
            None if inputs.scene.features.many_sources => {
                choose_light_for(inputs, position, shading_normal, [choice, first_digits])
            }
            None => {
                let index = choose_light(&inputs.scene.lights, choice, [first_digits, second_digits]).index;
                (index, inputs.scene.lights[index].probability.into())
            }
        };
        let light = &inputs.scene.lights[index];
        if is_punctual(light) {
            let Arriving { ray, end, irradiance } = arriving_from(light, origin, DVec2::new(u, v));
            let irradiance = irradiance * between(index, ray.length());
            return look_for(ray, end, None).map_or(nothing, |seen| {
                seen.of(response(ray.normalize()) * irradiance / (probability * (1.0 - q)))
            });
        }
        if light.kind == ENVIRONMENT_LIGHT {
            let (direction, sampled) = environment.sample(u, v);
            return look_for(direction, FAR, None).map_or(nothing, |seen| seen.of(sky(sampled, direction)));
        }
        let (u, v) = point_of_light(light, DVec2::new(u, v));
        let emitter = surface_at(inputs.scene, PlacedTriangle::unplaced(light.triangle), u, v);
        let direction = emitter.origin_towards(position - emitter.position) - origin;
        let ignored = Some(PlacedTriangle::unplaced(light.triangle));
        let Some(seen) = look_for(direction, 1.0 - ENDS_BEFORE, ignored) else {
            return nothing;
        };
        (emitter, Some(index as u32), seen)
    };
    if emitter.light == NO_LIGHT {
        return nothing;
    }
    apply_textures(inputs.scene, &mut emitter);
    // A ray that met the light had its chance to pass it.
    let there = if by_bsdf {
        1.0
    } else {
        share_there(inputs.scene, &emitter)
    };
    let index = asked_light.unwrap_or_else(|| light_at_place(&inputs.scene.lights, &emitter));
    let light = &inputs.scene.lights[index as usize];
    let to_light = emitter.position - position;
    let direction = to_light.normalize_or_zero();
    let cos_light = -direction.dot(emitter.geometric_normal);
    if !emits(&emitter.material, cos_light > 0.0) || direction.dot(shading_normal) <= 0.0 || cos_light == 0.0 {
        return nothing;
    }
    let radiance =
        there * emitted_radiance(&emitter.material, cos_light.abs()) * between(index as usize, to_light.length());
    let probability = probability_of(index);
    if source.is_some() && probability == 0.0 {
        return nothing;
    }
    let density = probability * to_light.length_squared() / (f64::from(light.area) * cos_light.abs());
    seen_light.of(response_to(Sky { radiance, density }, direction))
}
