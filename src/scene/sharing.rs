//! Primitives that several nodes show, whose triangles are stored once.

use std::collections::HashSet;
use std::ops::Range;

use glam::DAffine3;
use gltf::json::Root;

use super::builder::{Builder, Geometry};
use super::diagnostic::Check;
use super::facet::spans_area;
use super::geometry::normalise;
use super::instance::Instance;
use super::{Normalisation, Placement};

/// Triangles of a primitive that is worth sharing. Fewer hardly take memory, and walls made of equal parts stay watertight
/// where those meet.
const FEWEST: usize = 32;
/// A scene shares triangles if it saves one in so many: rays take an eighth longer where they pass a transform (measured with
/// primitives of 48 to 1,000 triangles).
const ONE_SAVED_IN: usize = 4;

/// The triangles of a shared primitive.
pub(super) struct Shared {
    /// From the mesh's space to the triangles'.
    space: Normalisation,
    /// In [`Geometry::triangles`].
    triangles: Range<u32>,
    /// Triangles of zero area that were dropped.
    dropped: usize,
}

/// What of an instance is shared.
pub(super) struct Placed {
    pub triangles: Range<u32>,
    pub placement: Placement,
    pub dropped: usize,
}

impl Builder {
    /// Puts the shared triangles of an instance's primitive where its node has them; `None` where it has to have triangles of
    /// its own: those that emit are lights, skins and morph targets give every node other ones, and of what is nearly flat or
    /// hardly there rounding would leave nothing.
    pub(super) fn share(&mut self, root: &Root, instance: &Instance<'_>) -> Check<Option<Placed>> {
        let Some(to_world) = shareable(root, instance).filter(|_| self.shares) else {
            return Ok(None);
        };
        let unplaced = instance.unplaced();
        let known = self.shared.get(&instance.key());
        let space = match known.map_or_else(
            || normalise(root, std::slice::from_ref(&unplaced)),
            |shared| Ok(shared.space),
        ) {
            Ok(space) => space,
            Err(_) => return Ok(None),
        };
        let Some(placement) = Placement::new(placed(space, to_world, self.geometry.normalisation)) else {
            return Ok(None);
        };
        if known.is_none() {
            let first = self.geometry.triangles.len() as u32;
            let dropped = self.add_triangles(&unplaced, space, super::SHARED)?;
            let shared = Shared {
                space,
                triangles: first..self.geometry.triangles.len() as u32,
                dropped,
            };
            self.shared.insert(instance.key(), shared);
        }
        let Shared { triangles, dropped, .. } = &self.shared[&instance.key()];
        let is_whole = !triangles.is_empty() && stays_whole(&self.geometry, triangles, placement);
        Ok(is_whole.then(|| Placed {
            triangles: triangles.clone(),
            placement,
            dropped: *dropped,
        }))
    }
}

/// Where an instance is whose triangles others may share.
fn shareable(root: &Root, instance: &Instance<'_>) -> Option<DAffine3> {
    let primitive = &instance.primitive;
    let may_be = instance.is_repeated() && primitive.triangle_count() >= FEWEST && !emits(root, primitive.material);
    instance.node_alone().filter(|_| may_be)
}

/// Whether the instances have so many triangles in common that sharing them is worth its price.
pub(super) fn is_worth_it(root: &Root, instances: &[Instance<'_>]) -> bool {
    let (mut all, mut saved) = (0, 0);
    let mut known = HashSet::new();
    for instance in instances {
        let triangles = instance.primitive.triangle_count();
        all += triangles;
        if shareable(root, instance).is_some() && !known.insert(instance.key()) {
            saved += triangles;
        }
    }
    saved > 0 && saved * ONE_SAVED_IN >= all
}

/// Whether triangles of the material may be lights.
fn emits(root: &Root, material: usize) -> bool {
    let material = root.materials.get(material);
    material.is_some_and(|material| material.emissive_factor.0 != [0.0; 3])
}

/// From a primitive's own space to render space.
fn placed(space: Normalisation, to_world: DAffine3, world: Normalisation) -> DAffine3 {
    DAffine3 {
        matrix3: to_world.matrix3 * (world.scale / space.scale),
        translation: (to_world.transform_point3(space.centre) - world.centre) * world.scale,
    }
}

/// Whether all triangles have an area where they are put.
fn stays_whole(geometry: &Geometry, triangles: &Range<u32>, placement: Placement) -> bool {
    let mut triangles = geometry.triangles[triangles.start as usize..triangles.end as usize].iter();
    triangles.all(|triangle| {
        spans_area(
            triangle
                .vertices
                .map(|vertex| placement.point(geometry.positions[vertex as usize])),
        )
    })
}
