//! The commands that list things. Each returns its text.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use serde_json::json;

use ppm_vk::internals::gather::{METHODS, default_method};
use ppm_vk::internals::scene::Surface;
use ppm_vk::internals::text::escaped;
use ppm_vk::{Memory, PreparedScene, RenderConfig, Scene, best_device};

use super::advice;
use super::progress::{BUILDING, while_showing};
use super::scene::SceneArguments;

/// `ppm-vk devices`.
pub fn devices(as_json: bool) -> Result<String> {
    let devices = ppm_vk::devices()?;
    if as_json {
        return Ok(serde_json::to_string_pretty(&devices)? + "\n");
    }
    let mut text = String::new();
    for device in devices {
        writeln!(text, "{}: {} ({})", device.index, escaped(&device.name), device.kind)?;
        writeln!(
            text,
            "   driver           {}, Vulkan {}",
            escaped(&device.driver),
            device.api_version
        )?;
        writeln!(text, "   timestamps       {} ns", device.timestamp_period_ns)?;
        writeln!(text, "   subgroup         {}", device.subgroup_size)?;
        writeln!(text, "   shared memory    {} KiB", device.max_shared_memory_bytes >> 10)?;
        writeln!(
            text,
            "   storage buffer   {} MiB",
            device.max_storage_buffer_bytes >> 20
        )?;
        if device.lacks.is_empty() {
            writeln!(text, "   runs             everything")?;
        } else {
            writeln!(
                text,
                "   runs             nothing: it lacks {}",
                device.lacks.join(", ")
            )?;
        }
    }
    Ok(text)
}

/// `ppm-vk gathers`.
pub fn gathers() -> Result<String> {
    let mut text = String::new();
    for (index, method) in METHODS.iter().enumerate() {
        let default = if index == default_method() { " (default)" } else { "" };
        let backend = if method.stages().is_none() {
            " (--backend cpu)"
        } else {
            ""
        };
        writeln!(text, "{:<20} {}{backend}{default}", method.name, method.summary)?;
        writeln!(text, "{:<20} {}", "", method.paper)?;
    }
    Ok(text)
}

/// `ppm-vk inspect`.
pub fn inspect(path: &Path, read: &SceneArguments, as_json: bool) -> Result<String> {
    let scene = read.load(path, false)?;
    let prepared = while_showing(BUILDING, false, || PreparedScene::new(&scene))?;
    let memory = memory(&scene, &prepared);
    let packed = prepared.packed();
    let count = |is: fn(&Surface) -> bool| scene.materials.iter().filter(|material| is(&material.surface)).count();
    let emissive = scene.emissive_triangle_count();
    let of_scene = scene.notes.iter().map(advice::of_remark);
    let notes: Vec<String> = of_scene.chain(prepared.notes().iter().cloned()).collect();
    let warnings: Vec<String> = scene.warnings.iter().map(advice::of_remark).collect();
    let to_world = |p: glam::Vec3| p.as_dvec3() / scene.normalisation.scale + scene.normalisation.centre;
    let (low, high) = scene.bounds();
    let (low, high) = (to_world(low), to_world(high));
    if as_json {
        let value = json!({
            "triangles": packed.seen_triangles(),
            "stored_triangles": packed.shading_triangles.len(),
            "dropped_triangles": scene.dropped_triangles,
            "objects": scene.objects.len(),
            "instances": packed.instances.len(),
            "shared_primitives": packed.shared_primitives(),
            "materials": {
                "matte": count(|s| matches!(s, Surface::Matte)),
                "mirror": count(|s| matches!(s, Surface::Mirror)),
                "dielectric": count(|s| matches!(s, Surface::Dielectric(_))),
                "glossy": count(|s| matches!(s, Surface::Glossy(_))),
            },
            "emissive_triangles": emissive,
            "punctual_lights": scene.lights.len(),
            "environment": scene.environment.is_some(),
            "cameras": scene.cameras.iter().map(|camera| &camera.name).collect::<Vec<_>>(),
            "variants": scene.variants,
            "features": packed.features.names(),
            "bounds": { "min": low.to_array(), "max": high.to_array() },
            "device_memory": memory.map(|(memory, config)| json!({
                "scene_bytes": memory.scene,
                "structure_bytes": memory.structures,
                "render_bytes": memory.render,
                "caustic_map_bytes": memory.caustic_map,
                "resolution": config.resolution,
                "photons": config.photons,
            })),
            "notes": notes,
            "warnings": warnings,
        });
        return Ok(serde_json::to_string_pretty(&value)? + "\n");
    }
    let mut text = String::new();
    writeln!(
        text,
        "triangles    {} ({} dropped)",
        packed.seen_triangles(),
        scene.dropped_triangles
    )?;
    writeln!(text, "objects      {}", scene.objects.len())?;
    if packed.features.instanced {
        writeln!(
            text,
            "instances    {} of {} shared primitives; {} triangles are stored",
            packed.instances.len(),
            packed.shared_primitives(),
            packed.shading_triangles.len()
        )?;
    }
    writeln!(
        text,
        "materials    {} matte, {} mirror, {} dielectric, {} glossy",
        count(|s| matches!(s, Surface::Matte)),
        count(|s| matches!(s, Surface::Mirror)),
        count(|s| matches!(s, Surface::Dielectric(_))),
        count(|s| matches!(s, Surface::Glossy(_)))
    )?;
    writeln!(
        text,
        "lights       {emissive} emissive triangles, {} punctual{}",
        scene.lights.len(),
        if scene.environment.is_some() {
            ", an environment"
        } else {
            ""
        }
    )?;
    for (index, camera) in scene.cameras.iter().enumerate() {
        writeln!(text, "camera {index:<5} {}", escaped(&camera.name))?;
    }
    for variant in &scene.variants {
        writeln!(text, "variant      {variant}")?;
    }
    let features = packed.features.names();
    writeln!(
        text,
        "features     {}",
        if features.is_empty() {
            "none".into()
        } else {
            features.join(", ")
        }
    )?;
    writeln!(text, "bounds       {low} to {high}")?;
    if let Some((memory, config)) = memory {
        let mebibytes = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let ([width, height], photons) = (config.resolution, config.photons);
        let caustic_map = if memory.caustic_map > 0 {
            let a_pixel = memory.caustic_map / (u64::from(width) * u64::from(height));
            format!(", of which {a_pixel} bytes per pixel for a map of caustic photons")
        } else {
            String::new()
        };
        let structures = if memory.structures > 0 {
            let most = mebibytes(memory.structures);
            format!(" (at most {most:.1} MiB of that for acceleration structures)")
        } else {
            String::new()
        };
        writeln!(
            text,
            "memory       {:.1} MiB of the device for the scene{structures}, {:.1} MiB for {width}x{height} and {photons} photon \
             paths{caustic_map}",
            mebibytes(memory.scene),
            mebibytes(memory.render)
        )?;
    }
    for note in notes {
        writeln!(text, "note         {note}")?;
    }
    for warning in &warnings {
        writeln!(text, "warning      {warning}")?;
    }
    Ok(text)
}

/// The memory of a render of the first camera on the best device with default settings; `None` without a device, or, with a
/// message, if it can't be found out.
fn memory(scene: &Scene, prepared: &PreparedScene) -> Option<(Memory, RenderConfig)> {
    let config = RenderConfig::of(&scene.cameras[0]);
    let device = best_device().ok()?;
    match prepared.memory(&config, &device) {
        Ok(memory) => Some((memory, config)),
        Err(error) => {
            say!(
                "warning: the memory of a render is unknown: {}",
                advice::of_library(&error)
            );
            None
        }
    }
}
