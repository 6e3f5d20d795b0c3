//! Primitives of several nodes, whose triangles are stored once.

use std::collections::HashSet;
use std::ops::Range;

use glam::DAffine3;
use gltf_json::Root;

use super::facet::spans_area;
use super::geometry::Geometry;
use super::mesh_instance::MeshInstance;
use crate::scene::{Normalisation, Placement};

/// Minimum number of triangles of a shared primitive. Smaller ones take little memory, and walls made of equal parts remain
/// watertight at their joints if they are not shared.
const FEWEST: usize = 32;
/// A scene shares triangles if that saves at least one in this number: rays take an eighth longer with a transform (measured with
/// primitives of 48 to 1,000 triangles).
const ONE_SAVED_IN: usize = 4;

/// The placement of an instance whose triangles others may share.
pub(crate) fn shareable(root: &Root, instance: &MeshInstance<'_>) -> Option<DAffine3> {
    let primitive = &instance.primitive;
    let may_be = instance.is_repeated() && primitive.triangle_count() >= FEWEST && !emits(root, primitive.material);
    instance.node_alone().filter(|_| may_be)
}

/// Whether the instances have enough triangles in common for sharing to pay.
pub(crate) fn sharing_pays(root: &Root, instances: &[MeshInstance<'_>]) -> bool {
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
pub(crate) fn placed(space: Normalisation, to_world: DAffine3, world: Normalisation) -> DAffine3 {
    DAffine3 {
        matrix3: to_world.matrix3 * (world.scale / space.scale),
        translation: (to_world.transform_point3(space.centre) - world.centre) * world.scale,
    }
}

/// Whether all placed triangles have an area.
pub(crate) fn stays_whole(geometry: &Geometry, triangles: &Range<u32>, placement: Placement) -> bool {
    let mut triangles = geometry.triangles[triangles.start as usize..triangles.end as usize].iter();
    triangles.all(|triangle| {
        spans_area(
            triangle
                .vertices
                .map(|vertex| placement.point(geometry.positions[vertex as usize])),
        )
    })
}
