//! Direct light at a visible point, by points of lights and by directions of the BSDF together (multiple importance sampling by
//! the balance heuristic: Veach, 1997, section 9.2). Where glass alone stands between, photons have to bring that light: what it
//! would be unbent is kept apart.

use glam::{DVec2, DVec3};

use super::bsdf::{Bsdf, Width};
use super::camera::VisiblePoint;
use super::environment::Environment;
use super::interaction::Interaction;
use super::intersect::{Hit, PlacedTriangle, Ray};
use super::lights::{met_emitter, punctual, sample_incident};
use super::media::{Media, transmittance};
use super::surface::surface_of;
use super::texture::nearest_visible;
use super::vector::{mean, rgb};
use super::{FAR, Inputs};
use crate::emission::light_of;
use crate::layout::{
    DELTA_LIGHT_NUMBERS, DIELECTRIC, DIRECT_CROSSINGS, DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, LightSource, NO_LIGHT,
    TRIANGLE_LIGHT,
};
use crate::random::Random;

/// What lights bring.
#[derive(Debug, Clone, Copy, Default)]
pub struct DirectLight {
    /// Radiance in the pixel.
    pub radiance: DVec3,
    /// Of what stands behind glass, mean of the channels, if glass didn't bend it.
    pub unbent: f64,
}

impl DirectLight {
    /// `tint`: of glass on the way.
    fn add(&mut self, radiance: DVec3, tint: Option<DVec3>) {
        match tint {
            None => self.radiance += radiance,
            Some(tint) => self.unbent += mean(radiance * tint),
        }
    }
}

/// Samples each source of light once, and the BSDF once for all. Unless it `asks`, what glass stands before counts as dark.
pub fn direct_light(inputs: &Inputs<'_>, point: &VisiblePoint, asks: bool, random: &mut Random) -> DirectLight {
    let VisiblePoint {
        surface, bsdf, viewer, ..
    } = point;
    let (viewer, normals) = (*viewer, bsdf.normals());
    let leaves = |ray: DVec3| ray.dot(normals.geometric) > 0.0;
    let origin = |_: DVec3| surface.origin_towards(normals.geometric);
    let response = |direction: DVec3| point.throughput * bsdf.evaluate(Width::Wide, viewer, direction);
    let mut light = DirectLight::default();

    for source in &inputs.scene.light_sources {
        let [x, y, number, _] = random.next4();
        let range = source.first_light..source.first_light + source.light_count;
        let (index, probability) = light_of(&inputs.scene.lights, range, number);
        let Some(sample) = sample_incident(inputs, index as u32, surface.position, origin, DVec2::new(x, y)) else {
            continue;
        };
        let density = sample.density.map_or(probability, |density| {
            density * probability + bsdf.density(Width::Wide, viewer, sample.towards)
        });
        let brings = response(sample.towards) * sample.radiance / density;
        if leaves(sample.ray.direction) && brings.max_element() > 0.0 {
            let seen = look(inputs, sample.ray, sample.end, sample.ignored, asks, false, random);
            if seen.hit.is_none() {
                light.add(brings, seen.tint);
            }
        }
    }

    let is_met = |source: &LightSource| [TRIANGLE_LIGHT, ENVIRONMENT_LIGHT].contains(&source.kind);
    if !inputs.scene.light_sources.iter().any(is_met) {
        return light;
    }
    let [u, v, choice, _] = random.next4();
    let Some(direction) = bsdf
        .sample_wide(viewer, [u, v], choice)
        .filter(|direction| leaves(*direction))
    else {
        return light;
    };
    let ray = Ray {
        origin: origin(direction),
        direction,
    };
    let seen = look(inputs, ray, FAR, None, asks, true, random);
    let of_bsdf = bsdf.density(Width::Wide, viewer, direction);
    let brings = |radiance: DVec3, of_light: f64| response(direction) * radiance / (of_light + of_bsdf);
    let Some(hit) = seen.hit else {
        // The environment is the last light, if it is one.
        let sky = Environment::of(&inputs.scene.environment).at(direction);
        if inputs.scene.features.environment {
            light.add(brings(sky.radiance, sky.density), seen.tint);
        }
        return light;
    };
    let emitter = Interaction::new(inputs, hit, direction, Media::VACUUM, false, random).surface;
    if emitter.light != NO_LIGHT
        && let Some((radiance, density)) = met_emitter(inputs, &emitter, surface.position)
    {
        light.add(brings(radiance, density), seen.tint);
    }
    light
}

/// What narrow lobes show of lights without surface, which no direction of theirs meets.
pub fn narrow_reflection_of_lights(
    inputs: &Inputs<'_>,
    met: &Interaction,
    bsdf: &Bsdf,
    viewer: DVec3,
    random: &Random,
) -> DVec3 {
    let place = DVec2::from([0, 1].map(|number| random.number_of([number, DELTA_LIGHT_NUMBERS])));
    let mut sum = DVec3::ZERO;
    for light in inputs.scene.lights.iter().filter(|light| light.is_punctual()) {
        let origin = met
            .surface
            .origin_towards(punctual(light, met.surface.position, place).0);
        let (direction, end, irradiance) = punctual(light, origin, place);
        let towards = direction.normalize();
        let above = towards.dot(met.normals.geometric) > 0.0;
        let medium = if above { met.through } else { met.beyond };
        let way = if light.kind == DIRECTIONAL_LIGHT {
            FAR
        } else {
            direction.length()
        };
        let brings = bsdf.evaluate(Width::Narrow, viewer, towards) * irradiance * transmittance(inputs, medium, way);
        let ray = Ray { origin, direction };
        if brings.max_element() > 0.0 && nearest_visible(inputs, ray, end, None, random).is_none() {
            sum += brings;
        }
    }
    sum
}

/// What a ray meets, beyond glass that it has asked through.
struct Seen {
    hit: Option<Hit>,
    /// The glass's colours, where there is any.
    tint: Option<DVec3>,
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
) -> Seen {
    let (mut from, mut tint, mut crossings) = (ray, None, 0);
    loop {
        let passed = (from.origin - ray.origin).dot(ray.direction) / ray.direction.length_squared();
        let hit = nearest_visible(inputs, from, end - passed, ignored, random);
        let met = hit.map(|hit| surface_of(inputs.scene, hit)).filter(|met| {
            let is_light = lights_end_it && met.light != NO_LIGHT;
            asks && crossings < DIRECT_CROSSINGS && met.material.surface == DIELECTRIC && !is_light
        });
        let Some(met) = met else {
            return Seen { hit, tint };
        };
        tint = Some(tint.unwrap_or(DVec3::ONE) * rgb(met.material.base_color));
        from.origin = met.origin_towards(ray.direction);
        crossings += 1;
    }
}
