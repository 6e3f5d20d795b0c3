//! What a render on the CPU has learned: saved, and gone on from.

use serde::{Deserialize, Serialize};

use super::Renderer;
use crate::backend::Figures;
use crate::cpu::slots::{Pixel, Slot};
use crate::error::Result;
use crate::random::CameraTurn;
use crate::state::Blocks;

/// The only block.
const RENDER: &str = "cpu render";

#[derive(Serialize, Deserialize)]
struct Learned {
    first_footprints: [f32; 2],
    figures: Figures,
    pixels: Vec<Pixel>,
    slots: Vec<Slot>,
}

impl Renderer {
    pub(super) fn learned(&self) -> Result<Blocks> {
        let learned = Learned {
            first_footprints: self.settings.first_footprints,
            figures: self.figures,
            pixels: self.pixels.clone(),
            slots: self.slots.clone(),
        };
        let mut blocks = Blocks::default();
        blocks.put(RENDER, &learned)?;
        Ok(blocks)
    }

    pub(super) fn continue_from(&mut self, learned: &Blocks) -> Result<()> {
        let learned: Learned = learned.get(RENDER)?;
        self.settings.first_footprints = learned.first_footprints;
        self.figures = learned.figures;
        self.pixels = learned.pixels;
        self.slots = learned.slots;
        if let Some(turn) = CameraTurn::last(&self.config, self.figures.totals) {
            self.paths = self.trace_camera_paths(turn);
        }
        Ok(())
    }
}
