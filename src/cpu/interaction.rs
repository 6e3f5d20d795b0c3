//! Where a ray meets matter: which of the faces in one place, with what textures make of it, and between which media.

use glam::DVec3;

use super::Inputs;
use super::bsdf::Bsdf;
use super::dispersion::ior_at;
use super::intersect::{Hit, PlacedTriangle, Progress, Ray, nearest_hit_from};
use super::lights::{emits, emitted_radiance};
use super::media::{Media, Medium, bounded_medium, ior_of_medium};
use super::surface::{Normals, Surface, surface_of};
use super::texture::{apply_textures, is_face_there, share_there};
use super::vector::rgb;
use crate::layout::{BACK_HIDDEN, BACKED, COINCIDENT, DIELECTRIC, Material, PARALLEL, ROUNDINGS, SEE_THROUGH, TOUCHED};
use crate::random::Random;

/// What lies in the place where a ray meets matter.
struct Interface {
    /// That it meets, without its textures.
    surface: Surface,
    /// Chance of that, where something isn't there everywhere.
    share: f64,
    /// A solid dielectric without thickness.
    is_flat: bool,
    /// Of the other boundaries of dielectrics there.
    tint: DVec3,
    /// That the ray came through.
    through: Media,
    /// Behind boundaries of dielectrics.
    beyond: Media,
}

fn is_solid(material: &Material) -> bool {
    material.surface == DIELECTRIC && material.thin == 0
}

fn is_front(surface: &Surface, incoming: DVec3) -> bool {
    incoming.dot(surface.geometric_normal) < 0.0
}

/// Whether it is a back that no camera sees.
pub(super) fn is_hidden_back(surface: &Surface, incoming: DVec3) -> bool {
    surface.material.flags & BACK_HIDDEN != 0 && incoming.dot(surface.geometric_normal) > 0.0
}

/// Of faces in one place that are no dielectrics', the highest is met.
fn preference(surface: &Surface, incoming: DVec3) -> (bool, bool, bool, bool, u32) {
    let front = is_front(surface, incoming);
    let material = &surface.material;
    let shines = rgb(material.emission).max_element() > 0.0 && emits(material, front);
    let hidden = material.flags & BACK_HIDDEN != 0;
    (shines, front, !hidden, surface.flags & SEE_THROUGH != 0, surface.object)
}

impl Interface {
    /// `media`: those that the ray is in, as far as its path knows. With `culls` backs that no camera sees aren't there.
    fn new(inputs: &Inputs<'_>, hit: Hit, incoming: DVec3, media: Media, culls: bool, random: &Random) -> Self {
        let first = surface_of(inputs.scene, hit);
        let mut place = Self {
            surface: first,
            share: share_there(inputs.scene, &first),
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
        for (other, at) in others(inputs, hit, &first) {
            let both = other.reach.max(first.reach);
            let n = first.geometric_normal;
            let apart = (other.position - first.position).dot(n).abs() > ROUNDINGS * n.abs().dot(both);
            let same_object = other.object == first.object;
            let doubles = same_object && other.geometric_normal.dot(n) < -PARALLEL;
            if apart || (same_object && !doubles) || (culls && is_hidden_back(&other, incoming)) {
                continue;
            }
            let preference = preference(&other, incoming);
            let share = share_there(inputs.scene, &other);
            if !is_face_there(inputs.scene, &other, at, random) {
                // Shares aren't negative: their bits have an order.
                missing = missing.max(Some((preference, share.to_bits())));
                continue;
            }
            reach = reach.max(both);
            if other.material.surface != DIELECTRIC {
                if Some(preference) > preferred {
                    preferred = Some(preference);
                    place.surface = other;
                    place.share = share;
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
        if let Some((missing, share)) = missing
            && Some(missing) > preferred
        {
            place.share *= 1.0 - f64::from_bits(share);
        }
        if preferred.is_some() {
            place.is_flat = false;
            place.tint = DVec3::ONE;
        } else if place.is_flat {
            place.through = media;
            place.beyond = media;
        } else if let Some(solid) = solid {
            // The boundary is that of what is there on either side.
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

    /// As the ray crosses a boundary of a medium.
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

/// Faces about a hit.
fn others<'a>(
    inputs: &'a Inputs<'_>,
    hit: Hit,
    first: &Surface,
) -> impl Iterator<Item = (Surface, PlacedTriangle)> + use<'a> {
    // What lies there may be larger and so less certain.
    let probe = ROUNDINGS * first.reach.element_sum().max(1.0) * first.geometric_normal;
    let ray = Ray {
        origin: first.position + probe,
        direction: -2.0 * probe,
    };
    let next = move |progress: &Progress| nearest_hit_from(inputs, ray, *progress, 1.0, Some(hit.at));
    let hits = std::iter::successors(next(&Progress::AT_ORIGIN), move |hit| next(&Progress::past(*hit)));
    hits.map(|hit| (surface_of(inputs.scene, hit), hit.at))
}

/// Where a ray meets matter.
pub struct Interaction {
    /// With its textures.
    pub surface: Surface,
    /// On the side that the ray comes from.
    pub normals: Normals,
    /// Chance that it is met there, where something isn't there everywhere.
    pub share: f64,
    /// A boundary inside of something of lower rank: nothing but its tint counts.
    pub hidden: bool,
    /// Index of refraction outside of a dielectric.
    pub outside: f64,
    /// What light keeps that passes the boundaries of dielectrics there.
    pub tint: DVec3,
    /// That the ray came through.
    pub through: Media,
    /// Behind boundaries of dielectrics.
    pub beyond: Media,
}

impl Interaction {
    /// Of a ray that meets a face while it is in `media`. With `culls` backs that no camera sees aren't there.
    pub fn new(inputs: &Inputs<'_>, hit: Hit, incoming: DVec3, media: Media, culls: bool, random: &Random) -> Self {
        let Interface {
            mut surface,
            share,
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
            share,
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

    /// How it scatters, at a wavelength (nm) where that matters.
    pub fn bsdf(&self, wavelength: Option<f64>) -> Bsdf {
        let mut material = self.surface.material;
        if let Some(wavelength) = wavelength.filter(|_| material.dispersion > 0.0) {
            material.ior = ior_at(&material, wavelength) as f32;
        }
        Bsdf::new(&material, self.normals, self.outside, self.tint)
    }

    /// Radiance that leaves towards where the ray comes from.
    pub fn emitted(&self, incoming: DVec3) -> DVec3 {
        let material = &self.surface.material;
        if emits(material, self.normals.front) {
            emitted_radiance(material, -incoming.dot(self.normals.geometric))
        } else {
            DVec3::ZERO
        }
    }
}
