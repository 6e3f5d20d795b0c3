//! Cameras, and the default camera for files that have none.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};

use super::Scene;
use crate::error::{Error, Result, Setting};
use crate::text::{list, quote};

/// Vertical angle of view of the default camera, which frames the bounds, in radians.
const FRAMED_FOV: f64 = 40.0 * PI / 180.0;

/// Downward pitch of the default camera, in radians.
const FRAMED_PITCH: f64 = 15.0 * PI / 180.0;

/// Maximum radius of a lens, in render units; the scene's half axis is about one unit, so a larger blur shows nothing.
const LARGEST_LENS: f64 = 100.0;

/// Maximum ratio of a lens's radius to the focus distance: beyond it, rays would be nearly perpendicular to the axis.
const WIDEST_LENS: f64 = 100.0;

/// Margin around the bounds in the default camera's picture, as a factor of its distance.
const FRAMED_MARGIN: f64 = 1.05;

/// Range of focus distances, in render units: nothing nearer is visible, and everything farther is as sharp as at the upper end.
const NEAREST_FOCUS: f32 = 1e-9;
const FARTHEST_FOCUS: f32 = 1e9;

/// A camera's projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Perspective.
    Perspective {
        /// Tangent of half the vertical angle of view.
        tan_half_fov: f32,
    },
    /// Orthographic.
    Orthographic {
        /// Half the height, in render units.
        half_height: f32,
    },
}

/// A thin lens, for depth of field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Its radius, in render units.
    pub radius: f32,
    /// Focus distance along the direction of view, in render units.
    pub focus: f32,
}

/// A camera in render space.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Centre of projection.
    pub position: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector into the picture.
    pub forward: Vec3,
    /// Its projection.
    pub projection: Projection,
    /// Width over height, if the file gives it.
    pub aspect: Option<f32>,
    /// Its lens; a pinhole has none.
    pub lens: Option<Lens>,
    /// Shift of the film to the right and up, as a fraction of its larger side.
    pub shift: Vec2,
}

/// Orthonormal right, up and forward from a direction of view and an up direction that need be neither.
pub(crate) fn frame(forward: DVec3, up: DVec3) -> Option<[DVec3; 3]> {
    let forward = forward.try_normalize()?;
    let right = forward.cross(up.try_normalize()?).try_normalize()?;
    Some([right, right.cross(forward), forward])
}

/// A camera that looks at the centre of the bounds along −Z and slightly down, at a distance from which it sees all of them in
/// any picture that is not higher than wide.
pub(crate) fn framed_on((lower, upper): (Vec3, Vec3)) -> Camera {
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
    /// A lens for a camera, with its radius and the focus distance along the direction of view, in scene units. Without a
    /// distance, the centre of the scene's bounds is in focus.
    ///
    /// # Errors
    /// [`Error::Setting`], if the point of focus lies behind the camera, or if the lens is too wide.
    pub fn lens(&self, camera: &Camera, radius: f64, focus: Option<f64>) -> Result<Lens> {
        let scale = self.normalisation.scale;
        let (lower, upper) = self.bounds();
        let centre = 0.5 * (lower + upper);
        let focus = focus.map_or((centre - camera.position).dot(camera.forward), |focus| {
            ((focus * scale) as f32).clamp(NEAREST_FOCUS, FARTHEST_FOCUS)
        });
        if radius * scale > LARGEST_LENS {
            let what = format!(
                "{radius:e}: everything would be blurred; the maximum radius of a lens is {:.3} scene units here",
                LARGEST_LENS / scale
            );
            return Err(Error::setting(Setting::Aperture, what));
        }
        if focus > 0.0 && radius * scale > WIDEST_LENS * f64::from(focus) {
            let what = format!(
                "{:e}: a lens of radius {radius:e} is too wide for that; make it smaller, or focus farther away",
                f64::from(focus) / scale
            );
            return Err(Error::setting(Setting::Focus, what));
        }
        if focus > 0.0 && focus.is_finite() {
            Ok(Lens {
                radius: (radius * scale) as f32,
                focus,
            })
        } else {
            Err(Error::setting(
                Setting::Focus,
                "on the scene's centre, which lies behind the camera; give a focus distance",
            ))
        }
    }

    /// Index into [`Scene::cameras`] of the camera with that name or, if none has it, that number. `None` is the first.
    ///
    /// # Errors
    ///
    /// [`Error::Config`], which lists the cameras, if there is no such camera.
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
