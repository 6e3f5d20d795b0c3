//! Emission: samples of the light that leaves a light, the starts of photon paths.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::Inputs;
use super::environment::Environment;
use super::intersect::{PlacedTriangle, Ray};
use super::lights::{emits, emitted_radiance, point_on_triangle};
use super::sampling::{basis, cosine_direction, direction_in_cone, disc_point};
use super::surface::{offset_origin, surface_at};
use super::texture::{apply_textures, opacity};
use super::vector::rgb;
use crate::alias::{self, AliasCell};
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, SPOT_LIGHT, TRIANGLE_LIGHT};

/// Chooses a light by its power, by `u` in [0, 1) and two more numbers as its lower digits. Returns an index and a uniform
/// number.
pub fn choose_by_power(lights: &[Light], u: f64, digits: [f64; 2]) -> (u32, f64) {
    let choice = alias::choose(lights.len(), u, digits, |cell| AliasCell {
        accept: lights[cell].accept,
        alias: lights[cell].alias,
    });
    (choice.index as u32, choice.rest)
}

/// The start of a photon path.
#[derive(Debug, Clone, Copy)]
pub struct Emission {
    /// From the light.
    pub ray: Ray,
    /// Flux of the whole light, as if it emitted this photon alone.
    pub flux: DVec3,
    /// The emissive triangle.
    pub ignored: Option<PlacedTriangle>,
}

/// Samples a light's emission: a position by `u`, a direction by `v`, and for two-sided triangles a side by `side`.
pub fn sample_emission(inputs: &Inputs<'_>, light: u32, u: DVec2, v: DVec2, side: f64) -> Emission {
    let light = &inputs.scene.lights[light as usize];
    let (area, extent) = (f64::from(light.area), f64::from(light.extent));
    match light.kind {
        TRIANGLE_LIGHT => from_triangle(inputs, light, u, v, side),
        ENVIRONMENT_LIGHT => {
            let (towards, sample) = Environment::of(&inputs.scene.environment).sample(v.x, v.y);
            distant_emission(towards, area, sample.radiance / sample.density, u)
        }
        DIRECTIONAL_LIGHT if extent > 0.0 => {
            let towards = direction_in_cone(-rgb(light.direction), extent, v);
            distant_emission(towards, area, rgb(light.intensity), u)
        }
        DIRECTIONAL_LIGHT => {
            let direction = rgb(light.direction);
            let origin = rgb(light.position) + on_disc(direction, (area / PI).sqrt(), u);
            emission(origin, direction, rgb(light.intensity) * area)
        }
        _ => {
            let (direction, solid_angle) = if light.kind == SPOT_LIGHT {
                let (versine, solid_angle) = spot_versine(light, v.x);
                (direction_around(rgb(light.direction), versine, v.y), solid_angle)
            } else {
                (direction_around(DVec3::Z, 2.0 * v.x, v.y), 4.0 * PI)
            };
            let origin = rgb(light.position) + on_disc(direction, extent, u);
            emission(origin, direction, rgb(light.intensity) * solid_angle)
        }
    }
}

fn emission(origin: DVec3, direction: DVec3, flux: DVec3) -> Emission {
    Emission {
        ray: Ray { origin, direction },
        flux,
        ignored: None,
    }
}

/// Emission of a distant light, through a disc across the rays as large as the scene.
fn distant_emission(towards: DVec3, area: f64, irradiance: DVec3, u: DVec2) -> Emission {
    let radius = (area / PI).sqrt();
    emission(
        towards * radius + on_disc(-towards, radius, u),
        -towards,
        irradiance * area,
    )
}

/// A point on a disc around the origin.
fn on_disc(direction: DVec3, radius: f64, u: DVec2) -> DVec3 {
    basis(direction) * (radius * disc_point(u.x, u.y)).extend(0.0)
}

fn from_triangle(inputs: &Inputs<'_>, light: &Light, u: DVec2, v: DVec2, side: f64) -> Emission {
    let (x, y) = point_on_triangle(light, u).into();
    let triangle = PlacedTriangle::unplaced(light.triangle);
    let mut emitter = surface_at(inputs.scene, triangle, x, y);
    apply_textures(inputs.scene, &mut emitter);
    let both_sides = emits(&emitter.material, false);
    let front = !both_sides || side >= 0.5;
    let normal = if front {
        emitter.geometric_normal
    } else {
        -emitter.geometric_normal
    };
    let sides = if both_sides { 2.0 } else { 1.0 };
    let direction = cosine_direction(normal, v.x, v.y);
    let radiance = emitted_radiance(&emitter.material, direction.dot(normal).max(0.0));
    Emission {
        ray: Ray {
            origin: offset_origin(emitter.position, normal, emitter.reach),
            direction,
        },
        flux: radiance * (PI * sides * f64::from(light.area) * opacity(inputs.scene, &emitter)),
        ignored: Some(triangle),
    }
}

/// A direction at an angle to an axis; `versine`: 1 − cos of the angle.
fn direction_around(axis: DVec3, versine: f64, turn: f64) -> DVec3 {
    let (sin, cos) = (2.0 * PI * turn).sin_cos();
    let across = (versine * (2.0 - versine)).max(0.0).sqrt();
    (basis(axis) * DVec3::new(across * cos, across * sin, 1.0 - versine)).normalize()
}

/// Samples 1 − cos of the angle to a spot's axis so that all photons have the same flux. Also returns the solid angle of an
/// equivalent spot with full intensity.
fn spot_versine(light: &Light, u: f64) -> (f64, f64) {
    let (inner, outer, smooth) = (f64::from(light.inner), f64::from(light.outer), f64::from(light.area));
    let ramp = outer - inner;
    let whole = light.full_versine();
    let from_outside = u * whole;
    let versine = if from_outside < whole - inner {
        // The place t within the ramp up to which the falloff t²·(1 + smooth·(2 − 2t)) has this integral, by Newton's method.
        let integral = from_outside / ramp;
        let third = (1.0 + 2.0 * smooth) / 3.0;
        let mut t = (integral / third).cbrt();
        for _ in 0..4 {
            let error = t * t * t * (third - 0.5 * smooth * t) - integral;
            t -= error / (t * t * (3.0 * third - 2.0 * smooth * t)).max(1e-30);
        }
        outer - ramp * t
    } else {
        whole - from_outside
    };
    (versine, 2.0 * PI * whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::lights::spot_falloff;
    use crate::packing::set_alias_table;
    use crate::random::{PathKind, Random};
    use bytemuck::Zeroable;

    /// A light with probability 10⁻¹² is chosen that often: numbers around its cell are enumerated, all others cannot choose it.
    #[test]
    fn faint_lights_are_chosen_as_often_as_they_should_be() {
        let probabilities = [1e-12, 0.3, 0.7 - 1e-8 - 1e-12, 1e-8];
        let mut lights: Vec<Light> = (0..)
            .zip(probabilities)
            .map(|(triangle, _)| Light {
                triangle,
                ..Light::zeroed()
            })
            .collect();
        set_alias_table(&mut lights, &probabilities);
        let steps = f64::from(1 << 24);
        let share = |wanted: u32| -> f64 {
            let cell = &lights[wanted as usize];
            assert!(cell.accept > 0.0 && lights.iter().all(|light| light.accept == 1.0 || light.alias != wanted));
            // Numbers from the start of the cell: as many digit steps as it is accepted for, and as many again.
            let begin = f64::from(wanted) / 4.0;
            let width = f64::from(cell.accept) / 4.0;
            let count = 100_000;
            let inside = (0..count).filter(|i| {
                let u = begin + 2.0 * width * (f64::from(*i) + 0.5) / f64::from(count);
                let first = (u * steps).floor();
                let second = ((u * steps - first) * steps).floor();
                let third = ((u * steps - first) * steps - second) * steps;
                let (index, _) = choose_by_power(&lights, first / steps, [second / steps, third.floor() / steps]);
                lights[index as usize].triangle == wanted
            });
            2.0 * width * inside.count() as f64 / f64::from(count)
        };
        for light in [0, 3] {
            let (found, wanted) = (share(light), probabilities[light as usize]);
            assert!((found / wanted - 1.0).abs() < 1e-4, "{found} instead of {wanted}");
        }
    }

    #[test]
    fn lights_are_chosen_by_their_probabilities_and_leave_a_uniform_number() {
        let probabilities: Vec<f64> = (1..=30).map(|i| f64::from(i) / 465.0).collect();
        let mut lights: Vec<Light> = (0..30)
            .map(|triangle| Light {
                triangle,
                ..Light::zeroed()
            })
            .collect();
        set_alias_table(&mut lights, &probabilities);
        let count = 1 << 18;
        let mut chosen = [0.0; 30];
        let mut rests = 0.0;
        for path in 0..count {
            let [u, v, w, _] = Random::new(PathKind::Photon, path, 0, 0).next4();
            let (index, rest) = choose_by_power(&lights, u, [v, w]);
            chosen[index as usize] += 1.0;
            rests += rest;
        }
        let n = f64::from(count);
        // Six standard deviations: 31 comparisons of a correct program fail once in 10⁷ runs.
        for (found, p) in chosen.iter().zip(&probabilities) {
            assert!(
                (found - n * p).abs() < 6.0 * (n * p * (1.0 - p)).sqrt(),
                "{found} instead of {}",
                n * p
            );
        }
        assert!((rests / n - 0.5).abs() < 6.0 * 0.289 / n.sqrt(), "{}", rests / n);
    }

    /// The fraction of a spot's photons within an angle equals the fraction of its integrated intensity.
    #[test]
    fn photons_of_a_spot_are_spread_as_its_intensity() {
        for smooth in [0.0, 1.0] {
            assert_spread(&Light {
                kind: SPOT_LIGHT,
                direction: [0.0, 0.0, 1.0],
                inner: 0.1,
                outer: 0.4,
                area: smooth,
                ..Light::zeroed()
            });
        }
    }

    fn assert_spread(light: &Light) {
        const STEPS: u32 = 100_000;
        let mut integral = 0.0;
        let step = 0.4 / f64::from(STEPS);
        let falloff = |versine: f64| spot_falloff(light, direction_around(DVec3::Z, versine, 0.3));
        let (_, solid_angle) = spot_versine(light, 0.0);
        for i in 0..STEPS {
            integral += falloff((f64::from(i) + 0.5) * step) * step;
            if i % 10_000 == 9_999 {
                let within = 2.0 * PI * integral / solid_angle;
                let (found, _) = spot_versine(light, (1.0 - within).max(0.0));
                let expected = f64::from(i + 1) * step;
                assert!(
                    falloff(expected) < 1e-6 || (found - expected).abs() < 1e-4,
                    "{found} instead of {expected}"
                );
            }
        }
        assert!((2.0 * PI * integral / solid_angle - 1.0).abs() < 1e-6, "{integral}");
    }
}
