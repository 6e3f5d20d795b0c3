//! Where photon paths start: `glsl/shared/emission.glsl` in f64.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::Inputs;
use super::environment::Environment;
use super::intersect::{PlacedTriangle, Ray};
use super::light::{Choice, choose_light, emits, emitted_radiance};
use super::random::Random;
use super::sampling::{basis, cosine_direction, disc_point, triangle_point};
use super::surface::{offset_origin, surface_at};
use super::texture::{apply_textures, share_there};
use super::vector::rgb;
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, POINT_LIGHT, SPOT_LIGHT};

/// The start of a photon path.
pub(super) struct Emission {
    pub ray: Ray,
    pub flux: DVec3,
    /// The triangle that it leaves.
    pub ignored: Option<PlacedTriangle>,
    /// Of a punctual light; 0 for one that reaches any distance.
    pub inverse_range: f64,
}

/// Starts a path on a light.
pub(super) fn emit(inputs: &Inputs<'_>, random: &mut Random) -> Emission {
    let [choice, second, direction_u, direction_v] = random.next4();
    let [digits, side, more_digits, _] = random.next4();
    let Choice { light, rest } = choose_light(&inputs.scene.lights, choice, [digits, more_digits]);
    let (place, direction) = (DVec2::new(rest, second), DVec2::new(direction_u, direction_v));
    let (ray, flux, ignored) = match light.kind {
        POINT_LIGHT => {
            let ray = Ray {
                origin: rgb(light.position),
                direction: direction_off(DVec3::Z, 2.0 * direction.x, direction.y),
            };
            (ray, rgb(light.intensity) * 4.0 * PI, None)
        }
        SPOT_LIGHT => {
            let (versine, solid_angle) = spot_versine(light, direction.x);
            let ray = Ray {
                origin: rgb(light.position),
                direction: direction_off(rgb(light.direction), versine, direction.y),
            };
            (ray, rgb(light.intensity) * solid_angle, None)
        }
        DIRECTIONAL_LIGHT => {
            let ray = from_afar(rgb(light.position), rgb(light.direction), light, place);
            (ray, rgb(light.intensity) * f64::from(light.area), None)
        }
        ENVIRONMENT_LIGHT => {
            let environment = Environment::of(&inputs.scene.environment);
            let (towards, sky) = environment.sample(direction.x, direction.y);
            let radius = (f64::from(light.area) / PI).sqrt();
            let ray = from_afar(towards * radius, -towards, light, place);
            (ray, sky.radiance * f64::from(light.area) / sky.density, None)
        }
        _ => from_triangle(inputs, light, place, direction, side),
    };
    Emission {
        ray,
        flux: flux / f64::from(light.probability),
        ignored,
        inverse_range: light.inverse_range.into(),
    }
}

/// From a point of a triangle, on its front or, if both sides shine, by `side` on either of them.
fn from_triangle(
    inputs: &Inputs<'_>,
    light: &Light,
    place: DVec2,
    direction: DVec2,
    side: f64,
) -> (Ray, DVec3, Option<PlacedTriangle>) {
    let (u, v) = triangle_point(place.x, place.y);
    let mut emitter = surface_at(inputs.scene, PlacedTriangle::unplaced(light.triangle), u, v);
    apply_textures(inputs.scene, &mut emitter);
    let both_sides = emits(&emitter.material, false);
    let normal = if both_sides && side < 0.5 {
        -emitter.geometric_normal
    } else {
        emitter.geometric_normal
    };
    let sides = if both_sides { 2.0 } else { 1.0 };
    let ray = Ray {
        origin: offset_origin(emitter.position, normal, emitter.reach),
        direction: cosine_direction(normal, direction.x, direction.y),
    };
    let radiance = emitted_radiance(&emitter.material, ray.direction.dot(normal));
    let flux = radiance * (PI * sides * f64::from(light.area) * share_there(inputs.scene, &emitter));
    (ray, flux, Some(PlacedTriangle::unplaced(light.triangle)))
}

/// From a disc across the direction of flight that covers the scene.
fn from_afar(centre: DVec3, direction: DVec3, light: &Light, place: DVec2) -> Ray {
    let radius = (f64::from(light.area) / PI).sqrt();
    Ray {
        origin: centre + basis(direction) * (radius * disc_point(place.x, place.y)).extend(0.0),
        direction,
    }
}

/// A direction around an axis, with 1 − cos of the angle between them.
fn direction_off(axis: DVec3, versine: f64, turn: f64) -> DVec3 {
    let (sin, cos) = (2.0 * PI * turn).sin_cos();
    let across = (versine * (2.0 - versine)).max(0.0).sqrt();
    (basis(axis) * DVec3::new(across * cos, across * sin, 1.0 - versine)).normalize()
}

/// 1 − cos of a photon's angle from a spot's axis, such that all photons have the same flux, and the solid angle that would
/// have the whole intensity.
fn spot_versine(light: &Light, u: f64) -> (f64, f64) {
    let (inner, outer) = (f64::from(light.inner), f64::from(light.outer));
    // The integral of the squared ramp is a third of its width.
    let ramp = outer - inner;
    let whole = inner + ramp / 3.0;
    let from_outside = u * whole;
    let versine = if from_outside < ramp / 3.0 {
        outer - (3.0 * from_outside * ramp * ramp).cbrt()
    } else {
        whole - from_outside
    };
    (versine, 2.0 * PI * whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::light::spot_falloff;
    use bytemuck::Zeroable;

    /// The part of a spot's photons within an angle is the part of its intensity's integral there.
    #[test]
    fn photons_of_a_spot_are_spread_as_its_intensity() {
        let light = Light {
            inner: 0.1,
            outer: 0.4,
            ..Light::zeroed()
        };
        const STEPS: u32 = 100_000;
        let mut integral = 0.0;
        let step = 0.4 / f64::from(STEPS);
        let (_, solid_angle) = spot_versine(&light, 0.0);
        for i in 0..STEPS {
            let versine = (f64::from(i) + 0.5) * step;
            integral += spot_falloff(&light, versine) * step;
            if i % 10_000 == 9_999 {
                let within = 2.0 * PI * integral / solid_angle;
                let (found, _) = spot_versine(&light, (1.0 - within).max(0.0));
                let expected = f64::from(i + 1) * step;
                assert!(
                    spot_falloff(&light, expected) < 1e-6 || (found - expected).abs() < 1e-4,
                    "{found} instead of {expected}"
                );
            }
        }
        assert!((2.0 * PI * integral / solid_angle - 1.0).abs() < 1e-6, "{integral}");
    }
}
