//! The table of gather methods. Command line, tests, bench and reports iterate over [`METHODS`].

use crate::config::{NAIVE_RANGE, SCAN_BLOCK, SORT_DIGIT_BITS, SORT_TILE, Sizes};
use crate::record::Recording;
use crate::shaders;
use crate::stage::{BufferId, StageDesc};

/// A way to find, for each visible point, the photons within its radius.
pub struct GatherMethod {
    /// Name on the command line.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// The paper's row that it is, or where it comes from.
    pub paper: &'static str,
    /// Records building its structure over the batch's photons, and gathering from it.
    pub record: fn(&Sizes, &mut Recording),
}

/// Every method.
pub const METHODS: &[GatherMethod] = &[
    GatherMethod {
        name: "naive",
        summary: "every visible point tests every photon",
        paper: "tables 1 to 3, «Naive solution»",
        record: naive,
    },
    GatherMethod {
        name: "grid",
        summary: "photons sorted into a hashed uniform grid whose cell size follows the mean radius",
        paper: "beyond the paper",
        record: grid,
    },
];

/// Index of the method named `name`.
pub fn method(name: &str) -> Option<usize> {
    METHODS.iter().position(|method| method.name == name)
}

/// The method that is fastest in most scenes.
pub fn default_method() -> usize {
    METHODS.len() - 1
}

/// Records the exclusive prefix sums of the first `count` numbers of `buffer`, in place. Their total goes to
/// [`BufferId::ScanTotal`].
pub fn scan(buffer: BufferId, count: u32, recording: &mut Recording) {
    let bound = [(BufferId::Scan, buffer)];
    let blocks = count.div_ceil(SCAN_BLOCK);
    let threads = blocks * shaders::SCAN_BLOCKS.workgroup;
    recording.dispatch(
        StageDesc::new(&shaders::SCAN_BLOCKS, threads)
            .push(count)
            .bind(bound.to_vec()),
    );
    recording.dispatch(StageDesc::new(&shaders::SCAN_SUMS, shaders::SCAN_SUMS.workgroup).push(blocks));
    recording.dispatch(
        StageDesc::new(&shaders::SCAN_ADD, count)
            .push(count)
            .bind(bound.to_vec()),
    );
}

/// Records a stable sort of [`BufferId::Values`] by the low `bits` bits of [`BufferId::Keys`]. `capacity` is the most
/// keys that there can be; how many there are stands in the buffer `count`.
pub fn sort(count: BufferId, capacity: u32, bits: u32, recording: &mut Recording) {
    use BufferId::{Keys, KeysIn, KeysOut, OtherKeys, OtherValues, SortCount, Values, ValuesIn, ValuesOut};
    let tiles = capacity.div_ceil(SORT_TILE);
    let mut here = (Keys, Values);
    let mut there = (OtherKeys, OtherValues);
    // An even number of passes ends where it began.
    let passes = bits.div_ceil(SORT_DIGIT_BITS).next_multiple_of(2);
    for pass in 0..passes {
        let push = [pass * SORT_DIGIT_BITS, tiles];
        let bound = vec![
            (SortCount, count),
            (KeysIn, here.0),
            (ValuesIn, here.1),
            (KeysOut, there.0),
            (ValuesOut, there.1),
        ];
        let count_threads = tiles * shaders::SORT_COUNT.workgroup;
        recording.dispatch(
            StageDesc::new(&shaders::SORT_COUNT, count_threads)
                .push(push)
                .bind(bound.clone()),
        );
        scan(BufferId::Histograms, tiles << SORT_DIGIT_BITS, recording);
        let scatter_threads = tiles * shaders::SORT_SCATTER.workgroup;
        recording.dispatch(
            StageDesc::new(&shaders::SORT_SCATTER, scatter_threads)
                .push(push)
                .bind(bound),
        );
        std::mem::swap(&mut here, &mut there);
    }
}

fn naive(sizes: &Sizes, recording: &mut Recording) {
    for first in (0..sizes.photon_capacity()).step_by(NAIVE_RANGE as usize) {
        let range = [first, first + NAIVE_RANGE];
        recording.dispatch(StageDesc::new(&shaders::GATHER_NAIVE, sizes.slots()).push(range));
    }
}

fn grid(sizes: &Sizes, recording: &mut Recording) {
    let photons = sizes.photon_capacity();
    let radius_sums = sizes.slots().div_ceil(shaders::GRID_RADII.workgroup);
    recording.dispatch(StageDesc::new(&shaders::GRID_RADII, sizes.slots()));
    recording.dispatch(StageDesc::new(&shaders::GRID_SETUP, shaders::GRID_SETUP.workgroup).push(radius_sums));
    recording.dispatch(StageDesc::new(&shaders::GRID_KEYS, photons));
    sort(BufferId::PhotonCount, photons, sizes.cell_bits, recording);
    recording.fill(BufferId::CellRanges, 0);
    recording.dispatch(StageDesc::new(&shaders::GRID_CELLS, photons));
    let part = photons.div_ceil(sizes.gather_parts);
    for first in (0..photons).step_by(part as usize) {
        recording.dispatch(StageDesc::new(&shaders::GATHER_GRID, sizes.slots()).push([first, first + part]));
    }
}
