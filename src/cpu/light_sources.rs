//! Which source of light a point asks: the counterpart of `glsl/shared/light_sources.glsl`.

use std::ops::Range;

use glam::DVec3;

use super::Inputs;
use super::vector::rgb;
use crate::emission::light_of;
use crate::layout::{DIRECTIONAL_LIGHT, ENVIRONMENT_LIGHT, LightSource, TRIANGLE_LIGHT, WITHOUT_POINT};

/// Cosine of the difference of two angles, or 1 where the first is the smaller one.
fn cos_beyond(cos_a: f64, cos_b: f64) -> f64 {
    let sines = ((1.0 - cos_a * cos_a).max(0.0) * (1.0 - cos_b * cos_b).max(0.0)).sqrt();
    if cos_a >= cos_b { 1.0 } else { cos_a * cos_b + sines }
}

/// Irradiance at the most, up to a factor.
fn most_from(source: &LightSource, position: DVec3, normal: DVec3) -> f64 {
    let strength = f64::from(source.strength);
    let (axis, cos_cone) = (rgb(source.axis), f64::from(source.cos_cone));
    match source.kind {
        ENVIRONMENT_LIGHT => return strength,
        DIRECTIONAL_LIGHT => return strength * cos_beyond(-normal.dot(axis), cos_cone).max(0.0),
        _ => {}
    }
    let to_centre = rgb(source.centre) - position;
    let distance2 = to_centre.length_squared();
    let radius2 = f64::from(source.radius).powi(2);
    if distance2 <= radius2 {
        return strength / radius2.max(1e-37);
    }
    let distance = distance2.max(1e-37).sqrt();
    // The angle that its sphere is seen at.
    let cos_width = (1.0 - radius2 / distance2).max(0.0).sqrt();
    let cos_surface = cos_beyond(normal.dot(to_centre) / distance, cos_width);
    let cos_light = cos_beyond(cos_beyond(-axis.dot(to_centre) / distance, cos_cone), cos_width);
    let cos_light = if source.kind == TRIANGLE_LIGHT {
        cos_light.max(0.0)
    } else {
        f64::from(u8::from(cos_light >= 1.0))
    };
    if (distance - f64::from(source.radius)) * f64::from(source.inverse_range) < 1.0 {
        strength * cos_surface.max(0.0) * cos_light / (distance * distance)
    } else {
        0.0
    }
}

/// Each source with its probability at a point.
fn sources<'a>(
    inputs: &Inputs<'a>,
    position: DVec3,
    normal: DVec3,
) -> impl Iterator<Item = (&'a LightSource, f64)> + use<'a> {
    let of_scene = &inputs.scene.light_sources;
    let most: Vec<f64> = of_scene
        .iter()
        .map(|source| most_from(source, position, normal))
        .collect();
    let all: f64 = most.iter().sum();
    let without_point = |(source, most): (&LightSource, &f64)| if *most > 0.0 { source.probability } else { 0.0 };
    let without_point: f32 = of_scene.iter().zip(&most).map(without_point).sum();
    let probability = move |(source, most): (&'a LightSource, f64)| {
        let own = f64::from(source.probability);
        let probability = match (all > 0.0, most > 0.0) {
            // Where none can bring anything, nothing is lost by any choice.
            (false, _) => own,
            (true, true) => (1.0 - WITHOUT_POINT) * most / all + WITHOUT_POINT * own / f64::from(without_point),
            (true, false) => 0.0,
        };
        (source, probability)
    };
    of_scene.iter().zip(most).map(probability)
}

/// A light for a point, and its probability: `u` chooses the source, `u_light` the light.
pub(super) fn choose_light_for(
    inputs: &Inputs<'_>,
    position: DVec3,
    normal: DVec3,
    [u, u_light]: [f64; 2],
) -> (usize, f64) {
    let mut sum = 0.0;
    let mut chosen = None;
    for (source, probability) in sources(inputs, position, normal).filter(|(_, probability)| *probability > 0.0) {
        // Rounding may leave the last number beyond all: the last source that can be chosen has it.
        chosen = Some((source, probability));
        sum += probability;
        if sum > u {
            break;
        }
    }
    let (source, probability) = chosen.unwrap_or((&inputs.scene.light_sources[0], 1.0));
    let (light, within) = choose_light_of(inputs, source, u_light);
    (light, probability * within)
}

/// A light of a source, and its probability within that.
pub(super) fn choose_light_of(inputs: &Inputs<'_>, source: &LightSource, u_light: f64) -> (usize, f64) {
    light_of(&inputs.scene.lights, range_of(source), u_light)
}

/// The lights of a source.
fn range_of(source: &LightSource) -> Range<u32> {
    source.first_light..source.first_light + source.light_count
}

/// The probability of a light in [`choose_light_of`]; 0 of one of another source.
pub(super) fn probability_of(inputs: &Inputs<'_>, source: &LightSource, light: u32) -> f64 {
    let range = range_of(source);
    if !range.contains(&light) {
        return 0.0;
    }
    let cumulative = |light: u32| f64::from(inputs.scene.lights[light as usize].cumulative);
    let before = if light > range.start {
        cumulative(light - 1)
    } else {
        0.0
    };
    cumulative(light) - before
}

/// The probability of a light in [`choose_light_for`].
pub(super) fn probability_for(inputs: &Inputs<'_>, position: DVec3, normal: DVec3, light: u32) -> f64 {
    let found = sources(inputs, position, normal).find(|(source, _)| range_of(source).contains(&light));
    found.map_or(0.0, |(source, probability)| {
        probability * probability_of(inputs, source, light)
    })
}
