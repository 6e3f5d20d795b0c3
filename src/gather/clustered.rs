//! The default gather: runs of neighbouring visible points search hashed grids.

use super::primitives::{PHOTON_PAIRS, scan, sort};
use super::{gather_stage, parts};
use crate::record::Recording;
use crate::shaders;
use crate::sizes::Sizes;
use crate::stage::{BufferId, StageDesc};

/// Cell sizes of the hashed grids, from the radii.
pub fn grid_sizes(sizes: &Sizes, recording: &mut Recording) {
    recording.fill(BufferId::RadiiOfShells, 0);
    recording.dispatch(
        StageDesc::new(&shaders::GRID_RADII, sizes.receivers()).push(shaders::GridRadiiPush {
            step: sizes.radius_step(),
        }),
    );
    recording.dispatch(StageDesc::new(&shaders::GRID_SETUP, shaders::GRID_SETUP.workgroup));
}

/// The cells of hashed grids that a few neighbouring visible points reach.
pub fn hashed_grid(sizes: &Sizes, recording: &mut Recording) {
    let photons = sizes.photon_capacity;
    recording.fill(BufferId::CellStarts, 0);
    recording.dispatch(StageDesc::new(&shaders::GRID_KEYS, photons));
    scan(BufferId::CellStarts, (1 << sizes.cell_bits) + 1, recording);
    let [sorted, _] = sort(BufferId::PhotonCount, photons, sizes.cell_bits, PHOTON_PAIRS, recording);
    let values = vec![(BufferId::ValuesIn, sorted.values)];
    recording.dispatch(StageDesc::new(&shaders::GRID_PHOTONS, photons).bind(values));
    let runs = sizes.receivers().div_ceil(sizes.clustered_run);
    for [first, end] in parts(sizes) {
        recording.dispatch(
            gather_stage(&shaders::GATHER_CLUSTERED, runs, sizes)
                .constant("RUN", sizes.clustered_run)
                .push(shaders::GatherClusteredPush { first, end }),
        );
    }
}
