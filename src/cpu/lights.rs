//! Lights: samples of the light that arrives at a point, with densities.
//!
//! A light is a triangle or a part of one, a point, a spot, a sun or the environment. The lights of one object form a *source*,
//! which has a probability for each of them.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::environment::Environment;
use super::intersect::{PlacedTriangle, Ray};
use super::media::{Media, transmittance};
use super::reflector::coat_passes;
use super::sampling::{direction_in_cone, triangle_point};
use super::surface::{Surface, surface_at};
use super::texture::{apply_textures, opacity};
use super::vector::rgb;
use super::{FAR, Inputs};
use crate::layout::{BACK_EMITS, DIRECTIONAL_LIGHT, ENDS_BEFORE, ENVIRONMENT_LIGHT, Light, Material, SPOT_LIGHT};
use crate::packing::Part;

/// Whether the triangle emits on its front or its back.
pub(super) fn emits(material: &Material, front: bool) -> bool {
    front || material.flags & BACK_EMITS != 0
}

/// Emitted radiance at this cosine to the normal. A clear coat also covers lamps.
pub(super) fn emitted_radiance(material: &Material, cosine: f64) -> DVec3 {
    coat_passes(f64::from(material.coat), cosine) * rgb(material.emission)
}

/// Falloff of a spot's intensity: the square of a ramp in the cosine, as `KHR_lights_punctual` recommends, or its smoothstep.
pub(super) fn spot_falloff(light: &Light, direction: DVec3) -> f64 {
    if light.kind != SPOT_LIGHT {
        return 1.0;
    }
    let versine = 0.5 * (direction - rgb(light.direction)).length_squared();
    let (inner, outer) = (f64::from(light.inner), f64::from(light.outer));
    let ramp = ((outer - versine) / (outer - inner)).clamp(0.0, 1.0);
    ramp.powi(2) * (1.0 + f64::from(light.area) * (2.0 - 2.0 * ramp))
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
pub(super) fn point_on_triangle(light: &Light, u: DVec2) -> DVec2 {
    let (u, v) = triangle_point(u.x, u.y);
    Part::of(light).place(DVec2::new(u, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_ends_the_light() {
        assert_eq!(range_window(0.0, 1e9), 1.0);
        assert_eq!(range_window(0.5, 1.0), 1.0 - 0.0625);
        assert_eq!(range_window(0.5, 2.0), 0.0);
        assert_eq!(range_window(0.5, 3.0), 0.0);
    }
}
