//! Cameras, and the default camera for files that have none.

use std::f64::consts::PI;

use glam::Vec2;
use gltf_json::Root;
use gltf_json::camera::{Orthographic, Perspective, Type};
use gltf_json::validation::Checked;

use super::diagnostic::{Check, Warnings, damaged, label};
use super::graph::{PlacedNode, node_label};
use crate::scene::{Camera, Normalisation, Projection, frame};
use crate::text::shorten;

/// The cameras of the nodes, in render space.
pub(crate) fn cameras(
    root: &Root,
    nodes: &[PlacedNode<'_>],
    normalisation: Normalisation,
    warnings: &mut Warnings,
) -> Check<Vec<Camera>> {
    let mut cameras = Vec::new();
    for placed in nodes {
        let Some(index) = placed.node.camera else {
            continue;
        };
        let index = index.value();
        let camera = root.cameras.get(index).ok_or_else(|| {
            damaged(format_args!(
                "{}: there is no camera {index}, the file has {}",
                node_label(root, placed.index),
                root.cameras.len()
            ))
        })?;
        let label = label("camera", index, camera.name.as_deref());
        let (projection, aspect) = projection(camera, normalisation).map_err(|what| format!("{label}: {what}"))?;
        let name = match camera.name.as_deref().or(placed.node.name.as_deref()) {
            Some(name) => shorten(name),
            None => format!("camera {}", cameras.len()),
        };
        match place(name, (projection, aspect), placed, normalisation).map_err(|what| format!("{label}: {what}"))? {
            Some(camera) => cameras.push(camera),
            None => warnings.push(format!(
                "{label}: {} leaves it no direction (a scale of zero), and it is skipped",
                node_label(root, placed.index)
            )),
        }
    }
    Ok(cameras)
}

/// The camera's projection, and width over height if the file gives it. Clipping planes are ignored.
fn projection(camera: &gltf_json::Camera, normalisation: Normalisation) -> Check<(Projection, Option<f32>)> {
    match camera.type_ {
        Checked::Valid(Type::Orthographic) => match &camera.orthographic {
            Some(orthographic) => of_orthographic(orthographic, normalisation),
            None => Err(damaged("its type is orthographic, but it has no such projection")),
        },
        Checked::Valid(Type::Perspective) => match &camera.perspective {
            Some(perspective) => of_perspective(perspective),
            None => Err(damaged("its type is perspective, but it has no such projection")),
        },
        Checked::Invalid => Err(damaged("its type is neither perspective nor orthographic")),
    }
}

fn of_perspective(perspective: &Perspective) -> Check<(Projection, Option<f32>)> {
    let fov = f64::from(perspective.yfov);
    let tan_half_fov = (0.5 * fov).tan() as f32;
    // An angle near zero has a tangent that f32 can't hold.
    if !(fov > 0.0 && fov < PI && tan_half_fov.is_normal()) {
        return Err(format!(
            "its yfov is {fov}, but it must lie between 0 and π; correct it in the file"
        ));
    }
    if let Some(aspect) = perspective.aspect_ratio
        && !(aspect > 0.0 && aspect.is_normal())
    {
        return Err(format!(
            "its aspectRatio is {aspect}, but it must be positive; correct it in the file"
        ));
    }
    Ok((Projection::Perspective { tan_half_fov }, perspective.aspect_ratio))
}

/// Negative magnifications, which the specification discourages, count by their absolute value.
fn of_orthographic(orthographic: &Orthographic, normalisation: Normalisation) -> Check<(Projection, Option<f32>)> {
    let [width, height] = [orthographic.xmag, orthographic.ymag].map(f32::abs);
    let half_height = (f64::from(height) * normalisation.scale) as f32;
    let aspect = width / height;
    if !(half_height.is_normal() && aspect.is_normal()) {
        return Err(format!(
            "its xmag is {} and its ymag {}, but neither may be 0 or infinite; correct them in the file",
            orthographic.xmag, orthographic.ymag
        ));
    }
    Ok((Projection::Orthographic { half_height }, Some(aspect)))
}

/// The camera at a node; `None` if the node's transform leaves it no direction.
///
/// Lengths of axes are ignored. Ancestors that mirror turn the direction of view with the scene, but the picture remains
/// right-handed, as if the global transform were split into translation, rotation and scale.
fn place(
    name: String,
    (projection, aspect): (Projection, Option<f32>),
    placed: &PlacedNode<'_>,
    normalisation: Normalisation,
) -> Check<Option<Camera>> {
    let to_world = placed.unscaled_to_world;
    let position = normalisation.to_render(to_world.translation);
    if !position.is_finite() {
        return Err("it is too far from the scene; correct the translation of its node".into());
    }
    let Some(frame) = frame(-to_world.matrix3.z_axis, to_world.matrix3.y_axis) else {
        return Ok(None);
    };
    let [right, up, forward] = frame.map(|axis| axis.as_vec3());
    Ok(Some(Camera {
        name,
        position,
        right,
        up,
        forward,
        projection,
        aspect,
        lens: None,
        shift: Vec2::ZERO,
    }))
}
