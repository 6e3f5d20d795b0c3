//! Direct lighting at a visible point: light samples and BSDF samples, combined by multiple importance sampling with the balance
//! heuristic (Veach, 1997, section 9.2). Light that arrives through glass is left to photons. Its unrefracted estimate is
//! returned separately.

use glam::{DVec2, DVec3};

use super::bsdf::{Bsdf, Width};
use super::camera::VisiblePoint;
use super::environment::Environment;
use super::interaction::Interaction;
use super::intersect::{Hit, PlacedTriangle, Ray};
use super::lights::{hit_emitter, punctual, sample_incident};
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

/// Direct light at a visible point.
#[derive(Debug, Clone, Copy, Default)]
pub struct DirectLight {
    /// Radiance in the pixel.
    pub radiance: DVec3,
    /// Radiance (mean of the channels) of lights behind glass, if the glass did not refract.
    pub unbent: f64,
}

impl DirectLight {
    /// `tint`: of the glass that the ray passed, if any.
    fn add(&mut self, radiance: DVec3, tint: Option<DVec3>) {
        match tint {
            None => self.radiance += radiance,
            Some(tint) => self.unbent += mean(radiance * tint),
        }
    }
}

/// Takes one light sample from each light source, and one BSDF sample. Without `through_glass`, lights behind glass are not
/// counted.
pub fn direct_light(
    inputs: &Inputs<'_>,
    point: &VisiblePoint,
    through_glass: bool,
    random: &mut Random,
) -> DirectLight {
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
        let contribution = response(sample.towards) * sample.radiance / density;
        if leaves(sample.ray.direction) && contribution.max_element() > 0.0 {
            let traced = trace_through_glass(
                inputs,
                sample.ray,
                sample.end,
                sample.ignored,
                through_glass,
                false,
                random,
            );
            if traced.hit.is_none() {
                light.add(contribution, traced.tint);
            }
        }
    }

    let can_be_hit = |source: &LightSource| [TRIANGLE_LIGHT, ENVIRONMENT_LIGHT].contains(&source.kind);
    if !inputs.scene.light_sources.iter().any(can_be_hit) {
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
    let traced = trace_through_glass(inputs, ray, FAR, None, through_glass, true, random);
    let bsdf_density = bsdf.density(Width::Wide, viewer, direction);
    let contribution =
        |radiance: DVec3, light_density: f64| response(direction) * radiance / (light_density + bsdf_density);
    let Some(hit) = traced.hit else {
        // The environment, if there is one, is the last light.
        let environment = Environment::of(&inputs.scene.environment).at(direction);
        if inputs.scene.features.environment {
            light.add(contribution(environment.radiance, environment.density), traced.tint);
        }
        return light;
    };
    let emitter = Interaction::new(inputs, hit, direction, Media::VACUUM, false, random).surface;
    if emitter.light != NO_LIGHT
        && let Some((radiance, density)) = hit_emitter(inputs, &emitter, surface.position)
    {
        light.add(contribution(radiance, density), traced.tint);
    }
    light
}

/// Reflection of delta lights by narrow lobes, which BSDF samples never hit.
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
        let distance = if light.kind == DIRECTIONAL_LIGHT {
            FAR
        } else {
            direction.length()
        };
        let contribution =
            bsdf.evaluate(Width::Narrow, viewer, towards) * irradiance * transmittance(inputs, medium, distance);
        let ray = Ray { origin, direction };
        if contribution.max_element() > 0.0 && nearest_visible(inputs, ray, end, None, random).is_none() {
            sum += contribution;
        }
    }
    sum
}

/// Result of [`trace_through_glass`].
struct ThroughGlass {
    hit: Option<Hit>,
    /// Product of the glass's colours, if the ray passed any.
    tint: Option<DVec3>,
}

/// Traces a ray through glass without refraction. With `stops_at_lights` it stops at the first emissive surface. Without
/// `through_glass` it stops at glass.
fn trace_through_glass(
    inputs: &Inputs<'_>,
    ray: Ray,
    end: f64,
    ignored: Option<PlacedTriangle>,
    through_glass: bool,
    stops_at_lights: bool,
    random: &Random,
) -> ThroughGlass {
    let (mut from, mut tint, mut crossings) = (ray, None, 0);
    loop {
        let passed = (from.origin - ray.origin).dot(ray.direction) / ray.direction.length_squared();
        let hit = nearest_visible(inputs, from, end - passed, ignored, random);
        let met = hit.map(|hit| surface_of(inputs.scene, hit)).filter(|met| {
            let is_light = stops_at_lights && met.light != NO_LIGHT;
            through_glass && crossings < DIRECT_CROSSINGS && met.material.surface == DIELECTRIC && !is_light
        });
        let Some(met) = met else {
            return ThroughGlass { hit, tint };
        };
        tint = Some(tint.unwrap_or(DVec3::ONE) * rgb(met.material.base_color));
        from.origin = met.origin_towards(ray.direction);
        crossings += 1;
    }
}
