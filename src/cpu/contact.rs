//! Dielectrics that lie on other objects: the counterpart of `glsl/shared/contact.glsl`.

use glam::DVec3;

use super::Inputs;
use super::intersect::{Hit, Ray, nearest_hit};
use super::surface::{DIELECTRIC, Facing, GLOSSY, ROUNDINGS, Surface, surface_of};
use super::texture::{apply_textures, share_there};
use super::vector::rgb;
use crate::layout::{Material, TOUCHED};

/// Where a ray meets matter.
pub(super) struct Encounter {
    pub surface: Surface,
    pub facing: Facing,
    /// Index of refraction outside of a dielectric.
    pub outside: f64,
    /// What light keeps that passes a dielectric boundary, of both sides.
    pub tint: DVec3,
    /// Material that the ray came through.
    pub through: Option<u32>,
    /// And what lies behind a dielectric boundary.
    pub beyond: Option<u32>,
}

impl Encounter {
    /// Which of two faces in one place comes first is chance: both are crossed at once. Glass on glass is one boundary between
    /// the two; on something opaque that is what the ray meets. `medium`: the material that the ray is in, as far as its
    /// path knows.
    pub fn new(inputs: &Inputs<'_>, hit: Hit, incoming: DVec3, medium: Option<u32>) -> Self {
        let at = |hit: Hit| surface_of(inputs.scene, hit);
        let textured = |mut surface: Surface| {
            apply_textures(inputs.scene, &mut surface);
            surface
        };
        let mut surface = textured(at(hit));
        let own = Some(surface.material_index);
        let solid = surface.material.surface == DIELECTRIC && surface.material.thin == 0;
        let (through, beyond) = match (solid, Facing::new(&surface, incoming).front) {
            (false, _) => (medium, medium),
            (true, true) => (medium, own),
            (true, false) => (own, None),
        };
        let alone = |surface: Surface| Self {
            facing: Facing::new(&surface, incoming),
            outside: 1.0,
            tint: rgb(surface.material.base_color),
            through,
            beyond,
            surface,
        };
        if surface.flags & TOUCHED == 0 {
            return alone(surface);
        }
        let n = surface.geometric_normal;
        let instanced = inputs.scene.features.instanced;
        // Where an instance puts its corners is uncertain by more than their own rounding, but by no more than of the scene.
        let size = surface.reach.element_sum().max(if instanced { 1.0 } else { 0.0 });
        let probe = ROUNDINGS * size * n;
        let through = Ray {
            origin: surface.position + probe,
            direction: -2.0 * probe,
        };
        let touches = |other: &Surface| {
            let step = ROUNDINGS * n.abs().dot(if instanced { other.reach } else { surface.reach });
            other.object != surface.object && (other.position - surface.position).dot(n).abs() <= step
        };
        let other = nearest_hit(inputs, through, 1.0, Some(hit.at)).map(|hit| {
            let mut other = at(hit);
            if instanced {
                other.reach = other.reach.max(surface.reach);
            }
            other
        });
        let other = other.filter(touches);
        if let Some(other) = &other
            && instanced
        {
            surface.reach = other.reach;
        }
        match other {
            Some(other) if other.material.surface != DIELECTRIC => {
                // What isn't there everywhere is all there or not at all here.
                if share_there(inputs.scene, &other) >= 0.5 {
                    alone(textured(other))
                } else {
                    alone(surface)
                }
            }
            Some(other) if other.geometric_normal.dot(n) < 0.0 => {
                let met = alone(surface);
                let other_side = Some(other.material_index);
                Self {
                    outside: f64::from(other.material.ior),
                    tint: met.tint * rgb(other.material.base_color),
                    through: if met.facing.front { other_side } else { met.through },
                    beyond: if met.facing.front { met.beyond } else { other_side },
                    ..met
                }
            }
            _ => alone(surface),
        }
    }
}

/// What a medium leaves of light over a distance.
pub(super) fn transmittance(inputs: &Inputs<'_>, medium: Option<u32>, distance: f64) -> DVec3 {
    medium.map_or(DVec3::ONE, |material| {
        (-rgb(inputs.scene.materials[material as usize].absorption) * distance).exp()
    })
}

/// What part of a surface passes light; 1 for what is no dielectric at all.
fn clear_part(material: &Material) -> f64 {
    if material.surface == DIELECTRIC {
        f64::from(material.transmission) * (1.0 - f64::from(material.metallic))
    } else {
        1.0
    }
}

/// Whether a surface passes a part of the light only.
pub(super) fn is_mixed(material: &Material) -> bool {
    clear_part(material) < 1.0
}

/// A surface that passes a part of the light only is by chance all clear or all glossy: makes it one of them, and returns
/// whether it has a glossy part, and a uniform number.
pub(super) fn choose_part(material: &mut Material, u: f64) -> (bool, f64) {
    let t = clear_part(material);
    if t >= 1.0 {
        return (false, u);
    }
    // Of what isn't clear.
    material.metallic = (f64::from(material.metallic) / (1.0 - t)).min(1.0) as f32;
    if u < t {
        (true, u / t)
    } else {
        material.surface = GLOSSY;
        (true, (u - t) / (1.0 - t))
    }
}
