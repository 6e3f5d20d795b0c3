//! Lights: samples of incident light with densities, and samples of emission.
//!
//! A light is a triangle or a part of one, a point, a spot, a sun or the environment. The lights of one object form a *source*,
//! which has a probability for each of them.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::environment::Environment;
use super::intersect::{PlacedTriangle, Ray};
use super::media::{Media, transmittance};
use super::reflector::coat_passes;
use super::sampling::{basis, cosine_direction, direction_in_cone, disc_point, triangle_point};
use super::surface::{Surface, offset_origin, surface_at};
use super::texture::{apply_textures, opacity};
use super::vector::rgb;
use super::{FAR, Inputs};
use crate::alias::{self, AliasCell};
use crate::layout::{
    BACK_EMITS, DIRECTIONAL_LIGHT, ENDS_BEFORE, ENVIRONMENT_LIGHT, Light, Material, SPOT_LIGHT, TRIANGLE_LIGHT,
};
use crate::packing::Part;

/// Whether the triangle emits on its front or its back.
pub(super) fn emits(material: &Material, front: bool) -> bool {
    front || material.flags & BACK_EMITS != 0
}

/// Emitted radiance at this cosine to the normal. A clear coat also covers lamps.
pub(super) fn emitted_radiance(material: &Material, cosine: f64) -> DVec3 {
    coat_passes(f64::from(material.coat), cosine) * rgb(material.emission)
}

/// Falloff of a spot's intensity: the square of a ramp in the cosine, as `KHR_lights_punctual` recommends.
fn spot_falloff(light: &Light, direction: DVec3) -> f64 {
    if light.kind != SPOT_LIGHT {
        return 1.0;
    }
    let versine = 0.5 * (direction - rgb(light.direction)).length_squared();
    let (inner, outer) = (f64::from(light.inner), f64::from(light.outer));
    ((outer - versine) / (outer - inner)).clamp(0.0, 1.0).powi(2)
}

/// Attenuation by a light's range: `KHR_lights_punctual`'s window over the inverse square.
pub(super) fn range_window(inverse_range: f64, distance: f64) -> f64 {
    (1.0 - (distance * inverse_range).powi(4)).clamp(0.0, 1.0)
}

/// A sample of the light that arrives at a point.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// From the point to the light; unoccluded if nothing is hit before t = `end`.
    pub ray: Ray,
    /// See [`Self::ray`].
    pub end: f64,
    /// The emissive triangle.
    pub ignored: Option<PlacedTriangle>,
    /// Unit vector to the sampled point.
    pub towards: DVec3,
    /// Radiance; irradiance across the ray for delta lights.
    pub radiance: DVec3,
    /// Per solid angle; `None` for delta lights, which no BSDF sample hits.
    pub density: Option<f64>,
}

/// Samples the light that arrives at a point. `origin` gives the ray's origin for a direction.
pub fn sample_incident(
    inputs: &Inputs<'_>,
    light: u32,
    point: DVec3,
    origin: impl Fn(DVec3) -> DVec3,
    u: DVec2,
) -> Option<LightSample> {
    let index = light;
    let light = &inputs.scene.lights[index as usize];
    let media = Media::of(inputs.scene.media_of_lights[index as usize]);
    if light.kind == ENVIRONMENT_LIGHT {
        let (towards, sample) = Environment::of(&inputs.scene.environment).sample(u.x, u.y);
        return Some(LightSample {
            ray: Ray {
                origin: origin(towards),
                direction: towards,
            },
            end: FAR,
            ignored: None,
            towards,
            radiance: sample.radiance,
            density: Some(sample.density),
        });
    }
    if light.is_punctual() {
        let origin = origin(punctual(light, point, u).0);
        let (direction, end, irradiance) = punctual(light, origin, u);
        return Some(LightSample {
            ray: Ray { origin, direction },
            end,
            ignored: None,
            towards: direction.normalize(),
            radiance: irradiance * transmittance(inputs, media, direction.length()),
            density: None,
        });
    }
    let (u, v) = point_on_triangle(light, u).into();
    let triangle = PlacedTriangle::unplaced(light.triangle);
    let mut emitter = surface_at(inputs.scene, triangle, u, v);
    apply_textures(inputs.scene, &mut emitter);
    let origin = origin(emitter.position - point);
    let (towards, radiance, density) = emission_towards(inputs, &emitter, index, point)?;
    Some(LightSample {
        // Both ends are offset from their surfaces.
        ray: Ray {
            origin,
            direction: emitter.origin_towards(point - emitter.position) - origin,
        },
        end: 1.0 - ENDS_BEFORE,
        ignored: Some(triangle),
        towards,
        radiance: radiance * opacity(inputs.scene, &emitter),
        density: Some(density),
    })
}

/// Direction, radiance and density per solid angle of a point on an emissive triangle; `None` if it does not emit towards
/// `point`.
fn emission_towards(inputs: &Inputs<'_>, emitter: &Surface, light: u32, point: DVec3) -> Option<(DVec3, DVec3, f64)> {
    let way = emitter.position - point;
    let towards = way.normalize_or_zero();
    let cosine = -towards.dot(emitter.geometric_normal);
    if cosine == 0.0 || !emits(&emitter.material, cosine > 0.0) {
        return None;
    }
    let media = Media::of(inputs.scene.media_of_lights[light as usize]);
    let radiance = emitted_radiance(&emitter.material, cosine.abs()) * transmittance(inputs, media, way.length());
    let area = f64::from(inputs.scene.lights[light as usize].area);
    Some((towards, radiance, way.length_squared() / (area * cosine.abs())))
}

/// Radiance of an emissive triangle that a ray hit, with textures, and the density per solid angle with which its source's lights
/// are sampled there.
pub fn hit_emitter(inputs: &Inputs<'_>, emitter: &Surface, point: DVec3) -> Option<(DVec3, f64)> {
    let lights = &inputs.scene.lights;
    let columns = lights[emitter.light as usize].position[2] as u32;
    let light = emitter.light + Part::around(emitter.uv.into(), columns).number();
    let (_, radiance, density) = emission_towards(inputs, emitter, light, point)?;
    let mut sources = inputs.scene.light_sources.iter();
    let source = sources.find(|source| light.wrapping_sub(source.first_light) < source.light_count)?;
    let cumulative = |light: u32| f64::from(lights[light as usize].cumulative);
    let before = if light > source.first_light {
        cumulative(light - 1)
    } else {
        0.0
    };
    Some((radiance, density * (cumulative(light) - before)))
}

/// The ray from a point to a delta light or a sampled point of it, the ray's end, and the irradiance across the ray.
pub fn punctual(light: &Light, point: DVec3, u: DVec2) -> (DVec3, f64, DVec3) {
    let (extent, intensity) = (f64::from(light.extent), rgb(light.intensity));
    if light.kind == DIRECTIONAL_LIGHT {
        let towards = -rgb(light.direction);
        let towards = if extent > 0.0 {
            direction_in_cone(towards, extent, u)
        } else {
            towards
        };
        return (towards, FAR, intensity);
    }
    let mut ray = rgb(light.position) - point;
    let mut distance2 = ray.length_squared().max(1e-37);
    // Area over solid angle of the visible disc.
    let mut area_over_angle = distance2;
    if extent > 0.0 {
        // A disc that faces the point subtends the same angle as a sphere; from within its radius, half of all directions.
        let sin2 = (extent * extent / distance2).min(1.0);
        let versine = sin2 / (1.0 + (1.0 - sin2).sqrt());
        let towards = direction_in_cone(ray / distance2.sqrt(), versine, u);
        ray = towards.dot(ray).max(1e-18) * towards;
        distance2 = ray.length_squared();
        area_over_angle = extent * extent / (2.0 * versine);
    }
    let window = range_window(light.inverse_range.into(), distance2.sqrt());
    let falloff = spot_falloff(light, -ray / distance2.sqrt());
    (ray, 1.0, intensity * (falloff * window / area_over_angle))
}

/// Radiance of a light with an extent where a ray (a unit vector) hits it, and the distance; `None` if it misses.
pub fn soft_light_along(light: &Light, ray: Ray) -> Option<(DVec3, f64)> {
    let extent = f64::from(light.extent);
    if !light.is_punctual() || extent <= 0.0 {
        return None;
    }
    let intensity = rgb(light.intensity);
    if light.kind == DIRECTIONAL_LIGHT {
        let off_axis = 0.5 * (ray.direction + rgb(light.direction)).length_squared();
        return (off_axis <= extent).then(|| (intensity / (2.0 * PI * extent), FAR));
    }
    let to_middle = rgb(light.position) - ray.origin;
    let way = to_middle.dot(ray.direction);
    if way <= 0.0 || (to_middle - way * ray.direction).length_squared() > extent * extent {
        return None;
    }
    let shown = spot_falloff(light, -ray.direction) * range_window(light.inverse_range.into(), way);
    Some((intensity * (shown / (PI * extent * extent)), way))
}

/// Barycentric coordinates of a point on a triangle light or its part.
fn point_on_triangle(light: &Light, u: DVec2) -> DVec2 {
    let (u, v) = triangle_point(u.x, u.y);
    Part::of(light).place(DVec2::new(u, v))
}

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

    #[test]
    fn a_range_ends_the_light() {
        assert_eq!(range_window(0.0, 1e9), 1.0);
        assert_eq!(range_window(0.5, 1.0), 1.0 - 0.0625);
        assert_eq!(range_window(0.5, 2.0), 0.0);
        assert_eq!(range_window(0.5, 3.0), 0.0);
    }

    /// The fraction of a spot's photons within an angle equals the fraction of its integrated intensity.
    #[test]
    fn photons_of_a_spot_are_spread_as_its_intensity() {
        let light = Light {
            kind: SPOT_LIGHT,
            direction: [0.0, 0.0, 1.0],
            inner: 0.1,
            outer: 0.4,
            ..Light::zeroed()
        };
        const STEPS: u32 = 100_000;
        let mut integral = 0.0;
        let step = 0.4 / f64::from(STEPS);
        let falloff = |versine: f64| spot_falloff(&light, direction_around(DVec3::Z, versine, 0.3));
        let (_, solid_angle) = spot_versine(&light, 0.0);
        for i in 0..STEPS {
            integral += falloff((f64::from(i) + 0.5) * step) * step;
            if i % 10_000 == 9_999 {
                let within = 2.0 * PI * integral / solid_angle;
                let (found, _) = spot_versine(&light, (1.0 - within).max(0.0));
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
