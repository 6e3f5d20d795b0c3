//! The commands that list things.

use std::path::Path;

use anyhow::Result;
use serde_json::json;

use crate::gather::{METHODS, default_method};
use crate::gpu;
use crate::scene::{PackedScene, Scene, Surface};

/// `ppm-vk devices`.
pub fn devices(as_json: bool) -> Result<()> {
    let devices = gpu::devices()?;
    if as_json {
        println!("{}", serde_json::to_string_pretty(&devices)?);
        return Ok(());
    }
    for device in devices {
        println!("{}: {} ({})", device.index, device.name, device.kind);
        println!("   driver           {}, Vulkan {}", device.driver, device.api_version);
        println!("   timestamps       {} ns", device.timestamp_period_ns);
        println!("   subgroup         {}", device.subgroup_size);
        println!("   shared memory    {} KiB", device.max_shared_memory_bytes >> 10);
        println!("   storage buffer   {} MiB", device.max_storage_buffer_bytes >> 20);
        if device.lacks.is_empty() {
            println!("   runs             everything");
        } else {
            println!("   runs             nothing: it lacks {}", device.lacks.join(", "));
        }
    }
    Ok(())
}

/// `ppm-vk gathers`.
pub fn gathers() {
    for (index, method) in METHODS.iter().enumerate() {
        let default = if index == default_method() { " (default)" } else { "" };
        println!("{:<20} {}{default}", method.name, method.summary);
        println!("{:<20} {}", "", method.paper);
    }
}

/// `ppm-vk inspect`.
pub fn inspect(path: &Path, as_json: bool) -> Result<()> {
    let scene = Scene::load(path)?;
    let packed = PackedScene::new(&scene).map_err(|what| crate::error::Error::scene(path, what))?;
    let count = |is: fn(&Surface) -> bool| scene.materials.iter().filter(|material| is(&material.surface)).count();
    let to_world = |p: glam::Vec3| p.as_dvec3() / scene.normalisation.scale + scene.normalisation.centre;
    let (low, high) = scene.bounds();
    let (low, high) = (to_world(low), to_world(high));
    if as_json {
        let value = json!({
            "triangles": scene.triangles.len(),
            "dropped_triangles": scene.dropped_triangles,
            "objects": scene.objects.len(),
            "materials": {
                "matte": count(|s| matches!(s, Surface::Matte)),
                "mirror": count(|s| matches!(s, Surface::Mirror)),
                "dielectric": count(|s| matches!(s, Surface::Dielectric { .. })),
            },
            "emissive_triangles": packed.lights.len(),
            "cameras": scene.cameras.iter().map(|camera| &camera.name).collect::<Vec<_>>(),
            "bounds": { "min": low.to_array(), "max": high.to_array() },
            "warnings": scene.warnings,
        });
        println!("{}", serde_json::to_string_pretty(&value)?);
        return Ok(());
    }
    println!("triangles    {} ({} dropped)", scene.triangles.len(), scene.dropped_triangles);
    println!("objects      {}", scene.objects.len());
    println!(
        "materials    {} matte, {} mirror, {} dielectric",
        count(|s| matches!(s, Surface::Matte)),
        count(|s| matches!(s, Surface::Mirror)),
        count(|s| matches!(s, Surface::Dielectric { .. }))
    );
    println!("lights       {} emissive triangles", packed.lights.len());
    for (index, camera) in scene.cameras.iter().enumerate() {
        println!("camera {index:<5} {}", camera.name);
    }
    println!("bounds       {low} to {high}");
    for warning in &scene.warnings {
        println!("warning      {warning}");
    }
    Ok(())
}
