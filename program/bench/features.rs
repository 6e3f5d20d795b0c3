//! The cost of features: kernels specialised for the scene against kernels with one more feature compiled in.

use std::fmt::Write as _;

use serde::Serialize;

use super::median;
use ppm_vk::internals::packing::{PackedScene, SceneFeatures};
use ppm_vk::{Camera, DeviceDescription, Platform, PreparedScene, RenderConfig, Result, Session};

/// Times of all sets of features.
#[derive(Debug, Clone, Serialize)]
pub struct FeatureCosts {
    /// The device.
    pub device: DeviceDescription,
    /// Features of the scene.
    pub own: Vec<String>,
    /// Milliseconds of an iteration with the scene's features.
    pub own_ms: f64,
    /// One for each feature that the scene does not have, and one for all of them.
    pub added: Vec<AddedFeature>,
}

/// A feature that was compiled in unnecessarily.
#[derive(Debug, Clone, Serialize)]
pub struct AddedFeature {
    /// Its name.
    pub feature: String,
    /// Milliseconds of an iteration.
    pub ms: f64,
    /// The median ratio of its iterations to those with the scene's features, interleaved.
    pub ratio: f64,
}

/// Renders with each set of features, interleaved; `note` gets progress messages.
///
/// # Errors
/// Errors of a render.
pub fn feature_costs(
    scene: &PreparedScene,
    camera: &Camera,
    platform: &Platform,
    config: &RenderConfig,
    repeats: u32,
    note: &dyn Fn(&str),
) -> Result<FeatureCosts> {
    let packed = scene.packed();
    let own = packed.features.constants();
    let mut sets = vec![("the scene's own".to_owned(), packed.features)];
    for (index, (name, present)) in own.into_iter().enumerate() {
        let mut values = own.map(|(_, present)| present);
        values[index] = true;
        if !present {
            sets.push((SceneFeatures::spell(name), SceneFeatures::of_constants(values)));
        }
    }
    sets.push(("all".to_owned(), SceneFeatures::ALL));
    let mut sessions = Vec::new();
    for (name, features) in &sets {
        note(name);
        let scene = scene.with(PackedScene {
            features: *features,
            ..packed.clone()
        });
        let mut session = Session::new(&scene, camera, config, platform)?;
        // The first iteration compiles, and measures the size of photon buffers.
        session.iterate(&|| false)?;
        sessions.push(session);
    }
    let mut times = vec![Vec::new(); sessions.len()];
    for _ in 0..repeats {
        for (session, times) in sessions.iter_mut().zip(&mut times) {
            let run = session.iterate(&|| false)?.unwrap_or_default();
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
        device: sessions[0].device(),
        own: scene.features(),
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
