//! The map from world space to render space.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::DVec3;
use gltf_json::Root;

use super::facet::face_normal;
use super::mesh_instance::MeshInstance;
use crate::loader::diagnostic::Check;
use crate::scene::Normalisation;

/// Derives render space from the bounds of all triangles with an area.
pub(crate) fn normalise(root: &Root, instances: &[MeshInstance<'_>]) -> Check<Normalisation> {
    let mut lower = DVec3::INFINITY;
    let mut upper = DVec3::NEG_INFINITY;
    let mut repeated = HashMap::new();
    for instance in instances {
        let mut extend = |positions: [DVec3; 3]| {
            let is_inside = |corner: DVec3| corner.cmpge(lower).all() && corner.cmple(upper).all();
            if !positions.iter().all(|&corner| is_inside(corner)) && face_normal(positions).is_some() {
                for corner in positions {
                    lower = lower.min(corner);
                    upper = upper.max(corner);
                }
            }
        };
        let at_label = |what| format!("{}: {what}", instance.label(root));
        let triangles = 0..instance.primitive.triangle_count();
        let Some(to_world) = instance.node_alone().filter(|_| instance.is_repeated()) else {
            for triangle in triangles {
                extend(instance.triangle(triangle).map_err(at_label)?.positions);
            }
            continue;
        };
        // Read once for any number of nodes.
        let unplaced: &mut Vec<[DVec3; 3]> = match repeated.entry(instance.key()) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                let unplaced = instance.unplaced();
                let read = triangles.map(|triangle| Ok(unplaced.triangle(triangle)?.positions));
                entry.insert(read.collect::<Check<_>>().map_err(at_label)?)
            }
        };
        for (triangle, positions) in unplaced.iter().enumerate() {
            let positions = positions.map(|corner| to_world.transform_point3(corner));
            if positions.iter().all(|corner| corner.is_finite()) {
                extend(positions);
            } else {
                instance.triangle(triangle).map_err(at_label)?;
            }
        }
    }
    if lower.x > upper.x {
        let reason = match instances {
            [] => "the nodes of its scene show no mesh with triangles",
            _ => "all its triangles have zero area",
        };
        return Err(format!("no triangles: {reason}; there is nothing to render"));
    }
    // Halves first: the sum of two large coordinates may overflow where their mean doesn't.
    let centre = 0.5 * lower + 0.5 * upper;
    let scale = (0.5 * upper - 0.5 * lower).max_element().recip();
    if !scale.is_finite() || scale == 0.0 {
        return Err("its extent is out of floating-point range; correct the scales of its nodes".into());
    }
    Ok(Normalisation { centre, scale })
}
