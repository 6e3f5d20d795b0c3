//! The table of gather methods. Command line, tests, bench and reports iterate over [`METHODS`].

mod clustered;
mod ladder;
mod primitives;

pub use clustered::grid_sizes;
pub use primitives::{PHOTON_PAIRS, POINT_PAIRS, Pairs, scan, sort};

use self::ladder::{photons, points};
use crate::layout::{GROUP, VISIBLE_LOBES};
use crate::record::Recording;
use crate::sizes::Sizes;
use crate::stage::{Shader, StageDesc};

/// Records stages for buffers of these sizes.
pub type Record = fn(&Sizes, &mut Recording);

/// A way to find, for each visible point, the photons within its radius.
pub struct GatherMethod {
    /// Name on the command line.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// The row of the paper's table, or its origin.
    pub paper: &'static str,
    /// Its implementation.
    pub runs: Runs,
}

/// The implementation of a gather method.
#[derive(Clone, Copy)]
pub enum Runs {
    /// Stages of a Vulkan device.
    Device {
        /// Ordering visible points, when they are new.
        order: Record,
        /// Ordering a batch's photons, and gathering them.
        gather: Record,
        /// How many photons a visible point tests.
        tests: Tests,
        /// Number of visible points that share the load of a photon.
        sharing: fn(&Sizes) -> u32,
    },
    /// A kd-tree on the CPU.
    CpuKdTree,
    /// Testing each photon on the CPU.
    CpuNaive,
}

/// How many photons a visible point tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tests {
    /// All photons, or all on its mesh.
    All,
    /// Nearby photons.
    Near,
}

impl GatherMethod {
    /// Whether it runs on a device and tests nearby photons only.
    pub fn looks_nearby(&self) -> bool {
        matches!(self.runs, Runs::Device { tests: Tests::Near, .. })
    }

    /// The stages that it runs; `None` if it runs on the CPU.
    pub fn stages(&self) -> Option<(Record, Record)> {
        match self.runs {
            Runs::Device { order, gather, .. } => Some((order, gather)),
            Runs::CpuKdTree | Runs::CpuNaive => None,
        }
    }
}

fn alone(_: &Sizes) -> u32 {
    1
}

fn by_group(_: &Sizes) -> u32 {
    GROUP
}

const fn device(order: Record, gather: Record, tests: Tests, sharing: fn(&Sizes) -> u32) -> Runs {
    Runs::Device {
        order,
        gather,
        tests,
        sharing,
    }
}

/// Every method, in the order of the paper's ladder.
pub const METHODS: &[GatherMethod] = &[
    GatherMethod {
        name: "naive",
        summary: "every visible point tests every photon",
        paper: "tables 1 to 3, «Naive solution»",
        runs: device(points::by_slot, photons::naive, Tests::All, alone),
    },
    GatherMethod {
        name: "naive-distance",
        summary: "the same by the built-in distance() instead of a squared distance",
        paper: "section 8, distance() against manual calculation",
        runs: device(points::by_slot, photons::naive_distance, Tests::All, alone),
    },
    GatherMethod {
        name: "local",
        summary: "blocks of photons staged through shared memory",
        paper: "table 3, «Local memory»",
        runs: device(points::by_slot, photons::local, Tests::All, by_group),
    },
    GatherMethod {
        name: "photon-sort",
        summary: "photons sorted by mesh with atomic counters; a visible point tests its mesh's",
        paper: "table 3, «Photon sorting»",
        runs: device(points::by_slot, photons::mesh, Tests::All, alone),
    },
    GatherMethod {
        name: "hitpoint-sort",
        summary: "visible points sorted by mesh too, with fillers so that no workgroup spans two",
        paper: "table 3, «Hitpoint sorting»",
        runs: device(points::by_mesh, photons::ordered_mesh, Tests::All, alone),
    },
    GatherMethod {
        name: "hitpoint-sort-local-distance",
        summary: "the same through shared memory, by the built-in distance()",
        paper: "table 3, «Hitpoint sorting, local memory»",
        runs: device(
            points::by_mesh,
            photons::ordered_mesh_local_distance,
            Tests::All,
            by_group,
        ),
    },
    GatherMethod {
        name: "hitpoint-sort-local",
        summary: "the same through shared memory, by a squared distance",
        paper: "section 8, 125 ms and 1 941 ms",
        runs: device(points::by_mesh, photons::ordered_mesh_local, Tests::All, by_group),
    },
    GatherMethod {
        name: "cluster",
        summary: "visible points in k-means clusters within their mesh, with fillers; shared memory",
        paper: "table 4, «Hitpoint sorting, local memory» (33 % fillers)",
        runs: device(points::by_cluster, photons::ordered_mesh_local, Tests::All, by_group),
    },
    GatherMethod {
        name: "cluster-grid",
        summary: "the clusters, and a grid for each object whose cells are sorted with atomic counters",
        paper: "table 4, «Grid structure»",
        runs: device(points::by_cluster, photons::object_grids, Tests::Near, alone),
    },
    GatherMethod {
        name: "clustered",
        summary: "runs of neighbouring visible points share photons that they load from rows of a hashed grid",
        paper: "beyond the paper",
        runs: device(points::by_slot, clustered::hashed_grid, Tests::Near, |sizes| {
            sizes.clustered_run
        }),
    },
    GatherMethod {
        name: "cpu-kdtree",
        summary: "a kd-tree on the CPU, all threads",
        paper: "tables 1 and 2, column «CPU»",
        runs: Runs::CpuKdTree,
    },
    GatherMethod {
        name: "cpu-naive",
        summary: "every visible point tests every photon on the CPU, all threads",
        paper: "section 6, 68 seconds",
        runs: Runs::CpuNaive,
    },
];

/// Index of the method named `name`.
pub fn method(name: &str) -> Option<usize> {
    METHODS.iter().position(|method| method.name == name)
}

/// The method that is fastest on a Vulkan device.
pub fn default_method() -> usize {
    let is_default = |method: &GatherMethod| method.name == "clustered";
    METHODS.iter().position(is_default).unwrap_or_default()
}

/// The method that is fastest on the CPU.
pub fn default_cpu_method() -> usize {
    let is_default = |method: &GatherMethod| matches!(method.runs, Runs::CpuKdTree);
    METHODS.iter().position(is_default).unwrap_or_default()
}

/// Whether this stage gathers, rather than preparing it.
pub fn is_gather_stage(stage: &str) -> bool {
    stage.starts_with("gather_")
}

fn gather_stage(shader: &'static Shader, threads: u32, sizes: &Sizes) -> StageDesc {
    let mut constants = vec![("COUNT_TESTS", u32::from(sizes.probe.count_tests))];
    constants.extend(VISIBLE_LOBES.into_iter().zip(sizes.lobes.map(u32::from)));
    StageDesc::new(shader, threads).constants(constants)
}

/// First and end of the photons of each launch of a gather: one launch, unless the driver cuts loops.
fn parts(sizes: &Sizes) -> impl Iterator<Item = [u32; 2]> {
    let part = sizes.photon_capacity.div_ceil(sizes.gather_parts).max(1);
    let firsts = (0..sizes.photon_capacity).step_by(part as usize);
    firsts.map(move |first| [first, first.saturating_add(part)])
}
