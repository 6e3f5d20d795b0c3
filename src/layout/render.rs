//! What kernels have of a render: its settings, and what they make.

use bytemuck::{Pod, Zeroable};

#[allow(unused_imports, reason = "most are linked by the documentation alone")]
use super::constants::*;
use super::shape::{FieldLayout, Layout, Shared};

device_structs! {
    /// What stays the same through a render. Lengths in render units.
    pub struct Settings: 192 {
        /// xyz: centre of projection; w: radius of the lens.
        pub camera_position: [f32; 4],
        /// xyz: to the picture's right edge, at distance 1; w: distance along the direction of view of what is in focus.
        pub camera_right: [f32; 4],
        /// xyz: to the picture's top edge, at distance 1; w: 1 where rays are parallel, else 0.
        pub camera_up: [f32; 4],
        /// xyz: into the middle of the picture, at distance 1 along the direction of view.
        pub camera_forward: [f32; 4],
        /// Pixels, width and height.
        pub resolution: [u32; 2],
        /// Visible points a pixel.
        pub slots_per_pixel: u32,
        /// The user's seed.
        pub seed: u32,
        /// Lights.
        pub light_count: u32,
        /// Instances.
        pub instance_count: u32,
        /// Bounces of a path at the most.
        pub max_depth: u32,
        /// Triangles that instances don't share. Those come first.
        pub triangle_count: u32,
        /// Invocations of the photon stage.
        pub photon_lanes: u32,
        /// Photons that each of them can store.
        pub lane_capacity: u32,
        /// Photons that a batch can store.
        pub photon_capacity: u32,
        /// log2 of the grid's buckets.
        pub cell_bits: u32,
        /// Eq. 2's α.
        pub alpha: f32,
        /// The user's R² before the first photon; 0 where it follows the footprints.
        pub initial_radius2: f32,
        /// Iterations that all loops of one invocation may make together.
        pub loop_limit: u32,
        /// Probability that direct light is sampled by a direction of the BSDF instead of a light's point, near a
        /// light.
        pub bsdf_sampling: f32,
        /// R before the first photon in footprints, of global and of caustic photons.
        pub first_footprints: [f32; 2],
        /// R at the most; 0: no bound.
        pub most_footprints: [f32; 2],
        /// 2 where caustic photons are gathered apart from the others, else 1.
        pub photon_maps: u32,
        /// Side of a pixel's footprint at distance 1 along a path, or anywhere where rays are parallel.
        pub pixel_spread: f32,
        /// What the squared radiance has beside it where what visible points want of photons is weighed.
        pub demand_floor2: f32,
        /// Spheres in which a light is near.
        pub near_light_count: u32,
        /// [`super::LightSource`]s.
        pub light_source_count: u32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
        /// Names of the media that the camera is in, the lowest first; 2³² − 1 where there are fewer.
        pub camera_media: [u32; 4],
    }

    /// The paper's hitpoint.
    pub struct VisiblePoint: 48 {
        /// Position.
        pub position: [f32; 3],
        /// Index of the object, or [`NO_OBJECT`].
        pub object: u32,
        /// Throughput × BRDF, 1/sr.
        pub weight: [f32; 3],
        /// Octahedral geometric normal on the viewer's side. Without an object: 1 if the path hit a surface, else 0.
        pub geometric_normal: u32,
        /// Emission along the path, radiance.
        pub emitted: [f32; 3],
        /// Octahedral shading normal on the viewer's side.
        pub shading_normal: u32,
    }

    /// Where a photon path starts.
    pub struct PathStart: 48 {
        /// Position.
        pub origin: [f32; 3],
        /// The triangle that it leaves, u32::MAX for none.
        pub triangle: u32,
        /// Unit vector.
        pub direction: [f32; 3],
        /// 1 over the range of a punctual light, 0 where it reaches any distance.
        pub inverse_range: f32,
        /// Not divided by the emitted paths; 0 of a path that isn't to be traced.
        pub flux: [f32; 3],
        /// The light that it leaves.
        pub light: u32,
    }

    /// A photon.
    pub struct Photon: 32 {
        /// Position.
        pub position: [f32; 3],
        /// Index of the object, and [`CAUSTIC`].
        pub object: u32,
        /// Flux, not divided by the number of emitted paths; on coated materials divided by the cosine to the geometric normal.
        pub flux: [f32; 3],
        /// Octahedral direction of propagation.
        pub direction: u32,
    }

    /// The centre of a cluster of visible points.
    pub struct Centroid: 16 {
        /// Mean position.
        pub position: [f32; 3],
        /// Index of the object, or [`NO_OBJECT`] for an empty cluster.
        pub object: u32,
    }

    /// R², N and τ of a visible point.
    pub struct Statistics: 48 {
        /// R², leading f32.
        pub radius2_high: f32,
        /// R², rest.
        pub radius2_low: f32,
        /// Photons accepted so far, low word; eq. 2's N is α times the whole.
        pub accepted_low: u32,
        /// High word.
        pub accepted_high: u32,
        /// rgb: τ, leading f32s; w: likewise of the curvature, whose share of τ tells the bias.
        pub flux_high: [f32; 4],
        /// rgb: τ, rest.
        pub flux_low: [f32; 4],
    }

    /// An iteration's photons of a visible point.
    pub struct Gathered: 32 {
        /// Σ flux.
        pub flux: [f32; 3],
        /// M.
        pub count: u32,
        /// Σ flux · distance², flux as the mean of its channels.
        pub moment: f32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
    }

    /// Radiance seen directly, summed over the iterations.
    pub struct DirectSum: 32 {
        /// rgb: leading f32s; w: what lights behind glass would have added unbent.
        pub high: [f32; 4],
        /// rgb: rest; w: iterations that asked for that.
        pub low: [f32; 4],
    }

    /// Of the discs around a visible point, how much can have photons, in sixteenths.
    pub struct Coverage: 16 {
        /// That can.
        pub covered: u32,
        /// In all.
        pub asked: u32,
        /// Iterations in which a ray from a point without photons met something that may send it some.
        pub surrounded: u32,
        /// Camera paths of the slot that met a surface; of the first photon map's alone.
        pub met: u32,
    }

    /// Of a pixel, what tells whether it has its part of the light behind glass.
    pub struct BehindGlass: 20 {
        /// Radiance that it would have of that light if the glass didn't bend it, mean of the channels.
        pub unbent: f32,
        /// Radiance that such photons gave it, likewise.
        pub arrived: f32,
        /// Their number.
        pub photons: f32,
        /// R, in pixels.
        pub radius: f32,
        /// R², render units.
        pub radius2: f32,
    }

    /// Of the radii of discs in a shell around the camera, see `glsl/gather/grid.glsl`.
    pub struct ShellRadii: 16 {
        /// Σ log2 R of a sample of them, offset, in parts of 256.
        pub logs: u32,
        /// Of that sample.
        pub count: u32,
        /// Bits of the largest R² of all.
        pub largest: u32,
        /// Zero.
        pub padding: u32,
    }

    /// The hashed grids of an iteration.
    pub struct GridShape: 64 {
        /// 1 / cell size of each photon map's shells.
        pub inverse_cell_size: [f32; 2 * SHELLS],
    }

    /// What the stages report to the host.
    pub struct StatusCounters: 56 {
        /// Most photons that one lane had to store.
        pub lane_need: u32,
        /// Most photons of a batch.
        pub batch_need: u32,
        /// Paths ended by the bounce limit.
        pub truncated_paths: u32,
        /// Paths ended by the driver's loop limit.
        pub cut_paths: u32,
        /// Values that were NaN or infinite and were left out.
        pub non_finite: u32,
        /// Retry reasons of the iteration, bits; see [`PHOTONS_DID_NOT_FIT`] and the next two.
        pub retry: u32,
        /// Photons stored, low word.
        pub photons_stored_low: u32,
        /// High word.
        pub photons_stored_high: u32,
        /// Photons beyond the maximum that a user set for a grid cell.
        pub lost_photons: u32,
        /// Grid cells that had more than that maximum.
        pub full_cells: u32,
        /// Photons that landed where visible points could be, wanted or not, low word.
        pub photons_landed_low: u32,
        /// High word.
        pub photons_landed_high: u32,
        /// Photons that the picture's visible points accepted in all iterations, low word.
        pub photons_accepted_low: u32,
        /// High word.
        pub photons_accepted_high: u32,
    }
}

/// 64 bits from two words.
fn wide(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

impl Statistics {
    /// Before the first photon, with R² in square render units; 0 where the first visible point sets it.
    pub fn of_radius2(radius2: f32) -> Self {
        Self {
            radius2_high: radius2,
            ..Self::zeroed()
        }
    }

    /// Photons accepted so far.
    pub fn accepted(&self) -> u64 {
        wide(self.accepted_low, self.accepted_high)
    }
}

impl StatusCounters {
    /// Photons stored.
    pub fn photons_stored(&self) -> u64 {
        wide(self.photons_stored_low, self.photons_stored_high)
    }

    /// Photons that landed where visible points could be, wanted or not.
    pub fn photons_landed(&self) -> u64 {
        wide(self.photons_landed_low, self.photons_landed_high)
    }

    /// Photons that the picture's visible points accepted in all iterations.
    pub fn photons_accepted(&self) -> u64 {
        wide(self.photons_accepted_low, self.photons_accepted_high)
    }
}
