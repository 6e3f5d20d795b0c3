//! What a render on a device has learned: saved, and gone on from.

use serde::{Deserialize, Serialize};

use super::Renderer;
use super::stages::reporting;
use crate::backend::{Backend as _, DeviceDescription, Figures};
use crate::config::Layers;
use crate::emission::Aim;
use crate::error::{Error, Remedy, Result};
use crate::random::CameraTurn;
use crate::sizes::Sizes;
use crate::stage::{BufferId, SEQUENCE_SUMS};
use crate::state::Blocks;

/// The block of what the host has.
const HOST: &str = "device render";

/// What the host has of a render.
#[derive(Serialize, Deserialize)]
struct Host {
    device: DeviceDescription,
    sizes: Sizes,
    drop_unwanted: bool,
    first_footprints: [f32; 2],
    demand_floor2: f32,
    figures: Figures,
    photon_need: [u32; 2],
    fitted: bool,
    aim: Option<Aim>,
}

/// The buffers that iterations add to.
pub(super) fn sums(layers: Layers) -> impl Iterator<Item = BufferId> {
    let of_slots = [BufferId::StatisticsOf, BufferId::DirectSums, BufferId::CoverageOf];
    let of_layers = [BufferId::SurfaceSums, BufferId::IdCounts];
    let of_layers = of_layers.into_iter().filter(move |_| layers.show_surfaces());
    of_slots.into_iter().chain(SEQUENCE_SUMS).chain(of_layers)
}

impl Renderer {
    pub(super) fn learned(&mut self) -> Result<Blocks> {
        self.complete_ahead()?;
        let host = Host {
            device: self.device(),
            sizes: self.sizes,
            drop_unwanted: self.config.drop_unwanted,
            first_footprints: self.settings.first_footprints,
            demand_floor2: self.settings.demand_floor2,
            figures: self.figures,
            photon_need: self.photon_need,
            fitted: self.fitted,
            aim: self.aim.clone(),
        };
        let mut blocks = Blocks::default();
        blocks.put(HOST, &host)?;
        for id in sums(self.config.layers) {
            blocks.put_bytes(&format!("{id:?}"), self.device.download(id, None)?);
        }
        Ok(blocks)
    }

    pub(super) fn continue_from(&mut self, learned: &Blocks) -> Result<()> {
        let host: Host = learned.get(HOST)?;
        if host.sizes.receivers() != self.sizes.receivers() {
            let what = format!("device {} can't have the state's photon maps", self.device().name);
            return Err(Error::unfit(what, Remedy::AnotherVulkanDevice));
        }
        // On another device, sizes may be too large for its limits; they change the order of sums, and so the last bits, alone.
        let sizes = if host.device == self.device() {
            host.sizes
        } else {
            self.sizes
        };
        self.sizes = Sizes {
            aimed: host.aim.is_some(),
            ..sizes
        };
        self.config.drop_unwanted = host.drop_unwanted;
        self.settings.first_footprints = host.first_footprints;
        self.settings.demand_floor2 = host.demand_floor2;
        self.figures = host.figures;
        self.photon_need = host.photon_need;
        self.fitted = host.fitted && host.device == self.device();
        self.upload_settings()?;
        if let Some(aim) = &host.aim {
            self.upload_table(aim.table())?;
        }
        self.aim = host.aim;
        self.find_last_visible_points()?;
        for id in sums(self.config.layers) {
            let bytes = self.sizes.bytes(id).unwrap_or_default();
            self.device
                .upload(id, &learned.elements::<u8>(&format!("{id:?}"), bytes as usize)?)?;
        }
        Ok(())
    }

    /// Finds the visible points of the last iteration: those of the paper's estimator are found once, and pictures tell of light
    /// behind glass by them.
    fn find_last_visible_points(&mut self) -> Result<()> {
        let Some(turn) = CameraTurn::last(&self.config, self.figures.totals) else {
            return Ok(());
        };
        self.run_until_it_fits(|stages| {
            let mut recording = reporting();
            stages.camera(turn, &mut recording);
            let (order, _) = stages.method();
            order(stages.sizes, &mut recording);
            recording
        })?;
        Ok(())
    }
}
