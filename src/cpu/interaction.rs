//! Surface interactions: coincident faces, textures, and media.

use glam::DVec3;

use super::Inputs;
use super::bsdf::Bsdf;
use super::dispersion::ior_at;
use super::intersect::{Hit, PlacedTriangle, Progress, Ray, nearest_hit_from};
use super::lights::{emits, emitted_radiance};
use super::media::{Media, Medium, bounded_medium, ior_of_medium};
use super::surface::{Normals, Surface, surface_of};
use super::texture::{apply_textures, is_hit, opacity};
use super::vector::rgb;
use crate::layout::{BACK_HIDDEN, BACKED, COINCIDENT, DIELECTRIC, Material, PARALLEL, ROUNDINGS, SEE_THROUGH, TOUCHED};
use crate::random::Random;

/// The faces at the point where a ray hits a surface.
struct Interface {
    /// The face that is hit, without textures.
    surface: Surface,
    /// Probability of hitting it, if faces are partly transparent.
    opacity: f64,
    /// A solid dielectric without thickness.
    is_flat: bool,
    /// Of the other dielectric boundaries.
    tint: DVec3,
    /// Media in front of the boundaries.
    through: Media,
    /// Media behind the boundaries.
    beyond: Media,
}

fn is_solid(material: &Material) -> bool {
    material.surface == DIELECTRIC && material.thin == 0
}

fn is_front(surface: &Surface, incoming: DVec3) -> bool {
    incoming.dot(surface.geometric_normal) < 0.0
}

/// Whether it is a back face that is culled for the camera.
pub(super) fn is_hidden_back(surface: &Surface, incoming: DVec3) -> bool {
    surface.material.flags & BACK_HIDDEN != 0 && incoming.dot(surface.geometric_normal) > 0.0
}

/// Priority of coincident faces that are not dielectric: the highest is hit.
fn preference(surface: &Surface, incoming: DVec3) -> (bool, bool, bool, bool, u32) {
    let front = is_front(surface, incoming);
    let material = &surface.material;
    let emitting = rgb(material.emission).max_element() > 0.0 && emits(material, front);
    let hidden = material.flags & BACK_HIDDEN != 0;
    (
        emitting,
        front,
        !hidden,
        surface.flags & SEE_THROUGH != 0,
        surface.object,
    )
}

impl Interface {
    /// `media`: those that the ray is in, as tracked by its path. With `culls`, culled back faces are ignored.
    fn new(inputs: &Inputs<'_>, hit: Hit, incoming: DVec3, media: Media, culls: bool, random: &Random) -> Self {
        let first = surface_of(inputs.scene, hit);
        let mut place = Self {
            surface: first,
            opacity: opacity(inputs.scene, &first),
            is_flat: false,
            tint: DVec3::ONE,
            through: media,
            beyond: media,
        };
        let nested = inputs.scene.features.nested;
        let bounded = |surface: &Surface| bounded_medium(inputs, media, surface, is_front(surface, incoming));
        if is_solid(&first.material) {
            place.cross(bounded(&first), is_front(&first, incoming), nested);
        }
        let backed = first.flags & BACKED != 0 && !is_front(&first, incoming);
        if first.flags & (TOUCHED | COINCIDENT) == 0 && !backed {
            return place;
        }
        let is_opaque = first.material.surface != DIELECTRIC;
        let mut preferred = is_opaque.then(|| preference(&first, incoming));
        let mut missing = None;
        let mut solid: Option<Surface> = None;
        let mut reach = first.reach;
        for (other, at) in coincident_faces(inputs, hit, &first) {
            let both = other.reach.max(first.reach);
            let n = first.geometric_normal;
            let apart = (other.position - first.position).dot(n).abs() > ROUNDINGS * n.abs().dot(both);
            let same_object = other.object == first.object;
            let doubles = same_object && other.geometric_normal.dot(n) < -PARALLEL;
            if apart || (same_object && !doubles) || (culls && is_hidden_back(&other, incoming)) {
                continue;
            }
            let preference = preference(&other, incoming);
            let opacity = opacity(inputs.scene, &other);
            if !is_hit(inputs.scene, &other, at, random) {
                // Opacities are not negative, so that their bits have the same order.
                missing = missing.max(Some((preference, opacity.to_bits())));
                continue;
            }
            reach = reach.max(both);
            if other.material.surface != DIELECTRIC {
                if Some(preference) > preferred {
                    preferred = Some(preference);
                    place.surface = other;
                    place.opacity = opacity;
                }
            } else if is_solid(&other.material) && preferred.is_none() {
                if doubles {
                    place.is_flat = true;
                } else {
                    place.cross(bounded(&other), is_front(&other, incoming), nested);
                    place.tint *= rgb(other.material.base_color);
                    if solid.is_none_or(|solid| bounded(&other) < bounded(&solid)) {
                        solid = Some(other);
                    }
                }
            }
        }
        if let Some((missing, opacity)) = missing
            && Some(missing) > preferred
        {
            place.opacity *= 1.0 - f64::from_bits(opacity);
        }
        if preferred.is_some() {
            place.is_flat = false;
            place.tint = DVec3::ONE;
        } else if place.is_flat {
            place.through = media;
            place.beyond = media;
        } else if let Some(solid) = solid {
            // The boundary belongs to the medium that counts on either side.
            let own = bounded(&first);
            let counts = is_solid(&first.material) && [place.through.first(), place.beyond.first()].contains(&own);
            if !counts {
                place.surface = solid;
                place.tint = rgb(first.material.base_color);
            }
        }
        place.surface.reach = reach;
        place
    }

    /// Updates the media as the ray crosses a boundary.
    fn cross(&mut self, medium: Medium, front: bool, nested: bool) {
        if front {
            if nested {
                self.through = self.through.without(medium, nested);
            }
            self.beyond = self.beyond.with(medium, nested);
        } else {
            self.through = self.through.with(medium, nested);
            self.beyond = self.beyond.without(medium, nested);
        }
    }
}

/// Other faces within rounding distance of a hit.
fn coincident_faces<'a>(
    inputs: &'a Inputs<'_>,
    hit: Hit,
    first: &Surface,
) -> impl Iterator<Item = (Surface, PlacedTriangle)> + use<'a> {
    // The other face may be larger, and its plane then less certain.
    let probe = ROUNDINGS * first.reach.element_sum().max(1.0) * first.geometric_normal;
    let ray = Ray {
        origin: first.position + probe,
        direction: -2.0 * probe,
    };
    let next = move |progress: &Progress| nearest_hit_from(inputs, ray, *progress, 1.0, Some(hit.at));
    let hits = std::iter::successors(next(&Progress::AT_ORIGIN), move |hit| next(&Progress::past(*hit)));
    hits.map(|hit| (surface_of(inputs.scene, hit), hit.at))
}

/// A ray's interaction with a surface.
pub struct Interaction {
    /// With textures.
    pub surface: Surface,
    /// On the side of the incoming ray.
    pub normals: Normals,
    /// Probability of hitting it, if faces are partly transparent.
    pub opacity: f64,
    /// A boundary inside a medium of lower rank: only its tint counts.
    pub hidden: bool,
    /// Refractive index on the outer side of a dielectric.
    pub outside: f64,
    /// Tint of all dielectric boundaries at the hit.
    pub tint: DVec3,
    /// Media in front of the boundaries.
    pub through: Media,
    /// Media behind the boundaries.
    pub beyond: Media,
}

impl Interaction {
    /// For a ray that hits a face while it is in `media`. With `culls`, culled back faces are ignored.
    pub fn new(inputs: &Inputs<'_>, hit: Hit, incoming: DVec3, media: Media, culls: bool, random: &Random) -> Self {
        let Interface {
            mut surface,
            opacity,
            is_flat,
            tint,
            through,
            beyond,
        } = Interface::new(inputs, hit, incoming, media, culls, random);
        apply_textures(inputs.scene, &mut surface);
        if is_flat {
            surface.material.thin = 1;
        }
        let of_front = [surface.geometric_normal, surface.shading_normal, surface.coat_normal];
        let normals = Normals::of(of_front, -incoming);
        let nests = inputs.scene.features.nested && is_solid(&surface.material);
        let outer = if normals.front { through } else { beyond };
        Self {
            normals,
            opacity,
            hidden: nests && through.first() == beyond.first(),
            outside: if nests {
                ior_of_medium(inputs, outer.first())
            } else {
                1.0
            },
            tint: tint * rgb(surface.material.base_color),
            through,
            beyond,
            surface,
        }
    }

    /// The BSDF, at a wavelength (nm) after dispersion.
    pub fn bsdf(&self, wavelength: Option<f64>) -> Bsdf {
        let mut material = self.surface.material;
        if let Some(wavelength) = wavelength.filter(|_| material.dispersion > 0.0) {
            material.ior = ior_at(&material, wavelength) as f32;
        }
        Bsdf::new(&material, self.normals, self.outside, self.tint)
    }

    /// Radiance emitted towards the ray's origin.
    pub fn emitted(&self, incoming: DVec3) -> DVec3 {
        let material = &self.surface.material;
        if emits(material, self.normals.front) {
            emitted_radiance(material, -incoming.dot(self.normals.geometric))
        } else {
            DVec3::ZERO
        }
    }
}
