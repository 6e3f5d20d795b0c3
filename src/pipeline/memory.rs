//! Device memory and limits of a render, known before any memory is allocated.

use std::collections::BTreeSet;

use super::accel_on;
use super::stages::Stages;
use crate::config::{Accel, RenderConfig, Totals, TriangleTest};
use crate::error::Result;
use crate::gpu::{DeviceSummary, structure_bytes};
use crate::layout::Settings;
use crate::packing::PackedScene;
use crate::sizes::{Limits, Sizes, clustered_run};
use crate::stage::BufferId;

/// Device memory, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// For the scene.
    pub scene: u64,
    /// Share of acceleration structures in that, at most; 0 unless rays are traced by ray queries.
    pub structures: u64,
    /// For visible points, photons and the rest of a render.
    pub render: u64,
    /// Share of the caustic photon map in that; 0 if the scene has neither mirrors nor glass.
    pub caustic_map: u64,
}

impl Memory {
    /// The initial memory of a render on a device like this. Later the photon buffers are fitted to the photons, of which there
    /// are usually fewer.
    ///
    /// # Errors
    /// [`RenderConfig::accel`] is ray queries and the device has none, or it cannot be opened.
    pub fn of(scene: &PackedScene, config: &RenderConfig, device: &DeviceSummary) -> Result<Self> {
        let config = &RenderConfig {
            accel: accel_on(config, device)?,
            ..config.clone()
        };
        let sizes = Sizes::new(config, limits(device, u32::MAX, scene));
        let stages = Stages {
            config,
            sizes: &sizes,
            features: scene.features,
        };
        let recordings = [stages.shortest_iteration(), stages.picture(Totals::default())];
        let buffers: BTreeSet<_> = recordings.iter().flat_map(|recording| recording.buffers()).collect();
        let render: u64 = buffers.iter().filter_map(|&id| sizes.bytes(id)).sum();
        let of_maps = [
            BufferId::StatisticsOf,
            BufferId::GatheredOf,
            BufferId::CoverageOf,
            BufferId::Radii2,
        ];
        let caustic_map = |id: BufferId| {
            let maps = u64::from(sizes.photon_maps);
            sizes.bytes(id).unwrap_or_default() / maps * (maps - 1)
        };
        let structures = match config.accel {
            Accel::RayQuery => structure_bytes(device, scene.own_triangles, &scene.instances)?.structures,
            _ => 0,
        };
        let buffers: u64 = scene_buffers(scene, config)
            .iter()
            .map(|(_, bytes)| bytes.len() as u64)
            .sum();
        Ok(Self {
            caustic_map: of_maps.map(caustic_map).iter().sum(),
            scene: buffers + structures,
            structures,
            render: render + size_of::<Settings>() as u64,
        })
    }
}

/// Maximum number of loop iterations of a lane's photon paths together, if the driver has a limit: on that driver the invocations
/// of a subgroup share the limit, and an inner loop runs as long as the slowest invocation.
fn loop_budget(limit: u32) -> u32 {
    if limit == u32::MAX { limit } else { limit / 4 }
}

/// Maximum size of a buffer that can be allocated and bound, as words or as texels.
pub(super) fn bindable_bytes(device: &DeviceSummary) -> u64 {
    device
        .max_storage_buffer_bytes
        .min(16 * u64::from(device.max_texels))
        .min(device.max_allocation_bytes)
}

/// The parameters of a render's sizes that depend on device and scene.
pub(super) fn limits(device: &DeviceSummary, loop_limit: u32, scene: &PackedScene) -> Limits {
    Limits {
        storage_buffer_bytes: bindable_bytes(device),
        loop_limit: loop_budget(loop_limit),
        lanes: if device.kind == "cpu" { 4096 } else { 1 << 18 },
        clustered_run: clustered_run(device.kind),
        splitting: scene.features.dielectric || scene.features.glossy,
        specular: scene.features.mirror || scene.features.dielectric,
        lobes: scene.features.visible_lobes(),
        meshes: scene.object_grids.len() as u32,
        object_cells: scene.object_cells,
    }
}

/// The buffers of the scene. The hierarchy is a placeholder if rays are traced by ray queries, the paper's precomputed triangles
/// unless its triangle test is used.
pub fn scene_buffers<'a>(scene: &'a PackedScene, config: &RenderConfig) -> [(BufferId, &'a [u8]); 14] {
    let havel = match config.triangle_test {
        TriangleTest::Havel => scene.havel_triangles.len(),
        TriangleTest::Watertight => scene.havel_triangles.len().min(1),
    };
    let records = match config.accel {
        Accel::RayQuery => scene.bvh.len().min(1),
        _ => scene.bvh.len(),
    };
    [
        (BufferId::Bvh, bytemuck::cast_slice(&scene.bvh[..records])),
        (
            BufferId::HavelTriangles,
            bytemuck::cast_slice(&scene.havel_triangles[..havel]),
        ),
        (
            BufferId::ShadingTriangles,
            bytemuck::cast_slice(&scene.shading_triangles),
        ),
        (BufferId::Instances, bytemuck::cast_slice(&scene.instances)),
        (BufferId::Materials, bytemuck::cast_slice(&scene.materials)),
        (BufferId::Corners, bytemuck::cast_slice(&scene.corners)),
        (BufferId::Textures, bytemuck::cast_slice(&scene.textures)),
        (BufferId::Texels, bytemuck::cast_slice(&scene.texels)),
        (BufferId::Lights, bytemuck::cast_slice(&scene.lights)),
        (BufferId::NearLights, bytemuck::cast_slice(&scene.near_lights)),
        (BufferId::LightSources, bytemuck::cast_slice(&scene.light_sources)),
        (BufferId::MediaOfLights, bytemuck::cast_slice(&scene.media_of_lights)),
        (BufferId::Environment, bytemuck::cast_slice(&scene.environment)),
        (BufferId::ObjectGrids, bytemuck::cast_slice(&scene.object_grids)),
    ]
}
