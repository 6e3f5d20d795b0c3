//! `KHR_lights_punctual`: point, spot and directional lights.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};
use gltf_json::extensions::scene::khr_lights_punctual::{Light as JsonLight, Type};
use gltf_json::validation::Checked;
use gltf_json::{Index, Root};
use serde::Deserialize;

use super::LoadOptions;
use super::diagnostic::{Check, Warnings, damaged, label};
use super::extensions::LIGHT_SHAPE;
use super::graph::{PlacedNode, node_label};
use crate::scene::{LightKind, Normalisation, PunctualLight};

/// Minimum relative width of the falloff of a spot, in terms of 1 − cos: exporters write angles that are nearly equal.
const NARROWEST_EDGE: f64 = 1e-4;

/// Range of a light's radius, in render units: below it is treated as 0, above it is refused.
const SMALLEST_RADIUS: f64 = 1e-9;
const LARGEST_RADIUS: f64 = 1e4;

/// `PPMVK_light_shape`: what a light has beyond `KHR_lights_punctual`.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default)]
struct Shape {
    /// Point, spot: in scene units.
    radius: Option<f64>,
    /// Directional: angular diameter, in radians.
    angle: Option<f64>,
    /// Spot: the falloff is a smoothstep of the cosine, as in Blender, not the square of a ramp.
    smooth: bool,
}

impl Shape {
    fn of(light: &JsonLight) -> Check<Self> {
        #[derive(Default, Deserialize)]
        #[serde(default)]
        struct Extensions {
            #[serde(rename = "PPMVK_light_shape")]
            shape: Shape,
        }
        let Some(extensions) = &light.extensions else {
            return Ok(Self::default());
        };
        let Extensions { shape } = serde_json::from_str(extensions.get())
            .map_err(|error| damaged(format_args!("its extensions can't be read: {error}")))?;
        let lengths = [shape.radius, shape.angle].into_iter().flatten();
        if !lengths.clone().all(|length| length >= 0.0) || shape.angle.is_some_and(|angle| angle > PI) {
            return Err(format!(
                "its radius is {:?} and its angle {:?} ({LIGHT_SHAPE}), but neither may be negative, nor the angle above π; correct \
                 them in the file",
                shape.radius.unwrap_or_default(),
                shape.angle.unwrap_or_default()
            ));
        }
        Ok(shape)
    }
}

/// The lights of the nodes, in render space; black ones are left out.
pub(crate) fn punctual_lights(
    root: &Root,
    nodes: &[PlacedNode<'_>],
    normalisation: Normalisation,
    options: &LoadOptions,
    warnings: &mut Warnings,
) -> Check<Vec<PunctualLight>> {
    let extension = root
        .extensions
        .as_ref()
        .and_then(|all| all.khr_lights_punctual.as_ref());
    let in_file = extension.map_or(&[][..], |extension| &extension.lights);
    let mut lights = Vec::new();
    for placed in nodes {
        let of_node = placed.node.extensions.as_ref();
        let Some(used) = of_node.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else {
            continue;
        };
        let index = Index::value(&used.light);
        let light = in_file.get(index).ok_or_else(|| {
            damaged(format_args!(
                "{}: there is no light {index}, the file has {}",
                node_label(root, placed.index),
                in_file.len()
            ))
        })?;
        let label = label("light", index, light.name.as_deref());
        let shape = Shape::of(light).map_err(|what| format!("{label}: {what}"))?;
        let Some(kind) = kind_of(light, shape, placed).map_err(|what| format!("{label}: {what}"))? else {
            warnings.push(format!(
                "{label}: {} leaves it no direction (a scale of zero), and it is skipped",
                node_label(root, placed.index)
            ));
            continue;
        };
        let light_in_place = place(light, kind, shape, placed, normalisation, options, root)
            .map_err(|what| format!("{label}: {what}"))?;
        if light_in_place.intensity.max_element() > 0.0 {
            lights.push(light_in_place);
        }
    }
    Ok(lights)
}

/// The kind of a light at a node; `None` if the node's transform leaves it no direction. Lengths of axes are ignored, as for
/// cameras.
fn kind_of(light: &JsonLight, shape: Shape, placed: &PlacedNode<'_>) -> Check<Option<LightKind>> {
    let Checked::Valid(kind) = light.type_ else {
        return Err(damaged("its type is neither point nor spot nor directional"));
    };
    let direction = (-placed.unscaled_to_world.matrix3.z_axis)
        .try_normalize()
        .map(DVec3::as_vec3);
    Ok(match kind {
        Type::Point => Some(LightKind::Point),
        Type::Directional => direction.map(|direction| LightKind::Directional { direction }),
        Type::Spot => {
            let (inner, outer) = cone(light)?;
            direction.map(|direction| LightKind::Spot {
                direction,
                inner,
                outer,
                smooth: shape.smooth,
            })
        }
    })
}

/// 1 − cos of a spot's angles.
fn cone(light: &JsonLight) -> Check<(f64, f64)> {
    // Exporters omit an object whose values are all defaults.
    let [in_file_inner, in_file_outer] = match &light.spot {
        Some(spot) => [spot.inner_cone_angle, spot.outer_cone_angle],
        None => [0.0, std::f32::consts::FRAC_PI_4],
    };
    // f32 rounds π/2 up.
    let [inner, outer] = [in_file_inner, in_file_outer].map(|angle| f64::from(angle).min(FRAC_PI_2));
    let is_wide = in_file_outer > std::f32::consts::FRAC_PI_2;
    if !(inner >= 0.0 && outer > 0.0 && inner <= outer) || is_wide {
        return Err(format!(
            "its innerConeAngle is {in_file_inner} and its outerConeAngle {in_file_outer}, but 0 ≤ inner < outer ≤ π/2 must \
             hold; correct them in the file"
        ));
    }
    // 1 − cos, without the cancellation.
    let versine = |angle: f64| 2.0 * (0.5 * angle).sin().powi(2);
    let outer = versine(outer);
    Ok((versine(inner).min(outer * (1.0 - NARROWEST_EDGE)), outer))
}

fn place(
    light: &JsonLight,
    kind: LightKind,
    shape: Shape,
    placed: &PlacedNode<'_>,
    normalisation: Normalisation,
    options: &LoadOptions,
    root: &Root,
) -> Check<PunctualLight> {
    let color = DVec3::from(light.color.map(f64::from));
    let in_file = color * f64::from(light.intensity);
    if !(color.min_element() >= 0.0 && light.intensity >= 0.0 && in_file.is_finite()) {
        return Err(format!(
            "its color is {} {} {} and its intensity {}, but they must be finite and not negative; correct them in the file",
            light.color[0], light.color[1], light.color[2], light.intensity
        ));
    }
    let range = match light.range {
        Some(range) if range.is_nan() || range <= 0.0 => {
            return Err(format!(
                "its range is {range}, but it must be above 0; correct it in the file"
            ));
        }
        range => range
            .filter(|range| range.is_finite())
            .map(|range| f64::from(range) * normalisation.scale),
    };
    let is_directional = matches!(kind, LightKind::Directional { .. });
    // Radiance and irradiance are the same in render space. Intensity is irradiance times a squared length.
    let unit = if is_directional {
        1.0
    } else {
        normalisation.scale.powi(2)
    };
    let intensity = (in_file / options.light_units.divisor(root) * unit).as_vec3();
    let position = if is_directional {
        Vec3::ZERO
    } else {
        normalisation.to_render(placed.to_world.translation)
    };
    if !(position.is_finite() && intensity.is_finite()) {
        return Err(
            "it is too far from the scene, or too bright; correct its node's translation or its intensity".into(),
        );
    }
    Ok(PunctualLight {
        kind,
        position,
        intensity,
        extent: if is_directional {
            0.5 * shape.angle.unwrap_or(options.sun_angle.to_radians())
        } else {
            radius_of(shape.radius.unwrap_or(options.light_radius) * normalisation.scale)?
        },
        range: range.filter(|_| !is_directional),
    })
}

/// The radius of a point or spot in render units. A radius below the precision of the scene's coordinates becomes 0.
fn radius_of(radius: f64) -> Check<f64> {
    if radius > LARGEST_RADIUS {
        return Err(format!(
            "the radius of points and spots is more than {LARGEST_RADIUS} times as large as the scene; give it in the scene's units"
        ));
    }
    Ok(if radius < SMALLEST_RADIUS { 0.0 } else { radius })
}
