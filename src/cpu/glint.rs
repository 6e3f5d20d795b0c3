//! What narrow lobes show of lights that are no surfaces, which no direction of theirs meets, and what a ray sees of those that
//! have an extent: `glsl/shared/glint.glsl` in f64.

use glam::{DVec2, DVec3};

use super::boundary::{Boundary, fresnel_dielectric};
use super::contact::Encounter;
use super::gloss::Reflector;
use super::intersect::Ray;
use super::light::{Arriving, arriving_from, choose_light, is_punctual, soft_light_along};
use super::media::{Media, transmittance};
use super::surface::Facing;
use super::texture::nearest_visible;
use super::{FAR, Inputs};
use crate::layout::{DIELECTRIC, DIRECTIONAL_LIGHT, GLINT, Light, Material};
use crate::random::Random;

/// By a ray to one of the lights or, where visible points are found once, to each. `reflector`: of what isn't glass.
pub(super) fn glint(
    inputs: &Inputs<'_>,
    met: &Encounter,
    material: &Material,
    facing: &Facing,
    reflector: &Reflector,
    incoming: DVec3,
    random: &Random,
) -> DVec3 {
    // Apart from the path's own numbers: those are the same where there is nothing to ask.
    let [u, first_digits, second_digits, x, y] = [0, 1, 2, 3, 4].map(|number| random.number_of([number, GLINT]));
    let place = DVec2::new(x, y);
    let lights = &inputs.scene.lights;
    let chosen = choose_light(lights, u, [first_digits, second_digits]).index;
    let of_one = inputs.settings.slots_per_pixel == 1;
    let asked = if of_one { &lights[chosen..=chosen] } else { lights };
    let boundary = Reflector {
        diffuse: DVec3::ZERO,
        ..*reflector
    };
    let from = |light: &Light| {
        let origin = met
            .surface
            .origin_towards(arriving_from(light, met.surface.position, place).ray);
        let Arriving { ray, end, irradiance } = arriving_from(light, origin, place);
        let direction = ray.normalize();
        let cosine = direction.dot(facing.shading_normal);
        let same_side = direction.dot(facing.geometric_normal) > 0.0;
        let response = if material.surface == DIELECTRIC {
            glass_response(facing, incoming, direction, material, met.outside)
                * if same_side { DVec3::ONE } else { met.tint }
        } else if same_side && cosine > 0.0 {
            boundary.brdf(facing.shading_normal, -incoming, direction) * cosine
        } else {
            DVec3::ZERO
        };
        let probability = if of_one { f64::from(light.probability) } else { 1.0 };
        let medium = if same_side { met.through } else { met.beyond };
        let is_far = light.kind == DIRECTIONAL_LIGHT;
        let way = if is_far { FAR } else { ray.length() };
        let response = response * irradiance * transmittance(inputs, medium, way) / probability;
        let ray = Ray { origin, direction: ray };
        if response.max_element() <= 0.0 || nearest_visible(inputs, ray, end, None, random).is_some() {
            return DVec3::ZERO;
        }
        response
    };
    asked.iter().filter(|light| is_punctual(light)).map(from).sum()
}

/// Radiance of lights with an extent that a ray along a unit vector meets within `end`.
pub(super) fn soft_lights_along(inputs: &Inputs<'_>, ray: Ray, end: f64, media: Media) -> DVec3 {
    if !inputs.scene.features.soft {
        return DVec3::ZERO;
    }
    let met = |light: &Light| {
        let (radiance, way) = soft_light_along(light, ray.origin, ray.direction)?;
        (way < end || end >= FAR).then(|| radiance * transmittance(inputs, media, way))
    };
    inputs.scene.lights.iter().filter_map(met).sum()
}

/// BSDF · cos of a rough boundary of glass without its tint, as [`Boundary::new`] draws it: Walter and others, «Microfacet Models for Refraction
/// through Rough Surfaces», EGSR 2007. `l`: to the light.
fn glass_response(facing: &Facing, incoming: DVec3, l: DVec3, material: &Material, outside: f64) -> DVec3 {
    let (n, v) = (facing.shading_normal, -incoming);
    let microfacets = Reflector::microfacets_of(material);
    let ior = f64::from(material.ior) / outside;
    let thin = material.thin != 0;
    let eta = if facing.front || thin { 1.0 / ior } else { ior };
    let passes = l.dot(facing.geometric_normal) < 0.0;
    let bends = passes && !thin;
    let h = match (passes, thin) {
        (false, _) => v + l,
        (true, true) => v + l - 2.0 * l.dot(n) * n,
        (true, false) => eta * v + l,
    };
    let length2 = h.length_squared();
    let h = (if h.dot(n) < 0.0 { -h } else { h }) / length2.max(1e-12).sqrt();
    let (nv, nl, vh, lh) = (n.dot(v), n.dot(l), v.dot(h), l.dot(h));
    // Straight through without bending, any microfacet will do: that is no lobe.
    if nv <= 0.0 || vh <= 0.0 || (nl < 0.0) != passes || (bends && lh >= 0.0) || length2 < 1e-12 {
        return DVec3::ZERO;
    }
    let fresnel = fresnel_dielectric(vh, eta);
    let mut boundary = Boundary {
        reflectance: fresnel.map_or(1.0, |(reflectance, _)| reflectance),
        eta,
        reflected: l,
        refracted: fresnel.map(|_| l),
        reflected_weight: DVec3::ONE,
        refracted_weight: DVec3::ONE,
    };
    boundary.weigh(facing, incoming, material, ior, vh);
    // D · G1(v) / nv
    let visible = microfacets.ggx(n, h) * microfacets.masking(nv) / nv;
    if !passes {
        let masking = microfacets.joint_masking(nv, nl);
        return boundary.reflectance * boundary.reflected_weight * (0.25 * visible * masking);
    }
    // Density of l against that of h; radiance is compressed on its way into the denser medium.
    let through = if bends {
        vh * -lh * (eta / (eta * vh + lh)).powi(2)
    } else {
        0.25
    };
    let masking = microfacets.masking(-nl);
    boundary.refracted_weight * ((1.0 - boundary.reflectance) * visible * through * masking)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use bytemuck::Zeroable;

    use super::*;
    use crate::random::PathKind;

    fn glass(roughness: f32, thin: bool) -> Material {
        Material {
            surface: DIELECTRIC,
            ior: 1.5,
            roughness,
            thin: thin.into(),
            specular_f0: [0.04; 3],
            specular_f90: 1.0,
            ..Material::zeroed()
        }
    }

    /// What is reflected and what passes, by integration over all directions.
    fn integrated(facing: &Facing, incoming: DVec3, material: &Material) -> [f64; 2] {
        const STEPS: u32 = 800;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let mut sums = [0.0; 2];
        for i in 0..STEPS * STEPS {
            let (across, z) = (PI * at(i / STEPS)).sin_cos();
            let (sin, cos) = (2.0 * PI * at(i % STEPS)).sin_cos();
            let l = DVec3::new(across * cos, across * sin, z);
            sums[usize::from(z < 0.0)] += across * glass_response(facing, incoming, l, material, 1.0).x;
        }
        sums.map(|sum| sum * 2.0 * PI * PI / f64::from(STEPS * STEPS))
    }

    /// The same by the directions that paths take; and the standard errors.
    fn sampled(facing: &Facing, incoming: DVec3, material: &Material) -> [[f64; 2]; 2] {
        const SAMPLES: u32 = 100_000;
        let (mut sums, mut squares) = ([0.0; 2], [0.0; 2]);
        for index in 0..SAMPLES {
            let [u0, u1, ..] = Random::new(PathKind::Camera, index, 0, 0).next4();
            let boundary = Boundary::new(facing, incoming, material, 1.0, [u0, u1]);
            let passed = 1.0 - boundary.reflectance;
            let values = [
                boundary.reflectance * boundary.reflected_weight.x,
                passed * boundary.eta.powi(2) * boundary.refracted_weight.x,
            ];
            for (part, value) in values.into_iter().enumerate() {
                sums[part] += value;
                squares[part] += value * value;
            }
        }
        let n = f64::from(SAMPLES);
        std::array::from_fn(|part| {
            let mean = sums[part] / n;
            [mean, ((squares[part] / n - mean * mean).max(0.0) / n).sqrt()]
        })
    }

    /// A normal number exceeds 6 standard deviations with a probability of 2e-9; the rule of midpoints is right to 1e-3 where
    /// a lobe is cut by the horizon.
    #[test]
    fn rough_glass_scatters_what_its_samples_weigh() {
        for roughness in [0.5, 0.7, 1.0] {
            for (front, thin) in [(true, false), (false, false), (true, true)] {
                for cosine in [0.3_f64, 0.8, 1.0] {
                    let material = glass(roughness, thin);
                    let facing = Facing {
                        geometric_normal: DVec3::Z,
                        shading_normal: DVec3::Z,
                        front,
                    };
                    let incoming = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, -cosine);
                    let integrated = integrated(&facing, incoming, &material);
                    let sampled = sampled(&facing, incoming, &material);
                    for (part, (integral, [mean, error])) in integrated.into_iter().zip(sampled).enumerate() {
                        let what = format!("roughness {roughness}, front {front}, thin {thin}, cos {cosine}, {part}");
                        let slack = 1e-3 + 6.0 * error;
                        assert!((integral - mean).abs() < slack, "{what}: {integral}, {mean} ± {error}");
                    }
                }
            }
        }
    }
}
