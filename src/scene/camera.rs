//! Perspective cameras, and the one that stands in where the file has none.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use gltf::json::camera::{Perspective, Type};
use gltf::json::validation::Checked;
use gltf::json::{self, Root};

use super::diagnostic::{Check, Warnings, damaged, label, list, quote, shorten};
use super::graph::{PlacedNode, node_label};
use super::{Camera, Normalisation, Scene};
use crate::error::{Error, Result};

/// Vertical angle of view of the camera that is framed on the bounds, in radians.
const FRAMED_FOV: f64 = 40.0 * PI / 180.0;

/// How far that camera looks down, in radians.
const FRAMED_PITCH: f64 = 15.0 * PI / 180.0;

/// Free space around the bounds in its picture, as a factor of its distance.
const FRAMED_MARGIN: f64 = 1.05;

/// The perspective cameras of the nodes, in render space. Others are skipped with a warning.
pub(super) fn cameras(
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
        let Some(perspective) = perspective(camera).map_err(|what| format!("{label}: {what}"))? else {
            warnings.push(format!(
                "{label}: it is orthographic, which isn't supported yet, and is skipped"
            ));
            continue;
        };
        let name = match camera.name.as_deref().or(placed.node.name.as_deref()) {
            Some(name) => shorten(name),
            None => format!("camera {}", cameras.len()),
        };
        match place(name, perspective, placed, normalisation).map_err(|what| format!("{label}: {what}"))? {
            Some(camera) => cameras.push(camera),
            None => warnings.push(format!(
                "{label}: {} leaves it no direction (a scale of zero), and it is skipped",
                node_label(root, placed.index)
            )),
        }
    }
    Ok(cameras)
}

/// The camera's perspective projection, or `None` if it is orthographic.
fn perspective(camera: &json::Camera) -> Check<Option<&Perspective>> {
    match camera.type_ {
        Checked::Valid(Type::Orthographic) => Ok(None),
        Checked::Valid(Type::Perspective) => match &camera.perspective {
            Some(perspective) => Ok(Some(perspective)),
            None => Err(damaged("its type is perspective, but it has no such projection")),
        },
        Checked::Invalid => Err(damaged("its type is neither perspective nor orthographic")),
    }
}

/// The camera at a node; `None` if the node's transform leaves it no direction. Clipping planes play no part.
///
/// Lengths of axes are ignored. Ancestors that mirror turn the direction of view with the scene, but the picture stays
/// right-handed: that is what splitting the global transform into translation, rotation and scale gives.
fn place(
    name: String,
    perspective: &Perspective,
    placed: &PlacedNode<'_>,
    normalisation: Normalisation,
) -> Check<Option<Camera>> {
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
        tan_half_fov,
        aspect: perspective.aspect_ratio,
    }))
}

/// Orthonormal right, up and forward from a direction of view and an up direction that need be neither.
fn frame(forward: DVec3, up: DVec3) -> Option<[DVec3; 3]> {
    let forward = forward.try_normalize()?;
    let right = forward.cross(up.try_normalize()?).try_normalize()?;
    Some([right, right.cross(forward), forward])
}

/// A camera that looks at the centre of the bounds along −Z and slightly down, from where it sees all of them in any
/// picture that is no higher than wide.
pub(super) fn framed_on((lower, upper): (Vec3, Vec3)) -> Camera {
    let (sin, cos) = FRAMED_PITCH.sin_cos();
    let forward = DVec3::new(0.0, -sin, -cos);
    let right = DVec3::X;
    let up = right.cross(forward);
    let tan = (0.5 * FRAMED_FOV).tan();

    let centre = 0.5 * (lower.as_dvec3() + upper.as_dvec3());
    let half = upper.as_dvec3() - centre;
    let mut distance: f64 = 0.0;
    for corner in 0..8 {
        let sign = |axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
        let offset = half * DVec3::new(sign(0), sign(1), sign(2));
        let reach = offset.dot(right).abs().max(offset.dot(up).abs());
        distance = distance.max(reach / tan - offset.dot(forward));
    }
    let position = centre - forward * (distance * FRAMED_MARGIN);
    Camera {
        name: "framed on the bounds".into(),
        position: position.as_vec3(),
        right: right.as_vec3(),
        up: up.as_vec3(),
        forward: forward.as_vec3(),
        tan_half_fov: tan as f32,
        aspect: None,
    }
}

impl Scene {
    /// Index into [`Scene::cameras`] of the camera with that name or, if none has it, that number. `None` is the first.
    ///
    /// # Errors
    ///
    /// [`Error::Config`], which lists the cameras, if there is no such one.
    pub fn camera_index(&self, name_or_index: Option<&str>) -> Result<usize> {
        let Some(wanted) = name_or_index else {
            return Ok(0);
        };
        let by_name = self.cameras.iter().position(|camera| camera.name == wanted);
        let by_number = || wanted.parse().ok().filter(|&index| index < self.cameras.len());
        by_name.or_else(by_number).ok_or_else(|| {
            let cameras: Vec<String> = self
                .cameras
                .iter()
                .enumerate()
                .map(|(index, camera)| format!("{index} {}", quote(&camera.name)))
                .collect();
            Error::Config(format!(
                "no camera {}: the scene has, by number and name, {}",
                quote(wanted),
                list(&cameras)
            ))
        })
    }
}
