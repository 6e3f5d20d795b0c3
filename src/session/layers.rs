//! The layers of a picture's file.

use glam::{DVec3, Vec3};

use crate::backend::{LayerFilms, Resolved};
use crate::config::{Layer, Layers};
use crate::film::{Channel, Cryptomatte};
use crate::layout::{IDS_OF_PIXEL, IdCount, LightParts, SurfaceSum};
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
    /// Name of the view layer, as Blender names channels.
    pub view_layer: Option<&'a str>,
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
        for layer in self.layers.iter() {
            match layer {
                Layer::Albedo => channels.extend(self.surface_planes(layer, COLOUR, SurfaceSum::mean_albedo)),
                Layer::Normal => channels.extend(self.surface_planes(layer, VECTOR, SurfaceSum::mean_normal)),
                Layer::Position => {
                    channels.extend(self.surface_planes(layer, VECTOR, |sum| self.world_position(sum)));
                }
                Layer::Depth => {
                    let depth = self.films().surfaces.iter().map(|sum| self.world_depth(sum));
                    channels.push(self.plane(layer, depth.collect()));
                }
                Layer::Samples => {
                    let pixels = self.picture.image.pixels().len();
                    channels.push(self.plane(layer, vec![self.samples as f32; pixels]));
                }
                Layer::Direct => channels.extend(self.light_planes(layer, |parts| parts.direct)),
                Layer::Indirect => channels.extend(self.light_planes(layer, |parts| parts.indirect)),
                Layer::Caustic => channels.extend(self.light_planes(layer, |parts| parts.caustic)),
                Layer::Object | Layer::Material => {
                    let matte = Cryptomatte {
                        name: self.name(layer),
                        things: if layer == Layer::Object {
                            &self.names.objects
                        } else {
                            &self.names.materials
                        },
                    };
                    attributes.extend(matte.attributes());
                    channels.extend(matte.channels(self.shares(layer == Layer::Material)));
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
        self.view_layer
            .map_or(alone.to_owned(), |name| format!("{name}.{in_view_layer}"))
    }

    /// A layer of one channel.
    fn plane(&self, layer: Layer, samples: Vec<f32>) -> Channel {
        Channel {
            name: self.name(layer),
            samples,
        }
    }

    fn planes(&self, layer: Layer, components: [&str; 3], values: &[[f32; 3]]) -> [Channel; 3] {
        let name = self.name(layer);
        std::array::from_fn(|component| Channel {
            name: format!("{name}.{}", components[component]),
            samples: values.iter().map(|value| value[component]).collect(),
        })
    }

    fn surface_planes(
        &self,
        layer: Layer,
        components: [&str; 3],
        value: impl Fn(&SurfaceSum) -> [f32; 3],
    ) -> [Channel; 3] {
        let values: Vec<[f32; 3]> = self.films().surfaces.iter().map(value).collect();
        self.planes(layer, components, &values)
    }

    fn light_planes(&self, layer: Layer, value: impl Fn(&LightParts) -> [f32; 4]) -> [Channel; 3] {
        let values = self.films().light.iter().map(|parts| {
            let [r, g, b, _] = value(parts);
            [r, g, b]
        });
        self.planes(layer, COLOUR, &values.collect::<Vec<_>>())
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

    /// Of each pixel, indices of objects or materials, and the shares of it that they cover.
    fn shares(&self, of_materials: bool) -> impl Iterator<Item = Vec<(u32, f32)>> {
        let ids = IDS_OF_PIXEL as usize;
        let tables = self.films().ids.chunks_exact(2 * ids);
        self.films().surfaces.iter().zip(tables).map(move |(sum, table)| {
            let (objects, materials) = table.split_at(ids);
            let table = if of_materials { materials } else { objects };
            let used = table.iter().filter(|entry| entry.count > 0);
            used.map(|&IdCount { id, count }| (id, count as f32 / sum.paths.max(1) as f32))
                .collect()
        })
    }
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
