//! Structs of a render: its settings and results.

use bytemuck::{Pod, Zeroable};

#[allow(unused_imports, reason = "most are linked by the documentation alone")]
use super::constants::*;
use super::shape::{FieldLayout, Layout, Shared};

device_structs! {
    /// Constants of a render. Lengths in render units.
    pub struct Settings: 464 {
        /// xyz: centre of projection; w: radius of the lens.
        pub camera_position: [f32; 4],
        /// xyz: to the picture's right edge, at distance 1; w: focal distance along the direction of view.
        pub camera_right: [f32; 4],
        /// xyz: to the picture's top edge, at distance 1; w: 1 for an orthographic camera, else 0.
        pub camera_up: [f32; 4],
        /// xyz: to the middle of the picture, at distance 1 along the direction of view.
        pub camera_forward: [f32; 4],
        /// Pixels, width and height.
        pub resolution: [u32; 2],
        /// Visible points per pixel.
        pub slots_per_pixel: u32,
        /// The user's seed.
        pub seed: u32,
        /// Number of lights.
        pub light_count: u32,
        /// Number of instances.
        pub instance_count: u32,
        /// Maximum number of bounces of a path.
        pub max_depth: u32,
        /// Number of triangles that are not shared by instances. These come first.
        pub triangle_count: u32,
        /// Invocations of the photon stage.
        pub photon_lanes: u32,
        /// Photon capacity of each of them.
        pub lane_capacity: u32,
        /// Photon capacity of a batch.
        pub photon_capacity: u32,
        /// log2 of the grid's buckets.
        pub cell_bits: u32,
        /// α of equation 2.
        pub alpha: f32,
        /// R² set by the user; 0: by the footprints.
        pub initial_radius2: f32,
        /// Maximum number of iterations of all loops of an invocation together.
        pub loop_limit: u32,
        /// Probability of a BSDF sample instead of a light sample near a light.
        pub bsdf_sampling: f32,
        /// Initial R in footprints, of global and of caustic photons.
        pub first_footprints: [f32; 2],
        /// Maximum R in footprints; 0: unbounded.
        pub most_footprints: [f32; 2],
        /// 2 with a separate map of caustic photons, else 1.
        pub photon_maps: u32,
        /// Side of a pixel's footprint at distance 1 along a path, or everywhere for an orthographic camera.
        pub pixel_spread: f32,
        /// Added to the squared radiance when demand is weighted.
        pub demand_floor2: f32,
        /// Number of spheres within which a light is near.
        pub near_light_count: u32,
        /// Number of [`super::LightSource`]s.
        pub light_source_count: u32,
        /// Pixels between neighbouring guides, see [`crate::config::GuidePixels`].
        pub guide_step: u32,
        /// GuidePixels in a row, and rows of guides; 0 if all pixels are guides.
        pub guides: [u32; 2],
        /// The first pixel that is rendered.
        pub region_origin: [u32; 2],
        /// Pixels that are rendered, width and height.
        pub region_size: [u32; 2],
        /// The media that the camera is in, sorted; 2³² − 1 in unused entries.
        pub camera_media: [u32; 4],
        /// Distances from a pixel's centre, in pixels: `PixelFilter::places`.
        pub filter_places: [[f32; 4]; FILTER_PLACES as usize / 4],
    }

    /// A visible point: the paper's hitpoint.
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

    /// The start of a photon path.
    pub struct PathStart: 48 {
        /// Position.
        pub origin: [f32; 3],
        /// The triangle that it leaves; u32::MAX for none.
        pub triangle: u32,
        /// Unit vector.
        pub direction: [f32; 3],
        /// 1 over the range of a punctual light; 0 without a range.
        pub inverse_range: f32,
        /// Not divided by the number of emitted paths; 0 for a path that is not traced.
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

    /// R², N and τ of a visible point, in pairs of f32.
    pub struct Statistics: 48 {
        /// R², leading f32.
        pub radius2_high: f32,
        /// R², rest.
        pub radius2_low: f32,
        /// Photons accepted so far, low word; N of equation 2 is α times this number.
        pub accepted_low: u32,
        /// High word.
        pub accepted_high: u32,
        /// rgb: τ, leading f32s; w: the same of the curvature, whose ratio to τ shows the bias.
        pub flux_high: [f32; 4],
        /// rgb: τ, rest.
        pub flux_low: [f32; 4],
    }

    /// Photons that a visible point gathered in an iteration.
    pub struct Gathered: 32 {
        /// Σ flux.
        pub flux: [f32; 3],
        /// M.
        pub count: u32,
        /// Σ flux · distance², with the mean of the flux's channels.
        pub moment: f32,
        /// Zero.
        pub padding0: u32,
        /// Zero.
        pub padding1: u32,
        /// Zero.
        pub padding2: u32,
    }

    /// Emission and direct light, summed over the iterations.
    pub struct DirectSum: 32 {
        /// rgb: leading f32s; w: unrefracted light of lights behind glass.
        pub high: [f32; 4],
        /// rgb: rest; w: iterations in which that was sampled.
        pub low: [f32; 4],
    }

    /// Coverage of the discs of a visible point, in sixteenths.
    pub struct Coverage: 16 {
        /// Samples that can receive photons.
        pub covered: u32,
        /// All samples.
        pub samples: u32,
        /// Iterations in which a ray from a point without photons hit a surface that may send photons to it.
        pub surrounded: u32,
        /// Camera paths of the slot that hit a surface; only in the first photon map.
        pub met: u32,
    }

    /// Statistics of a pixel that show whether its light behind glass has arrived.
    pub struct BehindGlass: 20 {
        /// Radiance of that light if the glass did not refract, mean of the channels.
        pub unbent: f32,
        /// Radiance by photons that arrived, mean of the channels.
        pub arrived: f32,
        /// Their number.
        pub photons: f32,
        /// R, in pixels.
        pub radius: f32,
        /// R², render units.
        pub radius2: f32,
    }

    /// Sums over a pixel's camera paths of what they meet.
    pub struct SurfaceSum: 48 {
        /// Of the visible points' albedo, with the tint of mirrors and glass before them.
        pub albedo: [f32; 3],
        /// Camera paths.
        pub paths: u32,
        /// Of the visible points' shading normals.
        pub normal: [f32; 3],
        /// Camera paths that met a surface.
        pub hits: u32,
        /// Not a sum: of the first surface in the pixel's centre, render space.
        pub position: [f32; 3],
        /// Its distance along the camera's axis; 0 where there is none.
        pub depth: f32,
    }

    /// How many of a pixel's camera paths met an object, or a material, first.
    pub struct IdCount: 8 {
        /// Its index.
        pub id: u32,
        /// Camera paths; 0 for an unused entry.
        pub count: u32,
    }

    /// A pixel's radiance by the way that its light takes.
    pub struct LightParts: 48 {
        /// Emission that is seen, and light that is sampled from the lights.
        pub direct: [f32; 4],
        /// By photons that have met a matte or glossy surface.
        pub indirect: [f32; 4],
        /// By photons that have met mirrors and glass alone.
        pub caustic: [f32; 4],
    }

    /// Statistics of the radii of the discs in a shell around the camera, see `glsl/gather/grid.glsl`.
    pub struct ShellRadii: 16 {
        /// Σ log2 R of a sample of discs, offset, in units of 1/256.
        pub logs: u32,
        /// Number of discs in that sample.
        pub count: u32,
        /// Bits of the largest R² of all discs.
        pub largest: u32,
        /// Zero.
        pub padding: u32,
    }

    /// The hashed grids of an iteration.
    pub struct GridShape: 64 {
        /// 1 / cell size of each photon map's shells.
        pub inverse_cell_size: [f32; 2 * SHELLS],
    }

    /// Counters that stages report to the host.
    pub struct StatusCounters: 56 {
        /// Maximum number of photons of a lane, including those beyond its capacity.
        pub lane_need: u32,
        /// Maximum number of photons of a batch.
        pub batch_need: u32,
        /// Paths ended by the bounce limit.
        pub truncated_paths: u32,
        /// Paths ended by the driver's loop limit.
        pub cut_paths: u32,
        /// NaN or infinite values that were left out.
        pub non_finite: u32,
        /// Retry reasons of the iteration, bits; see [`PHOTONS_DID_NOT_FIT`] and the next two.
        pub retry: u32,
        /// Photons stored, low word.
        pub photons_stored_low: u32,
        /// High word.
        pub photons_stored_high: u32,
        /// Photons beyond the user's maximum for a grid cell.
        pub lost_photons: u32,
        /// Grid cells beyond that maximum.
        pub full_cells: u32,
        /// Photons that landed on receivers, with or without demand, low word.
        pub photons_landed_low: u32,
        /// High word.
        pub photons_landed_high: u32,
        /// Photons accepted by visible points in all iterations, low word.
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
    /// Before the first photon, with R² in square render units; 0 if the first visible point sets it.
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

    /// Photons that landed on receivers, with or without demand.
    pub fn photons_landed(&self) -> u64 {
        wide(self.photons_landed_low, self.photons_landed_high)
    }

    /// Photons accepted by visible points in all iterations.
    pub fn photons_accepted(&self) -> u64 {
        wide(self.photons_accepted_low, self.photons_accepted_high)
    }
}
