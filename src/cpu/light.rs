//! Lights: `glsl/shared/light.glsl`.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::gloss::coat_passes;
use super::sampling::{direction_in_cone, triangle_point};
use super::surface::Surface;
use super::vector::rgb;
use crate::alias::{self, AliasCell};
use crate::layout::{BACK_EMITS, DIRECTIONAL_LIGHT, Light, Material, POINT_LIGHT, SPOT_LIGHT};
use crate::packing::Part;

/// By the alias method, with the digits of `u` in [0, 1) and of two more numbers below it.
pub(super) fn choose_light(lights: &[Light], u: f64, digits: [f64; 2]) -> alias::Choice {
    alias::choose(lights.len(), u, digits, |cell| AliasCell {
        accept: lights[cell].accept,
        alias: lights[cell].alias,
    })
}

/// Barycentric coordinates of a point of a triangle's light.
pub(super) fn point_of_light(light: &Light, u: DVec2) -> (f64, f64) {
    let (u, v) = triangle_point(u.x, u.y);
    Part::of(light).place(DVec2::new(u, v)).into()
}

/// Index of the light that a place of a triangle belongs to.
pub(super) fn light_at_place(lights: &[Light], emitter: &Surface) -> u32 {
    let [.., columns] = lights[emitter.light as usize].position;
    emitter.light + Part::around(emitter.uv.into(), columns as u32).number()
}

/// Whether light leaves on the triangle's front, or on its back.
pub(super) fn emits(material: &Material, front: bool) -> bool {
    front || material.flags & BACK_EMITS != 0
}

/// Radiance at this cosine to the normal: a coat lies on lamps too.
pub(super) fn emitted_radiance(material: &Material, cosine: f64) -> DVec3 {
    coat_passes(f64::from(material.coat), cosine) * rgb(material.emission)
}

/// Whether it is no surface and no environment.
pub(super) fn is_punctual(light: &Light) -> bool {
    [POINT_LIGHT, SPOT_LIGHT, DIRECTIONAL_LIGHT].contains(&light.kind)
}

/// How much of its intensity a spot has at 1 − cos of the angle from its axis: the square of a ramp in the cosine, as
/// `KHR_lights_punctual` recommends.
pub(super) fn spot_falloff(light: &Light, versine: f64) -> f64 {
    let (inner, outer) = (f64::from(light.inner), f64::from(light.outer));
    ((outer - versine) / (outer - inner)).clamp(0.0, 1.0).powi(2)
}

/// What a light with a range has left at a distance: `KHR_lights_punctual`'s window over the inverse square.
pub(super) fn range_window(inverse_range: f64, distance: f64) -> f64 {
    (1.0 - (distance * inverse_range).powi(4)).clamp(0.0, 1.0)
}

/// What reaches a point from a punctual light, or a place of it, if nothing is between.
pub(super) struct Arriving {
    /// To the light, or towards where it comes from.
    pub ray: DVec3,
    /// Of the ray, in its lengths.
    pub end: f64,
    /// Across the ray.
    pub irradiance: DVec3,
}

/// [`Arriving`] of a light for which [`is_punctual`] holds; `u` chooses the place of one with an extent.
pub(super) fn arriving_from(light: &Light, point: DVec3, u: DVec2) -> Arriving {
    let extent = f64::from(light.extent);
    if light.kind == DIRECTIONAL_LIGHT {
        let towards = -rgb(light.direction);
        return Arriving {
            ray: if extent > 0.0 {
                direction_in_cone(towards, extent, u)
            } else {
                towards
            },
            end: super::FAR,
            irradiance: rgb(light.intensity),
        };
    }
    let mut ray = rgb(light.position) - point;
    let mut distance2 = ray.length_squared().max(1e-37);
    // Of the light as it is seen.
    let mut area_over_angle = distance2;
    if extent > 0.0 {
        // A disc that looks here is seen as a sphere is, and from within its radius in half of all directions.
        let sin2 = extent * extent / distance2;
        let versine = if sin2 < 1.0 {
            sin2 / (1.0 + (1.0 - sin2).sqrt())
        } else {
            1.0
        };
        let towards = direction_in_cone(ray / distance2.sqrt(), versine, u);
        let way = towards.dot(ray).max(1e-18);
        ray = way * towards;
        distance2 = way * way;
        area_over_angle = extent * extent / (2.0 * versine);
    }
    let falloff = if light.kind == SPOT_LIGHT {
        spot_falloff(
            light,
            0.5 * (ray / distance2.sqrt() + rgb(light.direction)).length_squared(),
        )
    } else {
        1.0
    };
    Arriving {
        ray,
        end: 1.0,
        irradiance: rgb(light.intensity)
            * (falloff * range_window(light.inverse_range.into(), distance2.sqrt()) / area_over_angle),
    }
}

/// Radiance of a light with an extent where a ray along a unit vector meets it, and how far away; `None` where it passes by.
pub(super) fn soft_light_along(light: &Light, origin: DVec3, direction: DVec3) -> Option<(DVec3, f64)> {
    let extent = f64::from(light.extent);
    if !is_punctual(light) || extent <= 0.0 {
        return None;
    }
    let off_axis = 0.5 * (direction + rgb(light.direction)).length_squared();
    let intensity = rgb(light.intensity);
    if light.kind == DIRECTIONAL_LIGHT {
        return (off_axis <= extent).then(|| (intensity / (2.0 * PI * extent), super::FAR));
    }
    let to_middle = rgb(light.position) - origin;
    let way = to_middle.dot(direction);
    if way <= 0.0 || (to_middle - way * direction).length_squared() > extent * extent {
        return None;
    }
    let falloff = if light.kind == SPOT_LIGHT {
        spot_falloff(light, off_axis)
    } else {
        1.0
    };
    let shown = falloff * range_window(light.inverse_range.into(), way);
    Some((intensity * (shown / (PI * extent * extent)), way))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packing::set_alias_table;
    use crate::random::{PathKind, Random};
    use bytemuck::Zeroable;

    /// A light of one choice in 10¹² has its turn as often: choices near it are enumerated, all others can't be it.
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
            // Numbers from the beginning of the cell on: as many steps of the digits as it is accepted for, and as many again.
            let begin = f64::from(wanted) / 4.0;
            let width = f64::from(cell.accept) / 4.0;
            let count = 100_000;
            let inside = (0..count).filter(|i| {
                let u = begin + 2.0 * width * (f64::from(*i) + 0.5) / f64::from(count);
                let first = (u * steps).floor();
                let second = ((u * steps - first) * steps).floor();
                let third = ((u * steps - first) * steps - second) * steps;
                let choice = choose_light(&lights, first / steps, [second / steps, third.floor() / steps]);
                lights[choice.index].triangle == wanted
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
            let alias::Choice { index, rest } = choose_light(&lights, u, [v, w]);
            chosen[index] += 1.0;
            rests += rest;
        }
        let n = f64::from(count);
        // Six standard deviations: 31 comparisons of a right program fail once in 10⁷ times.
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
}
