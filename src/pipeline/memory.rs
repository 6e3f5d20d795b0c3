//! What a render takes of a device: how much memory, known before any of it is taken, and within which limits.

use std::collections::BTreeSet;

use super::stages::Stages;
use crate::config::{RenderConfig, Totals, TriangleTest};
use crate::gpu::DeviceSummary;
use crate::layout::Settings;
use crate::packing::PackedScene;
use crate::sizes::{Limits, Sizes, clustered_run};
use crate::stage::BufferId;

/// Bytes of a device's memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// For the scene.
    pub scene: u64,
    /// For visible points, photons and the rest of a render.
    pub render: u64,
    /// Of that, what a map of caustic photons takes; 0 where the scene has neither mirrors nor glass.
    pub caustic_map: u64,
}

impl Memory {
    /// What a render on a device like this begins with. Later the photons' buffers are fitted to the photons that there
    /// are, which are fewer as a rule.
    pub fn of(scene: &PackedScene, config: &RenderConfig, device: &DeviceSummary) -> Self {
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
        Self {
            caustic_map: of_maps.map(caustic_map).iter().sum(),
            scene: scene_buffers(scene, config.triangle_test)
                .iter()
                .map(|(_, bytes)| bytes.len() as u64)
                .sum(),
            render: render + size_of::<Settings>() as u64,
        }
    }
}

/// Loop iterations that photon paths of a lane may make together where the driver has a limit: a subgroup's lanes share
/// it on the driver that has one, and an inner loop runs as long as its slowest lane.
fn loop_budget(limit: u32) -> u32 {
    if limit == u32::MAX { limit } else { limit / 4 }
}

/// Bytes that a buffer can have and a stage can see of it, as words or as texels.
pub(super) fn bindable_bytes(device: &DeviceSummary) -> u64 {
    device
        .max_storage_buffer_bytes
        .min(16 * u64::from(device.max_texels))
        .min(device.max_allocation_bytes)
}

/// What the sizes of a render of a scene depend on.
pub(super) fn limits(device: &DeviceSummary, loop_limit: u32, scene: &PackedScene) -> Limits {
    Limits {
        storage_buffer_bytes: bindable_bytes(device),
        loop_limit: loop_budget(loop_limit),
        lanes: if device.kind == "cpu" { 4096 } else { 1 << 18 },
        clustered_run: clustered_run(device.kind),
        splitting: scene.features.dielectric || scene.features.glossy,
        specular: scene.features.mirror || scene.features.dielectric,
        glossy: scene.features.glossy,
        meshes: scene.object_grids.len() as u32,
        object_cells: scene.object_cells,
    }
}

/// The buffers that hold the scene, of which the paper's triangles are only there to be bound where no ray is tested with them.
pub(super) fn scene_buffers(scene: &PackedScene, test: TriangleTest) -> [(BufferId, &[u8]); 14] {
    let havel = match test {
        TriangleTest::Havel => scene.havel_triangles.len(),
        TriangleTest::Watertight => scene.havel_triangles.len().min(1),
    };
    [
        (BufferId::Bvh, bytemuck::cast_slice(&scene.bvh)),
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
