//! Layers of a picture: what its file has beside the colours.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{Choice, choices};

choices! {
    /// A layer of a picture.
    pub enum Layer {
        /// Reflectance of the first matte or glossy surface, also behind glass and mirrors.
        Albedo => "albedo",
        /// Shading normal of that surface.
        Normal => "normal",
        /// Distance of the first surface along the camera's axis.
        Depth => "depth",
        /// Position of the first surface.
        Position => "position",
        /// Cryptomatte of objects.
        Object => "object",
        /// Cryptomatte of materials.
        Material => "material",
        /// Emission that is seen, and light that is sampled from the lights.
        Direct => "direct",
        /// Light by photons that have met a matte or glossy surface.
        Indirect => "indirect",
        /// Light by photons that have met mirrors and glass alone.
        Caustic => "caustic",
        /// Camera paths of each pixel.
        Samples => "samples",
        /// Estimated error of each pixel.
        Error => "error",
    }
}

impl Layer {
    /// Whether a renderer on a device alone has it.
    pub fn needs_device(self) -> bool {
        !matches!(self, Self::Samples | Self::Error)
    }
}

/// Layers of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Layers {
    bits: u16,
}

impl Layers {
    /// No layers.
    pub const NONE: Self = Self { bits: 0 };

    /// The same and another one.
    #[must_use]
    pub const fn with(self, layer: Layer) -> Self {
        Self {
            bits: self.bits | 1 << layer as u16,
        }
    }

    /// Whether this is one of them.
    pub const fn has(self, layer: Layer) -> bool {
        self.bits & 1 << layer as u16 != 0
    }

    /// Each of them.
    pub fn iter(self) -> impl Iterator<Item = Layer> {
        Layer::ALL.iter().copied().filter(move |&layer| self.has(layer))
    }

    /// Whether some show the surfaces that camera paths meet.
    pub fn show_surfaces(self) -> bool {
        use Layer::{Albedo, Depth, Material, Normal, Object, Position};
        [Albedo, Normal, Depth, Position, Object, Material]
            .into_iter()
            .any(|layer| self.has(layer))
    }

    /// Whether some show a part of the light.
    pub fn show_light(self) -> bool {
        [Layer::Direct, Layer::Indirect, Layer::Caustic]
            .into_iter()
            .any(|layer| self.has(layer))
    }
}

impl fmt::Display for Layers {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.iter().map(Layer::name).collect();
        text.write_str(if names.is_empty() { "none" } else { "" })?;
        text.write_str(&names.join(","))
    }
}

impl FromIterator<Layer> for Layers {
    fn from_iter<T: IntoIterator<Item = Layer>>(layers: T) -> Self {
        layers.into_iter().fold(Self::NONE, Self::with)
    }
}
