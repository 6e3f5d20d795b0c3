//! Where photon paths start: `glsl/shared/emission.glsl` in f64.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::Inputs;
use super::environment::Environment;
use super::intersect::{PlacedTriangle, Ray};
use super::light::{choose_light, emits, emitted_radiance, point_of_light, spot_falloff};
use super::media::Media;
use super::sampling::{basis, cosine_direction, direction_in_cone, disc_point};
use super::surface::{offset_origin, surface_at};
use super::texture::{apply_textures, share_there};
use super::vector::rgb;
use crate::alias::Choice;
use crate::emission::{Table, light_of};
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, Light, NARROW_CONE, POINT_LIGHT, SPOT_LIGHT, WIDE_CONE};
use crate::packing::Sphere;
use crate::random::Random;

#[cfg(test)]
mod tests;

/// The start of a photon path.
pub(super) struct Emission {
    pub ray: Ray,
    pub flux: DVec3,
    /// The triangle that it leaves.
    pub ignored: Option<PlacedTriangle>,
    /// Of a punctual light; 0 for one that reaches any distance.
    pub inverse_range: f64,
    /// That it starts in.
    pub media: Media,
}

/// A start, and what is to be known of it to tell which targets it meets.
struct Start {
    ray: Ray,
    flux: DVec3,
    ignored: Option<PlacedTriangle>,
    /// A point of the ray from afar, which has no beginning.
    passed: Option<DVec3>,
    /// By the way it was chosen.
    on_target: bool,
}

/// Starts a path on a light: where the table says or, without one, by power. One without flux is rejected, since it would
/// meet another target before the one that it was chosen for.
pub(super) fn emit(inputs: &Inputs<'_>, random: &mut Random) -> Emission {
    let u = random.next4();
    let w = random.next4();
    if let Some(table) = inputs.emission {
        return emit_aimed(inputs, table, u, w);
    }
    let Choice { index, rest } = choose_light(&inputs.scene.lights, u[0], [w[0], w[2]]);
    let light = &inputs.scene.lights[index];
    let start = from_light(
        inputs,
        light,
        DVec2::new(rest, u[1]),
        DVec2::new(u[2], u[3]),
        w[1],
        None,
    );
    start.emission(inputs, index, 1.0 / f64::from(light.probability))
}

/// From a matte surface outside of what the camera sees, half of the photons are aimed there. The direction in place of the
/// `cosine`'s, and what the flux is to be weighed with: cosine over the density of both ways together, at most 2.
pub(super) fn guide(inputs: &Inputs<'_>, position: DVec3, normal: DVec3, u: [f64; 4], cosine: DVec3) -> (DVec3, f64) {
    let view = inputs
        .emission
        .and_then(|table| table.view.map(|view| Sphere::of(table.spheres[view as usize])));
    let Some(view) = view else { return (cosine, 1.0) };
    let way = view.centre - position;
    if view.radius.powi(2) >= NARROW_CONE * way.length_squared() || way.dot(normal) <= -view.radius {
        return (cosine, 1.0);
    }
    let (axis, versine) = view.cone(position);
    let aimed = u[3] < 0.5;
    let direction = if aimed {
        direction_in_cone(axis, versine, DVec2::new(u[0], u[1]))
    } else {
        cosine
    };
    let inside = aimed || 1.0 - direction.dot(axis) <= versine;
    let by_cosine = direction.dot(normal).max(0.0) / PI;
    let by_aim = if inside { 1.0 / (2.0 * PI * versine) } else { 0.0 };
    let weight = if by_cosine > 0.0 {
        2.0 * by_cosine / (by_cosine + by_aim)
    } else {
        0.0
    };
    (direction, weight)
}

fn emit_aimed(inputs: &Inputs<'_>, table: &Table, u: [f64; 4], w: [f64; 4]) -> Emission {
    let chosen = table.choose(u, w);
    let [x, y, direction_x, direction_y, number] = table.coordinates(chosen);
    let cell = &table.cells[chosen.cell];
    let of_source = cell.first_light..cell.first_light + cell.lights;
    let (light_index, probability) = light_of(&inputs.scene.lights, of_source, number);
    let light = &inputs.scene.lights[light_index];
    let index = (cell.target as usize).min(table.spheres.len());
    let target = table.spheres.get(index).copied().map(Sphere::of);
    let (place, direction) = (DVec2::new(x, y), DVec2::new(direction_x, direction_y));
    let start = from_light(inputs, light, place, direction, w[1], target);
    let is_met = |sphere: &Sphere| match start.passed {
        Some(origin) => sphere.is_met(origin, start.ray.direction, true),
        None => sphere.is_met(start.ray.origin, start.ray.direction, false),
    };
    let met = start.on_target || target.is_none_or(|target| is_met(&target));
    let kept = met
        && !table.spheres[..index]
            .iter()
            .any(|&earlier| is_met(&Sphere::of(earlier)));
    let weight = if kept {
        f64::from(cell.weight) / probability
    } else {
        0.0
    };
    start.emission(inputs, light_index, weight)
}

impl Start {
    fn emission(&self, inputs: &Inputs<'_>, light: usize, weight: f64) -> Emission {
        Emission {
            media: Media::of(inputs.scene.media_of_lights[light]),
            ray: self.ray,
            flux: self.flux * weight,
            ignored: self.ignored,
            inverse_range: inputs.scene.lights[light].inverse_range.into(),
        }
    }
}

/// From a light towards a target, or wherever it shines; flux over the density of the coordinates' choice.
fn from_light(
    inputs: &Inputs<'_>,
    light: &Light,
    place: DVec2,
    direction: DVec2,
    side: f64,
    target: Option<Sphere>,
) -> Start {
    match light.kind {
        POINT_LIGHT | SPOT_LIGHT => from_point(light, place, direction, target),
        DIRECTIONAL_LIGHT if light.extent > 0.0 => {
            let towards = direction_in_cone(-rgb(light.direction), light.extent.into(), direction);
            through_sphere(light, towards, rgb(light.intensity), place, target)
        }
        DIRECTIONAL_LIGHT => {
            let flight = rgb(light.direction);
            let plane = rgb(light.position);
            let disc = target.unwrap_or(Sphere {
                centre: plane,
                radius: (f64::from(light.area) / PI).sqrt(),
            });
            let area = target.map_or(f64::from(light.area), |target| PI * target.radius.powi(2));
            let passed = point_across(disc, flight, place);
            // From a plane before the scene.
            let back = target.map_or(0.0, |_| flight.dot(passed - plane));
            from_afar(passed, passed - flight * back, flight, rgb(light.intensity) * area)
        }
        ENVIRONMENT_LIGHT => {
            let environment = Environment::of(&inputs.scene.environment);
            let (towards, sky) = environment.sample(direction.x, direction.y);
            through_sphere(light, towards, sky.radiance / sky.density, place, target)
        }
        _ => from_triangle(inputs, light, place, direction, side, target),
    }
}

/// Through a disc across the rays that covers the target, or the scene, where rays of many directions come from afar.
fn through_sphere(light: &Light, towards: DVec3, irradiance: DVec3, place: DVec2, target: Option<Sphere>) -> Start {
    let scene = Sphere {
        centre: DVec3::ZERO,
        radius: (f64::from(light.area) / PI).sqrt(),
    };
    let disc = target.unwrap_or(scene);
    let area = target.map_or(f64::from(light.area), |target| PI * target.radius.powi(2));
    let passed = point_across(disc, -towards, place);
    let origin = passed + towards * (scene.radius - disc.centre.dot(towards));
    from_afar(passed, origin, -towards, irradiance * area)
}

fn from_afar(passed: DVec3, origin: DVec3, direction: DVec3, flux: DVec3) -> Start {
    Start {
        ray: Ray { origin, direction },
        flux,
        ignored: None,
        passed: Some(passed),
        on_target: true,
    }
}

/// A point of the disc across a direction that covers a sphere.
fn point_across(sphere: Sphere, direction: DVec3, u: DVec2) -> DVec3 {
    sphere.centre + basis(direction) * (sphere.radius * disc_point(u.x, u.y)).extend(0.0)
}

fn from_point(light: &Light, place: DVec2, u: DVec2, target: Option<Sphere>) -> Start {
    let position = rgb(light.position);
    // Rays from anywhere on the light's disc.
    let extent = f64::from(light.extent);
    let wider = target.map(|target| Sphere {
        radius: target.radius + extent,
        ..target
    });
    let (axis, versine) = wider.map_or((DVec3::Z, 2.0), |target| target.cone(position));
    let is_spot = light.kind == SPOT_LIGHT;
    let (off_spot, spot_solid_angle) = if is_spot { spot_versine(light, u.x) } else { (0.0, 0.0) };
    let mut solid_angle = 2.0 * PI * versine;
    let mut falloff = 1.0;
    let by_intensity = is_spot && (target.is_none() || solid_angle >= spot_solid_angle);
    let direction = if by_intensity {
        solid_angle = spot_solid_angle;
        direction_off(rgb(light.direction), off_spot, u.y)
    } else if target.is_none() {
        direction_off(axis, 2.0 * u.x, u.y)
    } else {
        let direction = direction_in_cone(axis, versine, u);
        if is_spot {
            falloff = spot_falloff(light, 0.5 * (direction - rgb(light.direction)).length_squared());
        }
        direction
    };
    let disc = Sphere {
        centre: position,
        radius: extent,
    };
    Start {
        ray: Ray {
            origin: point_across(disc, direction, place),
            direction,
        },
        flux: rgb(light.intensity) * (falloff * solid_angle),
        ignored: None,
        passed: None,
        on_target: !by_intensity && extent == 0.0,
    }
}

/// From a point of a triangle, on its front or, if both sides shine, by `side` on either of them.
fn from_triangle(
    inputs: &Inputs<'_>,
    light: &Light,
    place: DVec2,
    u: DVec2,
    side: f64,
    target: Option<Sphere>,
) -> Start {
    let (x, y) = point_of_light(light, place);
    let triangle = PlacedTriangle::unplaced(light.triangle);
    let mut emitter = surface_at(inputs.scene, triangle, x, y);
    apply_textures(inputs.scene, &mut emitter);
    let both_sides = emits(&emitter.material, false);
    let normal = if both_sides && side < 0.5 {
        -emitter.geometric_normal
    } else {
        emitter.geometric_normal
    };
    let sides = if both_sides { 2.0 } else { 1.0 };
    let origin = offset_origin(emitter.position, normal, emitter.reach);
    let seen_narrow = |target: &Sphere| target.radius.powi(2) < WIDE_CONE * (target.centre - origin).length_squared();
    let narrow = target.filter(seen_narrow);
    // Solid angle times cosine, of directions as dense as the chosen one.
    let (direction, projected) = match narrow {
        Some(target) => {
            let (axis, versine) = target.cone(origin);
            let direction = direction_in_cone(axis, versine, u);
            (direction, direction.dot(normal).max(0.0) * 2.0 * PI * versine)
        }
        None => (cosine_direction(normal, u.x, u.y), PI),
    };
    let radiance = emitted_radiance(&emitter.material, direction.dot(normal).max(0.0));
    Start {
        ray: Ray { origin, direction },
        flux: radiance * (projected * sides * f64::from(light.area) * share_there(inputs.scene, &emitter)),
        ignored: Some(triangle),
        passed: None,
        on_target: narrow.is_some(),
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
