//! A scene that moves from iteration to iteration.

use super::Renderer;
use super::fitting::build_structures;
use super::memory::scene_buffers;
use crate::backend::settings;
use crate::config::Accel;
use crate::emission::aims_alike;
use crate::error::Result;
use crate::layout::Settings;
use crate::packing::{IN_VACUUM, PackedScene};
use crate::scene::Camera;
use crate::stage::BufferId;

impl Renderer {
    /// Shows a scene at another time, in the same render space: the next iterations are of that. `first`: the scene by which photon
    /// paths were aimed; `before`: the scene that is on the device.
    ///
    /// # Errors
    /// A device without enough memory, or a failed Vulkan call.
    pub fn pose(
        &mut self,
        first: &PackedScene,
        before: &PackedScene,
        scene: &PackedScene,
        camera: &Camera,
    ) -> Result<()> {
        self.complete_ahead()?;
        let buffers = scene_buffers(scene, &self.config);
        let mut has_moved = false;
        for ((id, bytes), (_, old)) in buffers.into_iter().zip(scene_buffers(before, &self.config)) {
            if bytes != old {
                self.device.upload(id, bytes)?;
                has_moved |= [BufferId::ShadingTriangles, BufferId::Instances].contains(&id);
            }
        }
        if self.config.accel == Accel::RayQuery && has_moved {
            build_structures(&mut self.device, scene)?;
        }
        let new = settings(&self.config, scene, camera, self.settings.loop_limit);
        self.settings = Settings {
            first_footprints: self.settings.first_footprints,
            demand_floor2: self.settings.demand_floor2,
            ..new
        };
        self.features = self.features.with(scene.features);
        self.features.immersed |= self.settings.camera_media != IN_VACUUM;
        if self.aim.is_some() && !aims_alike(first, scene) {
            self.aim = None;
            self.sizes.aimed = false;
        }
        self.upload_settings()
    }
}
