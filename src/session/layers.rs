//! The layers of a picture's file.

use glam::{DVec3, Vec3};

use crate::backend::{LayerFilms, Resolved};
use crate::config::{Layer, Layers};
use crate::film::{Channel, Cryptomatte, ViewLayer};
use crate::layout::{IDS_OF_PIXEL, IdCount, SurfaceSum};
use crate::scene::{Normalisation, Scene};

/// Depth where there is no surface, as Blender has it.
const NOWHERE: f32 = 1e10;

/// What layers tell of a scene.
#[derive(Debug, Clone, Default)]
pub struct SceneNames {
    /// Of its objects.
    pub objects: Vec<String>,
    /// Of its materials.
    pub materials: Vec<String>,
    /// From world space to render space.
    pub normalisation: Normalisation,
}

impl From<&Scene> for SceneNames {
    fn from(scene: &Scene) -> Self {
        Self {
            objects: scene.objects.iter().map(|object| object.name.clone()).collect(),
            materials: scene.materials.iter().map(|material| material.name.clone()).collect(),
            normalisation: scene.normalisation,
        }
    }
}

/// A picture's layers, for a file.
pub(super) struct LayersOf<'a> {
    pub layers: Layers,
    pub picture: &'a Resolved,
    pub names: &'a SceneNames,
    /// Camera paths of each pixel.
    pub samples: u32,
    /// How channels are named.
    pub view_layer: ViewLayer<'a>,
}

/// Names of a layer's channels by those who write them alone, and in a view layer, as Blender and Cycles do.
const fn channel_names(layer: Layer) -> (&'static str, &'static str) {
    match layer {
        Layer::Albedo => ("albedo", "Denoising Albedo"),
        Layer::Normal => ("normal", "Denoising Normal"),
        Layer::Depth => ("Z", "Depth.Z"),
        Layer::Position => ("position", "Position"),
        Layer::Object => ("CryptoObject", "CryptoObject"),
        Layer::Material => ("CryptoMaterial", "CryptoMaterial"),
        Layer::Direct => ("direct", "Direct"),
        Layer::Indirect => ("indirect", "Indirect"),
        Layer::Caustic => ("caustic", "Caustic"),
        Layer::Samples => ("samples", "Debug Sample Count.X"),
        Layer::Error => ("error", "Error"),
    }
}

const COLOUR: [&str; 3] = ["R", "G", "B"];
const VECTOR: [&str; 3] = ["X", "Y", "Z"];

impl LayersOf<'_> {
    /// Channels and attributes of the file; the error's are the file's own.
    pub fn additions(&self) -> (Vec<Channel>, Vec<(String, String)>) {
        let (mut channels, mut attributes) = (Vec::new(), Vec::new());
        let (surfaces, light) = (self.films().surfaces.iter(), self.films().light.iter());
        for layer in self.layers.iter() {
            let (surfaces, light) = (surfaces.clone(), light.clone());
            match layer {
                Layer::Albedo => channels.extend(self.planes(layer, COLOUR, surfaces.map(SurfaceSum::mean_albedo))),
                Layer::Normal => channels.extend(self.planes(layer, VECTOR, surfaces.map(SurfaceSum::mean_normal))),
                Layer::Position => {
                    channels.extend(self.planes(layer, VECTOR, surfaces.map(|sum| self.world_position(sum))));
                }
                Layer::Depth => channels.push(self.plane(layer, surfaces.map(|sum| self.world_depth(sum)).collect())),
                Layer::Samples => {
                    let pixels = self.picture.image.pixels().len();
                    channels.push(self.plane(layer, vec![self.samples as f32; pixels]));
                }
                Layer::Direct => channels.extend(self.planes(layer, COLOUR, light.map(|parts| rgb(parts.direct)))),
                Layer::Indirect => channels.extend(self.planes(layer, COLOUR, light.map(|parts| rgb(parts.indirect)))),
                Layer::Caustic => channels.extend(self.planes(layer, COLOUR, light.map(|parts| rgb(parts.caustic)))),
                Layer::Object | Layer::Material => {
                    let (things, table) = match layer {
                        Layer::Object => (&self.names.objects, 0),
                        _ => (&self.names.materials, 1),
                    };
                    let name = self.name(layer);
                    let matte = Cryptomatte { name, things };
                    attributes.extend(matte.attributes());
                    channels.extend(matte.channels(self.shares(table)));
                }
                Layer::Error => {}
            }
        }
        (channels, attributes)
    }

    fn films(&self) -> &LayerFilms {
        &self.picture.layers
    }

    fn name(&self, layer: Layer) -> String {
        let (alone, in_view_layer) = channel_names(layer);
        self.view_layer.name(alone, in_view_layer)
    }

    /// A layer of one channel.
    fn plane(&self, layer: Layer, samples: Vec<f32>) -> Channel {
        Channel {
            name: self.name(layer),
            samples,
        }
    }

    /// A layer of three channels.
    fn planes(&self, layer: Layer, components: [&str; 3], values: impl Iterator<Item = [f32; 3]>) -> [Channel; 3] {
        let name = self.name(layer);
        let values: Vec<[f32; 3]> = values.collect();
        std::array::from_fn(|component| Channel {
            name: format!("{name}.{}", components[component]),
            samples: values.iter().map(|value| value[component]).collect(),
        })
    }

    /// World units; the origin where there is no surface.
    fn world_position(&self, sum: &SurfaceSum) -> [f32; 3] {
        if sum.depth == 0.0 {
            return [0.0; 3];
        }
        let Normalisation { centre, scale } = self.names.normalisation;
        let position: DVec3 = Vec3::from(sum.position).as_dvec3() / scale + centre;
        position.as_vec3().into()
    }

    fn world_depth(&self, sum: &SurfaceSum) -> f32 {
        if sum.depth == 0.0 {
            return NOWHERE;
        }
        (f64::from(sum.depth) / self.names.normalisation.scale) as f32
    }

    /// Of each pixel, indices in one of its tables, objects or materials, and the shares of it that they cover.
    fn shares(&self, table: usize) -> impl Iterator<Item = Vec<(u32, f32)>> {
        let tables = self.films().ids.chunks_exact(IDS_OF_PIXEL as usize);
        let tables = tables.skip(table).step_by(2);
        self.films().surfaces.iter().zip(tables).map(|(sum, table)| {
            let used = table.iter().filter(|entry| entry.count > 0);
            used.map(|&IdCount { id, count }| (id, count as f32 / sum.paths.max(1) as f32))
                .collect()
        })
    }
}

fn rgb([r, g, b, _]: [f32; 4]) -> [f32; 3] {
    [r, g, b]
}

impl SurfaceSum {
    fn mean(&self, sum: [f32; 3]) -> [f32; 3] {
        sum.map(|value| value / self.paths.max(1) as f32)
    }

    pub(super) fn mean_albedo(&self) -> [f32; 3] {
        self.mean(self.albedo)
    }

    pub(super) fn mean_normal(&self) -> [f32; 3] {
        self.mean(self.normal)
    }
}
