//! Buffer sizes and group counts, and the numbers that determine them.

use serde::{Deserialize, Serialize};

use std::ops::Range;

use crate::config::{EmissionChoice, Estimator, GuidePixels, Layers, Region, RenderConfig};
use crate::layout::{
    BehindGlass, Centroid, Coverage, DEMAND_BITS, DirectSum, EmissionCell, GROUP, Gathered, GridShape, IDS_OF_PIXEL,
    IdCount, LightParts, PathStart, Photon, SCAN_BLOCK, SHELLS, SORT_TILE, ShellRadii, Statistics, StatusCounters,
    SurfaceSum, VisibleLobes, VisiblePoint, packed_bsdf_texels,
};
use crate::stage::{BufferId, SEQUENCE_FILMS, SEQUENCE_SUMS};

/// Maximum number of visible points of a pixel, if they are found once: glass splits the path while a slot is free.
pub const PPM_SLOTS: u32 = 8;
/// Maximum number of target spheres of photon paths.
pub const MOST_TARGETS: u32 = 32;
/// Maximum number of cells of the emission table.
pub const MOST_EMISSION_CELLS: u32 = 4096;
/// Number of photons in one launch of a gather that tests every photon, below the loop limit of all known drivers.
pub const EXHAUSTIVE_RANGE: u32 = 16_000;
/// Rounds of Lloyd's algorithm for the k-means clusters.
pub const LLOYD_ROUNDS: u32 = 4;
/// Visible points per invocation of `gather_clustered.comp` on a CPU, a divisor of a tile's.
const RUN_ON_CPU: u32 = 8;

/// Visible points per invocation of `gather_clustered.comp` on a device of this kind.
pub fn clustered_run(kind: &str) -> u32 {
    if kind == "cpu" { RUN_ON_CPU } else { 1 }
}

/// Approximate number of radii in the mean of a grid: their sum has to fit a u32.
const RADIUS_SAMPLES: u32 = 1 << 16;
/// Maximum number of bits of a digit of the radix sort.
pub const SORT_DIGIT_BITS: u32 = 8;

/// The head, the spheres, the cells.
const EMISSION_TABLE_BYTES: usize =
    16 * (1 + MOST_TARGETS as usize) + MOST_EMISSION_CELLS as usize * size_of::<EmissionCell>();

/// Sizes of a render's buffers, in elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sizes {
    /// The pixels that are rendered.
    pub region: Region,
    /// The guides, which are rendered in addition.
    pub guides: GuidePixels,
    /// Slots for all of these, the guides behind the others.
    pub pixel_slots: u32,
    /// Visible points a pixel.
    pub slots_per_pixel: u32,
    /// Photon paths of a batch.
    pub batch_paths: u32,
    /// Invocations of the photon stage.
    pub photon_lanes: u32,
    /// Photons that one of them can store.
    pub lane_capacity: u32,
    /// Photons that a batch can store.
    pub photon_capacity: u32,
    /// log2 of the grid's buckets.
    pub cell_bits: u32,
    /// Number of launches of a gather, among which photons are distributed: 1 unless the driver cuts loops.
    pub gather_parts: u32,
    /// Visible points that an invocation of `gather_clustered.comp` has.
    pub clustered_run: u32,
    /// The scene's objects.
    pub meshes: u32,
    /// Cells of all objects' grids.
    pub object_cells: u32,
    /// 2 if caustic photons have a map of their own, otherwise 1.
    pub photon_maps: u32,
    /// Lobes of visible points.
    pub lobes: VisibleLobes,
    /// Maximum number of photons of such a cell.
    pub cell_photons: Option<u32>,
    /// Whether photon paths are aimed.
    pub aimed: bool,
    /// Layers of the picture.
    pub layers: Layers,
    /// Options of benches for gathers.
    pub probe: Probe,
}

/// Options of benches for gathers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Probe {
    /// Gathers that test every photon process every stride-th workgroup of visible points.
    pub stride: u32,
    /// Whether the photons tested are counted.
    pub count_tests: bool,
}

impl Default for Probe {
    fn default() -> Self {
        Self {
            stride: 1,
            count_tests: false,
        }
    }
}

/// The limits of a device and properties of a scene that determine the sizes.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Bytes that one storage buffer binding can span.
    pub storage_buffer_bytes: u64,
    /// Loop iterations that an invocation may make.
    pub loop_limit: u32,
    /// Invocations that keep the device busy.
    pub lanes: u32,
    /// Visible points that an invocation of `gather_clustered.comp` has.
    pub clustered_run: u32,
    /// Whether the scene has surfaces at which a path splits in two.
    pub splitting: bool,
    /// Whether it has mirrors or glass.
    pub specular: bool,
    /// Of its visible points.
    pub lobes: VisibleLobes,
    /// The scene's objects.
    pub meshes: u32,
    /// Cells of all objects' grids.
    pub object_cells: u32,
}

/// A quarter more, with a margin.
fn with_room(need: u32) -> u32 {
    need.saturating_add(need / 4 + 64)
}

/// Expected number of photons per path; if there are more, the buffers grow.
const EXPECTED_PHOTONS: f64 = 5.0;

impl Sizes {
    /// The sizes for a render.
    pub fn new(config: &RenderConfig, limits: Limits) -> Self {
        let (region, guides) = (config.region(), config.guides());
        let pixel_slots = region.slots() + guides.slots();
        let fitting = limits.storage_buffer_bytes / size_of::<VisiblePoint>() as u64 / u64::from(pixel_slots);
        let slots_per_pixel = match config.estimator {
            Estimator::Ppm if limits.splitting => PPM_SLOTS.min(fitting.max(1) as u32),
            _ => 1,
        };
        let fit = |maps: u64, slots: u32| {
            maps * size_of::<Statistics>() as u64 * u64::from(slots) <= limits.storage_buffer_bytes
        };
        // A crop has as many as the whole, if that can be rendered at once.
        let whole = Region::whole(config.resolution).slots() + guides.slots();
        let fits_two_maps = fit(2, pixel_slots) && (fit(2, whole) || !fit(1, whole));
        let photons_at_most = (limits.storage_buffer_bytes / size_of::<Photon>() as u64) as u32;
        let batch_paths = config
            .photons
            .min((f64::from(photons_at_most) / (2.0 * EXPECTED_PHOTONS)) as u32)
            .max(1);
        let mut sizes = Self {
            region,
            guides,
            pixel_slots,
            slots_per_pixel,
            batch_paths,
            photon_lanes: 0,
            lane_capacity: 0,
            photon_capacity: 0,
            gather_parts: 1,
            clustered_run: limits.clustered_run,
            cell_bits: (batch_paths.ilog2() + 3).clamp(12, 24),
            meshes: limits.meshes,
            object_cells: limits.object_cells,
            // One photon map for the paper's estimator, and if the device can't bind two for this picture.
            photon_maps: match config.estimator {
                Estimator::Sppm if limits.specular && fits_two_maps => 2,
                _ => 1,
            },
            lobes: limits.lobes,
            aimed: config.emission == EmissionChoice::Aimed,
            layers: config.layers,
            cell_photons: config.cell_photons,
            probe: Probe::default(),
        };
        sizes.set_lanes(limits.lanes);
        sizes.shrink_batch(&limits);
        sizes
    }

    /// Distributes the paths over about `lanes` invocations.
    pub fn set_lanes(&mut self, lanes: u32) {
        self.photon_lanes = self.batch_paths.min(lanes.next_multiple_of(64));
        let paths = f64::from(self.paths_per_lane());
        // Mean and a few standard deviations of a sum of geometrically distributed lengths.
        self.lane_capacity = (EXPECTED_PHOTONS * (paths + 3.0 * paths.sqrt())).ceil() as u32;
        self.photon_capacity = self.lane_photons();
    }

    /// Fits the photon buffers to the measured need of a batch, with a margin: kernels have an invocation for each element.
    pub fn fit(&mut self, lane_need: u32, batch_need: u32) {
        self.lane_capacity = self.lane_capacity.min(lane_need + lane_need / 2 + 8);
        self.photon_capacity = with_room(batch_need).min(self.lane_photons());
    }

    /// Enlarges the buffers for photons that did not fit.
    pub fn grow(&mut self, lane_need: u32, batch_need: u32) {
        if lane_need > self.lane_capacity {
            self.lane_capacity = lane_need.saturating_add(lane_need / 4 + 1);
        }
        if batch_need > self.photon_capacity {
            self.photon_capacity = with_room(batch_need);
        }
    }

    /// Reduces the paths of a batch until its photons fit into one buffer.
    pub fn shrink_batch(&mut self, limits: &Limits) {
        let bytes =
            |sizes: &Self| u64::from(sizes.photon_lanes) * u64::from(sizes.lane_capacity) * size_of::<Photon>() as u64;
        while bytes(self) > limits.storage_buffer_bytes && self.batch_paths > 1 {
            let paths = self.paths_per_lane();
            let capacity = self.lane_capacity;
            self.batch_paths = self.batch_paths.div_ceil(2);
            self.photon_lanes = self.batch_paths.div_ceil(paths);
            self.lane_capacity = capacity;
        }
        self.photon_capacity = self.photon_capacity.min(self.lane_photons());
    }

    /// Maximum number of photon paths of a lane.
    pub fn paths_per_lane(&self) -> u32 {
        self.batch_paths.div_ceil(self.photon_lanes)
    }

    /// Size of the buffer `id` in bytes; `None` for buffers of the scene.
    pub fn bytes(&self, id: BufferId) -> Option<u64> {
        let pixels = self.region.pixels();
        let guides = u64::from(self.guides.slots());
        let slots = u64::from(self.slots());
        let receivers = u64::from(self.receivers());
        let photons = u64::from(self.photon_capacity);
        let lanes = u64::from(self.photon_lanes);
        let tiles = photons.max(slots).div_ceil(u64::from(SORT_TILE));
        // One more element per digit than tiles.
        let histograms = (tiles + 1) << SORT_DIGIT_BITS;
        let cells = (1u64 << self.cell_bits) + 1;
        let (meshes, object_cells) = (u64::from(self.meshes), u64::from(self.object_cells) + 1);
        let runs = u64::from(self.runs());
        let scanned = [lanes, cells, meshes, object_cells, runs];
        let scan_blocks = scanned.map(|count| count.div_ceil(u64::from(SCAN_BLOCK)));
        let (count, size) = match id {
            BufferId::VisiblePoints => (slots, size_of::<VisiblePoint>()),
            BufferId::PackedBsdfs => ((slots * packed_bsdf_texels(self.lobes)).max(1), 16),
            BufferId::EmissionTable if self.aimed => (1, EMISSION_TABLE_BYTES),
            BufferId::EmissionTable => (1, 16),
            BufferId::PathStarts => (u64::from(self.batch_paths), size_of::<PathStart>()),
            BufferId::PathValues => (if self.aimed { u64::from(self.batch_paths) } else { 1 }, 4),
            BufferId::StatisticsOf => (receivers, size_of::<Statistics>()),
            BufferId::GatheredOf => (receivers, size_of::<Gathered>()),
            BufferId::DirectSums => (slots, size_of::<DirectSum>()),
            id if SEQUENCE_SUMS.contains(&id) => (slots, 16),
            BufferId::CoverageOf => (receivers, size_of::<Coverage>()),
            BufferId::TestsOf => (if self.probe.count_tests { receivers } else { 1 }, 4),
            BufferId::Footprints => (slots, 4),
            BufferId::Demand => (1 << DEMAND_BITS, 4),
            // Whole texels of four.
            BufferId::Radii2 => (receivers, 4),
            BufferId::RadiiOfShells => (2 * SHELLS as u64, size_of::<ShellRadii>()),
            BufferId::Film => (pixels + guides, 16),
            id if SEQUENCE_FILMS.contains(&id) => (pixels, 16),
            BufferId::GlassFilm => (pixels, size_of::<BehindGlass>()),
            BufferId::LightPartsFilm => (
                if self.layers.show_light() { pixels } else { 1 },
                size_of::<LightParts>(),
            ),
            BufferId::SurfaceSums => (pixels, size_of::<SurfaceSum>()),
            BufferId::IdCounts => (2 * u64::from(IDS_OF_PIXEL) * pixels, size_of::<IdCount>()),
            BufferId::Status => (1, size_of::<StatusCounters>()),
            BufferId::Grid => (1, size_of::<GridShape>()),
            BufferId::PhotonCount | BufferId::PointCount | BufferId::ScanTotal => (1, 4),
            BufferId::LanePhotons => (u64::from(self.lane_photons()), size_of::<Photon>()),
            BufferId::Photons | BufferId::SortedPhotons => (photons, size_of::<Photon>()),
            BufferId::LaneCounts | BufferId::LaneOffsets => (lanes, 4),
            BufferId::Keys | BufferId::Values | BufferId::OtherKeys | BufferId::OtherValues => (photons, 4),
            BufferId::PointKeys | BufferId::PointValues | BufferId::OtherPointKeys | BufferId::OtherPointValues => {
                (slots, 4)
            }
            BufferId::Histograms => (histograms, 4),
            BufferId::ScanSums => (scan_blocks.into_iter().max().unwrap_or(1), 4),
            // Whole texels of four.
            BufferId::CellStarts => (cells.next_multiple_of(4), 4),
            BufferId::MeshEnds | BufferId::MeshFillers => (meshes, 4),
            BufferId::ObjectCells | BufferId::ObjectCellCursors => (object_cells, 4),
            BufferId::MeshOrder | BufferId::ClusterOf => (runs * u64::from(GROUP), 4),
            BufferId::PointOrder => (u64::from(self.order_groups()) * u64::from(GROUP), 4),
            BufferId::Centroids => (runs, size_of::<Centroid>()),
            BufferId::ClusterSizes | BufferId::ClusterStarts => (runs, 4),
            _ => return None,
        };
        Some(count * size as u64)
    }

    /// Maximum number of workgroups of visible points of one mesh each.
    pub fn runs(&self) -> u32 {
        // The last workgroup of each mesh may be nearly empty.
        self.slots().div_ceil(GROUP) + self.meshes.min(self.slots())
    }

    /// Maximum number of workgroups of visible points of one cluster each.
    pub fn order_groups(&self) -> u32 {
        self.slots().div_ceil(GROUP) + self.runs()
    }

    /// Visible points.
    pub fn slots(&self) -> u32 {
        self.pixel_slots * self.slots_per_pixel
    }

    /// Receivers of photons: each slot for each photon map.
    pub fn receivers(&self) -> u32 {
        self.slots() * self.photon_maps
    }

    /// Step between the receivers whose radii are averaged for a grid: odd, so that it includes all slots of a pixel. GuidePixels
    /// that are rendered in addition are few.
    pub fn radius_step(&self) -> u32 {
        if self.guides.slots() > 0 {
            return 1;
        }
        (self.receivers() / RADIUS_SAMPLES) | 1
    }

    /// The slots from which is learned what all share.
    pub fn guide_slots(&self) -> Range<usize> {
        let first = if self.guides.slots() > 0 {
            self.region.slots()
        } else {
            0
        };
        (first * self.slots_per_pixel) as usize..self.slots() as usize
    }

    /// Number of photons that all lanes can store.
    pub fn lane_photons(&self) -> u32 {
        self.photon_lanes.saturating_mul(self.lane_capacity)
    }

    /// Photon paths of a pilot round, for iterations of `paths`.
    pub fn pilot_paths(&self, paths: u32) -> u32 {
        paths.div_ceil(4).min(self.batch_paths)
    }

    /// Batches of an iteration of `paths` photon paths.
    pub fn batches(&self, paths: u32) -> u32 {
        paths.div_ceil(self.batch_paths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photon_buffers_stay_within_what_a_device_binds() {
        for (photons, storage_buffer_bytes, lanes) in [
            (300_000, 128 << 20, 1 << 18),
            (10_000_000, 2 << 30, 1 << 18),
            (10_000_000, 128 << 20, 4096),
            (1, 1 << 20, 1 << 18),
        ] {
            let config = RenderConfig {
                photons,
                ..RenderConfig::default()
            };
            let limits = Limits {
                storage_buffer_bytes,
                loop_limit: u32::MAX,
                lanes,
                clustered_run: 1,
                splitting: false,
                specular: false,
                lobes: VisibleLobes::default(),
                meshes: 5,
                object_cells: 500,
            };
            let sizes = Sizes::new(&config, limits);
            for id in [BufferId::LanePhotons, BufferId::Photons, BufferId::SortedPhotons] {
                let bytes = sizes.bytes(id).expect("a size");
                assert!(
                    bytes <= storage_buffer_bytes,
                    "{photons} paths, {lanes} lanes: {id:?} has {bytes} bytes of {storage_buffer_bytes}"
                );
            }
            assert!(sizes.batches(photons) * sizes.batch_paths >= photons);
        }
    }
}
