//! Ordering photons and gathering from them: the stages for each batch of photons.

use crate::gather::primitives::scan;
use crate::gather::{gather_stage, parts};
use crate::layout::GROUP;
use crate::record::Recording;
use crate::shaders;
use crate::sizes::{EXHAUSTIVE_RANGE, Sizes};
use crate::stage::{BufferId, StageDesc};

/// Variants of a gather that tests every photon.
#[derive(Default, Clone, Copy)]
struct Exhaustive {
    /// Stages blocks of photons through shared memory.
    local: bool,
    /// Photons are sorted by mesh; only those of the visible point's mesh are tested.
    by_mesh: bool,
    /// Visible points are ordered so that each workgroup has one mesh.
    ordered: bool,
    /// Uses the built-in distance().
    distance: bool,
}

/// Every photon.
pub fn naive(sizes: &Sizes, recording: &mut Recording) {
    Exhaustive::default().record(sizes, recording);
}

/// Every photon, by the built-in distance().
pub fn naive_distance(sizes: &Sizes, recording: &mut Recording) {
    let how = Exhaustive {
        distance: true,
        ..Exhaustive::default()
    };
    how.record(sizes, recording);
}

/// Every photon, through shared memory.
pub fn local(sizes: &Sizes, recording: &mut Recording) {
    let how = Exhaustive {
        local: true,
        ..Exhaustive::default()
    };
    how.record(sizes, recording);
}

/// The mesh's photons.
pub fn mesh(sizes: &Sizes, recording: &mut Recording) {
    let how = Exhaustive {
        by_mesh: true,
        ..Exhaustive::default()
    };
    how.record(sizes, recording);
}

/// The mesh's photons, for visible points in an order.
pub fn ordered_mesh(sizes: &Sizes, recording: &mut Recording) {
    let how = Exhaustive {
        by_mesh: true,
        ordered: true,
        ..Exhaustive::default()
    };
    how.record(sizes, recording);
}

/// The mesh's photons, for visible points in an order, through shared memory.
pub fn ordered_mesh_local(sizes: &Sizes, recording: &mut Recording) {
    let how = Exhaustive {
        by_mesh: true,
        ordered: true,
        local: true,
        distance: false,
    };
    how.record(sizes, recording);
}

/// The same by the built-in distance().
pub fn ordered_mesh_local_distance(sizes: &Sizes, recording: &mut Recording) {
    let how = Exhaustive {
        by_mesh: true,
        ordered: true,
        local: true,
        distance: true,
    };
    how.record(sizes, recording);
}

impl Exhaustive {
    fn record(self, sizes: &Sizes, recording: &mut Recording) {
        if self.by_mesh {
            sort_by_mesh(sizes, recording);
        }
        let from = if self.by_mesh {
            BufferId::SortedPhotons
        } else {
            BufferId::Photons
        };
        let shader = if self.local {
            &shaders::GATHER_LOCAL
        } else {
            &shaders::GATHER_SCAN
        };
        let groups = if self.ordered {
            sizes.order_groups()
        } else {
            sizes.slots().div_ceil(GROUP)
        };
        let stride = sizes.probe.stride;
        let groups = groups.div_ceil(stride);
        let photons = sizes.photon_capacity;
        for first in (0..photons).step_by(EXHAUSTIVE_RANGE as usize) {
            let end = first.saturating_add(EXHAUSTIVE_RANGE);
            for map in 0..sizes.photon_maps {
                let push = shaders::ExhaustivePush {
                    first,
                    end,
                    stride,
                    groups,
                    factor: dealing(groups),
                    map,
                };
                let stage = gather_stage(shader, groups * GROUP, sizes).push(push);
                let mut constants = stage.constants.to_vec();
                constants.extend([
                    ("ORDERED", u32::from(self.ordered)),
                    ("BY_MESH", u32::from(self.by_mesh)),
                    ("DISTANCE", u32::from(self.distance)),
                ]);
                recording.dispatch(stage.constants(constants).bind(vec![(BufferId::GatheredFrom, from)]));
            }
        }
    }
}

/// A factor that distributes the groups evenly over all cores: it is coprime to their number.
fn dealing(groups: u32) -> u32 {
    [31, 37, 41, 43, 47, 53]
        .into_iter()
        .find(|prime| !groups.is_multiple_of(*prime))
        .unwrap_or(1)
}

/// The paper's photon sorting: one map per mesh, filled by an atomic counter per mesh.
fn sort_by_mesh(sizes: &Sizes, recording: &mut Recording) {
    let photons = sizes.photon_capacity;
    recording.fill(BufferId::MeshEnds, 0);
    recording.dispatch(StageDesc::new(&shaders::MESH_COUNT, photons));
    scan(BufferId::MeshEnds, sizes.meshes, recording);
    recording.dispatch(StageDesc::new(&shaders::MESH_SCATTER, photons));
}

/// The cells of the objects' grids that a cluster reaches.
pub fn object_grids(sizes: &Sizes, recording: &mut Recording) {
    let (photons, cells) = (sizes.photon_capacity, sizes.object_cells);
    recording.fill(BufferId::ObjectCells, 0);
    recording.dispatch(StageDesc::new(&shaders::OBJECT_CELL_COUNT, photons));
    if let Some(maximum) = sizes.cell_photons {
        recording.dispatch(
            StageDesc::new(&shaders::OBJECT_CELL_LIMIT, cells).push(shaders::ObjectCellLimitPush { cells, maximum }),
        );
    }
    scan(BufferId::ObjectCells, cells + 1, recording);
    recording.fill(BufferId::ObjectCellCursors, 0);
    recording.dispatch(StageDesc::new(&shaders::OBJECT_CELL_SCATTER, photons));
    let groups = sizes.order_groups();
    for [first, end] in parts(sizes) {
        for map in 0..sizes.photon_maps {
            let stage = gather_stage(&shaders::GATHER_CLUSTER_GRID, groups * GROUP, sizes);
            let push = shaders::ClusterGridPush {
                first,
                end,
                groups,
                factor: dealing(groups),
                map,
            };
            recording.dispatch(stage.push(push));
        }
    }
}
