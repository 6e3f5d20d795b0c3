//! Ordering visible points: the stages for new visible points.

use crate::gather::primitives::{POINT_PAIRS, scan, sort};
use crate::layout::{CURVE_BITS, GROUP, NO_SLOT};
use crate::record::Recording;
use crate::shaders;
use crate::sizes::{LLOYD_ROUNDS, Sizes};
use crate::stage::{BufferId, StageDesc};

/// The order of the slots.
pub fn by_slot(_: &Sizes, _: &mut Recording) {}

/// By mesh, with fillers so that no workgroup spans two.
pub fn by_mesh(sizes: &Sizes, recording: &mut Recording) {
    sort_by_mesh(sizes, false, BufferId::PointOrder, recording);
}

/// In k-means clusters within their mesh, with fillers so that no workgroup spans two.
pub fn by_cluster(sizes: &Sizes, recording: &mut Recording) {
    sort_by_mesh(sizes, true, BufferId::MeshOrder, recording);
    let runs = sizes.runs();
    let push = shaders::ClustersPush { runs };
    recording.dispatch(StageDesc::new(&shaders::CLUSTER_SEEDS, runs).push(push));
    for _ in 0..LLOYD_ROUNDS {
        recording.dispatch(StageDesc::new(&shaders::CLUSTER_ASSIGN, runs * GROUP).push(push));
        recording.dispatch(StageDesc::new(&shaders::CLUSTER_MEANS, runs).push(push));
    }
    scan(BufferId::ClusterStarts, runs, recording);
    recording.fill(BufferId::PointOrder, NO_SLOT);
    recording.dispatch(StageDesc::new(&shaders::CLUSTER_PLACE, runs).push(push));
}

/// Sorts the points by mesh, optionally along a curve within each, and writes them with fillers to `order`.
fn sort_by_mesh(sizes: &Sizes, along_curve: bool, order: BufferId, recording: &mut Recording) {
    let (slots, meshes) = (sizes.slots(), sizes.meshes);
    let mut pairs = POINT_PAIRS;
    if along_curve {
        recording.dispatch(StageDesc::new(&shaders::POINT_CURVE, slots));
        pairs = sort(BufferId::PointCount, slots, CURVE_BITS, pairs, recording);
    }
    recording.fill(BufferId::MeshFillers, 0);
    recording.dispatch(
        StageDesc::new(&shaders::POINT_MESH, slots)
            .push(shaders::MeshesPush { meshes })
            .constants(vec![("PRESORTED", u32::from(along_curve))])
            .bind(vec![
                (BufferId::KeysOut, pairs[0].keys),
                (BufferId::ValuesOut, pairs[0].values),
            ]),
    );
    // Keys go up to the number of meshes.
    let bits = u32::BITS - meshes.leading_zeros();
    let [sorted, _] = sort(BufferId::PointCount, slots, bits, pairs, recording);
    recording.dispatch(
        StageDesc::new(&shaders::MESH_FILLERS, meshes).push(shaders::MeshFillersPush { meshes, group: GROUP }),
    );
    scan(BufferId::MeshFillers, meshes, recording);
    recording.fill(order, NO_SLOT);
    recording.dispatch(
        StageDesc::new(&shaders::POINT_PLACE, slots)
            .push(shaders::MeshesPush { meshes })
            .bind(vec![
                (BufferId::KeysIn, sorted.keys),
                (BufferId::ValuesIn, sorted.values),
                (BufferId::OrderOut, order),
            ]),
    );
}
