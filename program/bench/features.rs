//! What each of the scene's features costs: the kernels as the scene needs them against kernels that know one thing more.

use std::fmt::Write as _;

use serde::Serialize;

use super::median;
use crate::backend::{Backend, DeviceDescription};
use crate::config::RenderConfig;
use crate::error::Result;
use crate::gpu::Device;
use crate::packing::PackedScene;
use crate::packing::SceneFeatures;
use crate::pipeline::Renderer;
use crate::scene::Camera;

/// Times of all sets of features.
#[derive(Debug, Clone, Serialize)]
pub struct FeatureCosts {
    /// Where.
    pub device: DeviceDescription,
    /// What the scene has.
    pub own: Vec<String>,
    /// Milliseconds of an iteration as the scene needs it.
    pub own_ms: f64,
    /// One for each feature that the scene hasn't, and one for all of them.
    pub added: Vec<AddedFeature>,
}

/// A feature that was compiled in without need.
#[derive(Debug, Clone, Serialize)]
pub struct AddedFeature {
    /// Its name.
    pub feature: String,
    /// Milliseconds of an iteration.
    pub ms: f64,
    /// The median of its iterations over the scene's own, taken in turns.
    pub ratio: f64,
}

/// Renders with each set of features in turns; `note` hears what it is doing.
///
/// # Errors
/// Whatever a render can meet.
pub fn feature_costs(
    scene: &PackedScene,
    camera: &Camera,
    device: Option<&str>,
    config: &RenderConfig,
    repeats: u32,
    note: &dyn Fn(&str),
) -> Result<FeatureCosts> {
    let own = scene.features.constants();
    let mut sets = vec![("the scene's own".to_owned(), scene.features)];
    for (index, (name, present)) in own.into_iter().enumerate() {
        let mut values = own.map(|(_, present)| present);
        values[index] = true;
        if !present {
            sets.push((SceneFeatures::spell(name), SceneFeatures::of_constants(values)));
        }
    }
    sets.push(("all".to_owned(), SceneFeatures::ALL));
    let mut renderers = Vec::new();
    for (name, features) in &sets {
        note(name);
        let scene = PackedScene {
            features: *features,
            ..scene.clone()
        };
        let mut renderer = Renderer::new(Device::open(device)?, &scene, camera, config.clone())?;
        // The first iteration compiles, and finds out how much room photons need.
        renderer.iterate()?;
        renderers.push(renderer);
    }
    let mut times = vec![Vec::new(); renderers.len()];
    for _ in 0..repeats {
        for (renderer, times) in renderers.iter_mut().zip(&mut times) {
            let run = renderer.iterate()?;
            times.push(run.launches.iter().map(|launch| launch.duration_ns * 1e-6).sum::<f64>());
        }
    }
    let added = sets.iter().zip(&times).skip(1).map(|((name, _), with)| AddedFeature {
        feature: name.clone(),
        ms: median(with.clone()),
        ratio: median(
            with.iter()
                .zip(&times[0])
                .map(|(with, without)| with / without)
                .collect(),
        ),
    });
    Ok(FeatureCosts {
        device: renderers[0].device(),
        own: scene.features.names(),
        own_ms: median(times[0].clone()),
        added: added.collect(),
    })
}

/// The costs as a table.
pub fn features_table(costs: &FeatureCosts) -> String {
    let own = if costs.own.is_empty() {
        "none: matte surfaces and lamps".to_owned()
    } else {
        costs.own.join(", ")
    };
    let mut text = format!(
        "on {} ({})\nfeatures of the scene: {own}; an iteration takes {:.2} ms\n\n{:<24} {:>10} {:>8}\n",
        costs.device.name, costs.device.driver, costs.own_ms, "compiled in as well", "ms", "ratio"
    );
    for added in &costs.added {
        // Writing to a String can't fail.
        let _ = writeln!(text, "{:<24} {:>10.2} {:>8.3}", added.feature, added.ms, added.ratio);
    }
    text
}
