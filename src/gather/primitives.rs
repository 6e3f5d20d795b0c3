//! Prefix sums and sorting, the primitives of all orderings on the device.

use crate::layout::{SCAN_BLOCK, SORT_TILE};
use crate::record::Recording;
use crate::shaders;
use crate::sizes::SORT_DIGIT_BITS;
use crate::stage::{BufferId, StageDesc};

/// Records the exclusive prefix sums of the first `count` numbers of `buffer`, in place. Their total goes to
/// [`BufferId::ScanTotal`].
pub fn scan(buffer: BufferId, count: u32, recording: &mut Recording) {
    let bound = [(BufferId::Scan, buffer)];
    let blocks = count.div_ceil(SCAN_BLOCK);
    let threads = blocks * shaders::SCAN_BLOCKS.workgroup;
    recording.dispatch(
        StageDesc::new(&shaders::SCAN_BLOCKS, threads)
            .push(shaders::CountPush { count })
            .bind(bound.to_vec()),
    );
    let threads = blocks * shaders::SCAN_ADD.workgroup;
    recording.dispatch(
        StageDesc::new(&shaders::SCAN_ADD, threads)
            .push(shaders::CountPush { count })
            .bind(bound.to_vec()),
    );
}

/// Keys and the values that are sorted along with them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pairs {
    /// u32 each.
    pub keys: BufferId,
    /// u32 each.
    pub values: BufferId,
}

/// Keys and values of photons, and the second buffers for alternate passes.
pub const PHOTON_PAIRS: [Pairs; 2] = [
    Pairs {
        keys: BufferId::Keys,
        values: BufferId::Values,
    },
    Pairs {
        keys: BufferId::OtherKeys,
        values: BufferId::OtherValues,
    },
];

/// Keys and values of visible points, and the second buffers for alternate passes.
pub const POINT_PAIRS: [Pairs; 2] = [
    Pairs {
        keys: BufferId::PointKeys,
        values: BufferId::PointValues,
    },
    Pairs {
        keys: BufferId::OtherPointKeys,
        values: BufferId::OtherPointValues,
    },
];

/// Records a stable sort of `pairs[0]` by the low `bits` bits of the keys, back and forth between the two. `capacity` is the
/// maximum number of pairs; their actual number is in the buffer `count`. Returns the two with the sorted one first.
pub fn sort(count: BufferId, capacity: u32, bits: u32, pairs: [Pairs; 2], recording: &mut Recording) -> [Pairs; 2] {
    let tiles = capacity.div_ceil(SORT_TILE);
    let [mut here, mut there] = pairs;
    let digit_bits = bits.div_ceil(bits.div_ceil(SORT_DIGIT_BITS).max(1));
    for shift in (0..bits).step_by(digit_bits.max(1) as usize) {
        let pass_bits = digit_bits.min(bits - shift);
        let bound = vec![
            (BufferId::SortCount, count),
            (BufferId::KeysIn, here.keys),
            (BufferId::ValuesIn, here.values),
            (BufferId::KeysOut, there.keys),
            (BufferId::ValuesOut, there.values),
        ];
        for (shader, groups) in [
            (&shaders::SORT_COUNT, tiles),
            (&shaders::SORT_ROWS, 1 << pass_bits),
            (&shaders::SORT_SCATTER, tiles),
        ] {
            recording.dispatch(
                StageDesc::new(shader, groups * shader.workgroup)
                    .push(shaders::SortPush {
                        shift,
                        bits: pass_bits,
                        tiles,
                    })
                    .bind(bound.clone()),
            );
        }
        std::mem::swap(&mut here, &mut there);
    }
    [here, there]
}
