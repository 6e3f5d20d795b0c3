//! The solid dielectrics that a ray is in: `glsl/trace/media.glsl` in f64.

use glam::DVec3;

use super::Inputs;
use super::surface::Surface;
use super::vector::rgb;
use crate::layout::{Material, RANK, VACUUM};

/// A medium: its object's rank and its material. [`VACUUM`] is the highest.
pub(super) type Medium = u32;

/// The media that a ray is in, sorted. Where several overlap, the first one counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Media([Medium; 4]);

impl Media {
    pub const VACUUM: Self = Self([VACUUM; 4]);

    /// From sorted names.
    pub fn of(names: [Medium; 4]) -> Self {
        Self(names)
    }

    /// The medium that counts.
    pub fn first(&self) -> Medium {
        self.0[0]
    }

    /// After entering a medium. Without overlapping media it is the only one.
    pub fn with(self, medium: Medium, nested: bool) -> Self {
        if !nested {
            return Self([medium, VACUUM, VACUUM, VACUUM]);
        }
        let [a, b, c, d] = self.without(medium, nested).0;
        let mut all = [a, b, c, d, medium];
        all.sort_unstable();
        Self([all[0], all[1], all[2], all[3]])
    }

    /// After leaving a medium.
    pub fn without(self, medium: Medium, nested: bool) -> Self {
        if !nested {
            return Self::VACUUM;
        }
        let mut media = self.0.map(|other| if other == medium { VACUUM } else { other });
        media.sort_unstable();
        Self(media)
    }
}

/// The medium that a face bounds for a ray in `media`. At the back face of a medium that the ray is not in (a wall that is a
/// separate object), the most similar medium.
pub(super) fn bounded_medium(inputs: &Inputs<'_>, media: Media, surface: &Surface, front: bool) -> Medium {
    let medium = (surface.flags >> RANK << RANK) | surface.material_index;
    let is_in = !inputs.scene.features.nested || media.0.contains(&medium);
    if front || is_in {
        return medium;
    }
    let unlike = |other: &Medium| {
        if other & !(u32::MAX << RANK) == surface.material_index {
            -1.0
        } else {
            (ior_of_medium(inputs, *other) - ior_of_medium(inputs, medium)).abs()
        }
    };
    let others = media.0.into_iter().filter(|other| *other != VACUUM);
    others.min_by(|a, b| unlike(a).total_cmp(&unlike(b))).unwrap_or(medium)
}

fn material_of_medium<'a>(inputs: &Inputs<'a>, medium: Medium) -> Option<&'a Material> {
    let index = (medium & !(u32::MAX << RANK)) as usize;
    (medium != VACUUM).then(|| &inputs.scene.materials[index])
}

/// Refractive index.
pub(super) fn ior_of_medium(inputs: &Inputs<'_>, medium: Medium) -> f64 {
    material_of_medium(inputs, medium).map_or(1.0, |material| material.ior.into())
}

/// Transmittance of a medium over a distance.
pub(super) fn transmittance(inputs: &Inputs<'_>, media: Media, distance: f64) -> DVec3 {
    material_of_medium(inputs, media.first())
        .map_or(DVec3::ONE, |material| (-rgb(material.absorption) * distance).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_of_what_a_ray_is_in_is_there_whatever_the_order() {
        let media = Media::VACUUM.with(3, true).with(1, true).with(2, true);
        assert_eq!(media.first(), 1);
        assert_eq!(media, Media::VACUUM.with(2, true).with(3, true).with(1, true));
        assert_eq!(media.without(1, true).first(), 2);
        assert_eq!(media.without(2, true).first(), 1);
        assert_eq!(media.without(4, true), media, "it isn't in that");
        assert_eq!(media.with(2, true), media, "at most once");
        assert_eq!(media.without(1, true).without(2, true).without(3, true), Media::VACUUM);
        let full = media.with(4, true);
        assert_eq!(full.with(5, true), full, "the highest is forgotten");
        assert_eq!(full.with(0, true).first(), 0);
    }
}
