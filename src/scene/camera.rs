//! Cameras, and the one that stands in where the file has none.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};
use gltf::json::camera::{Orthographic, Perspective, Type};
use gltf::json::validation::Checked;
use gltf::json::{self, Root};

use super::diagnostic::{Check, Warnings, damaged, label, list, quote, shorten};
use super::graph::{PlacedNode, node_label};
use super::{Camera, Lens, Normalisation, Projection, Scene};
use crate::error::{Error, Result};

/// Vertical angle of view of the camera that is framed on the bounds, in radians.
const FRAMED_FOV: f64 = 40.0 * PI / 180.0;

/// How far that camera looks down, in radians.
const FRAMED_PITCH: f64 = 15.0 * PI / 180.0;

/// Radius of a lens at the most, in render units, of which the scene has about one: far more than a blur that shows anything.
const LARGEST_LENS: f64 = 100.0;

/// Radius of a lens over its distance to what is in focus at the most: its rays would be nearly perpendicular to its axis.
const WIDEST_LENS: f64 = 100.0;

/// Distances of what is sharp, in render units: nothing nearer is seen, and what is farther is as sharp as what is there.
const NEAREST_FOCUS: f32 = 1e-9;
const FARTHEST_FOCUS: f32 = 1e9;

/// Free space around the bounds in its picture, as a factor of its distance.
const FRAMED_MARGIN: f64 = 1.05;

/// The cameras of the nodes, in render space.
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

/// What the camera shows, and width over height where the file gives it. Clipping planes play no part.
fn projection(camera: &json::Camera, normalisation: Normalisation) -> Check<(Projection, Option<f32>)> {
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

/// Negative magnifications, which the specification discourages, are taken by their size.
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
/// Lengths of axes are ignored. Ancestors that mirror turn the direction of view with the scene, but the picture stays
/// right-handed: that is what splitting the global transform into translation, rotation and scale gives.
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
        projection: Projection::Perspective {
            tan_half_fov: tan as f32,
        },
        aspect: None,
        lens: None,
        shift: Vec2::ZERO,
    }
}

impl Scene {
    /// A lens for a camera; radius and the distance along its direction of view of what is in focus in scene units. Without the
    /// distance the centre of the scene's bounds is in focus.
    ///
    /// # Errors
    /// [`Error::Config`], if that lies behind the camera.
    pub fn lens(&self, camera: &Camera, radius: f64, focus: Option<f64>) -> Result<Lens> {
        let scale = self.normalisation.scale;
        let (lower, upper) = self.bounds();
        let centre = 0.5 * (lower + upper);
        let focus = focus.map_or((centre - camera.position).dot(camera.forward), |focus| {
            ((focus * scale) as f32).clamp(NEAREST_FOCUS, FARTHEST_FOCUS)
        });
        if radius * scale > LARGEST_LENS {
            return Err(Error::Config(format!(
                "--aperture {radius:e}: all would be blurred to nothing; a lens has a radius of {:.3} scene units at the most here",
                LARGEST_LENS / scale
            )));
        }
        if focus > 0.0 && radius * scale > WIDEST_LENS * f64::from(focus) {
            return Err(Error::Config(format!(
                "--aperture {radius:e} with things in focus at {:e}: the lens is too wide to see anything by; make it smaller, or move \
                 the focus away by --focus",
                f64::from(focus) / scale
            )));
        }
        if focus > 0.0 && focus.is_finite() {
            Ok(Lens {
                radius: (radius * scale) as f32,
                focus,
            })
        } else {
            Err(Error::Config(
                "--aperture: the centre of the scene lies behind the camera; say what is in focus by --focus".into(),
            ))
        }
    }

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
