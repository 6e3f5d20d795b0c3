//! Checks that a device can bind and allocate a render's buffers, before anything is uploaded or compiled, with advice if it
//! cannot.

use std::collections::BTreeMap;

use super::accel_on;
use super::memory::{limits, scene_buffers};
use super::stages::Stages;
use crate::config::{Region, RenderConfig, Totals};
use crate::error::{Error, Remedy, Result, Setting};
use crate::gpu::{Device, DeviceSummary, StructureBytes, remedy};
use crate::packing::PackedScene;
use crate::record::{Command, Recording};
use crate::sizes::{Limits, Sizes};
use crate::stage::{Access, BufferId};
use crate::text;

/// Minimum side of a crop that is chosen, in pixels: the margin around it and the guides would cost more than the crop.
const SMALLEST_CROP: u32 = 128;

/// Builds the acceleration structures of a scene.
///
/// # Errors
/// Structures that the device can't build, with the advice to do without them.
pub(super) fn build_structures(device: &mut Device, scene: &PackedScene) -> Result<()> {
    let needed = device.structure_bytes(scene.own_triangles, &scene.instances)?;
    check_structures_fit(needed, device.summary())?;
    let built = device.trace_through(&scene.shading_triangles, scene.own_triangles, &scene.instances);
    built.map_err(|error| match error {
        Error::Unfit { what, .. } => without_ray_queries(&what),
        other => other,
    })
}

fn check_structures_fit(needed: StructureBytes, device: &DeviceSummary) -> Result<()> {
    if needed.at_once <= device.max_allocation_bytes {
        return Ok(());
    }
    Err(without_ray_queries(&format!(
        "the acceleration structures need {} at once, device {} allocates {} at once at most",
        text::bytes(needed.at_once),
        device.name,
        text::bytes(device.max_allocation_bytes)
    )))
}

fn without_ray_queries(why: &str) -> Error {
    Error::setting(Setting::Accel, format!("ray-query: {why}; use bvh or another device"))
}

/// A buffer that exceeds a device's limits.
struct TooLarge {
    id: BufferId,
    bytes: u64,
    /// The limit of the device.
    most: String,
}

/// Reports the first buffer that does not fit, with advice.
pub(super) fn check_fits(
    scene: &PackedScene,
    config: &RenderConfig,
    device: &DeviceSummary,
    limits: Limits,
) -> Result<()> {
    let Some(TooLarge { id, bytes, most }) = too_large(scene, config, device, limits) else {
        return Ok(());
    };
    let smaller = (1..64)
        .map(|step| {
            let side = |side: u32| ((f64::from(side) * 0.9_f64.powi(step)) as u32).max(1);
            config.resolution.map(side)
        })
        .find(|&resolution| {
            let config = RenderConfig {
                resolution,
                ..config.clone()
            };
            too_large(scene, &config, device, limits).is_none()
        });
    Err(Error::unfit(
        format!("{id:?} needs {}, device {} {most}", text::bytes(bytes), device.name),
        smaller.map_or_else(|| remedy(id), Remedy::Resolution),
    ))
}

/// The crops of what is shown of a picture that a device can render, one if it can render that at once.
///
/// # Errors
/// [`Error::Unfit`], if it can render none.
pub fn crops(scene: &PackedScene, config: &RenderConfig, device: &DeviceSummary) -> Result<Vec<Region>> {
    let config = &RenderConfig {
        accel: accel_on(config, device)?,
        ..config.clone()
    };
    let limits = limits(device, u32::MAX, scene);
    let shown = config.shown();
    let with = |crop: Region| RenderConfig {
        crop: Some(crop),
        ..config.clone()
    };
    if too_large(scene, config, device, limits).is_none() {
        return Ok(vec![shown]);
    }
    let maps = |crop: Region| Sizes::new(&with(crop), limits).photon_maps;
    let small = Region { size: [1, 1], ..shown };
    // All crops of a picture have the same photon maps, however large they are.
    let fits = |crops: &Vec<Region>| {
        let fits =
            |&crop: &Region| maps(crop) == maps(small) && too_large(scene, &with(crop), device, limits).is_none();
        crops.iter().all(fits)
    };
    let largest = shown.size[0].max(shown.size[1]);
    let sides = (0..64).map(|step| (f64::from(largest) * 0.9_f64.powi(step)) as u32);
    let sides = sides.take_while(|&side| side >= SMALLEST_CROP.min(largest));
    match sides.map(|side| shown.crops(side)).find(fits) {
        Some(crops) => Ok(crops),
        None => check_fits(scene, config, device, limits).map(|()| vec![shown]),
    }
}

fn too_large(scene: &PackedScene, config: &RenderConfig, device: &DeviceSummary, limits: Limits) -> Option<TooLarge> {
    let sizes = Sizes::new(config, limits);
    let stages = Stages {
        config,
        sizes: &sizes,
        features: scene.features,
    };
    let of_scene: BTreeMap<BufferId, u64> = scene_buffers(scene, config)
        .iter()
        .map(|(id, bytes)| (*id, bytes.len() as u64))
        .collect();
    let recordings = [stages.shortest_iteration(), stages.picture(Totals::default())];
    uses(&recordings).into_iter().find_map(|(id, as_texels)| {
        let bytes = sizes.bytes(id).or_else(|| of_scene.get(&id).copied())?;
        let (texels, storage) = (u64::from(device.max_texels), device.max_storage_buffer_bytes);
        let most = if as_texels && bytes / 16 > texels {
            format!("reads {texels} texels of 16 bytes at most")
        } else if bytes > storage {
            format!("binds {} at most", text::bytes(storage))
        } else if bytes > device.max_allocation_bytes {
            format!("allocates {} at once at most", text::bytes(device.max_allocation_bytes))
        } else {
            return None;
        };
        Some(TooLarge { id, bytes, most })
    })
}

/// The buffers that launches use, and whether they are read as texels.
fn uses(recordings: &[Recording]) -> BTreeMap<BufferId, bool> {
    let mut uses = BTreeMap::new();
    for command in recordings.iter().flat_map(Recording::commands) {
        if let Command::Dispatch(stage) = command {
            for (_, id, access) in stage.uses() {
                *uses.entry(id).or_default() |= access == Access::Texels;
            }
        }
    }
    uses
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;

    fn device(max_texels: u32, max_allocation_bytes: u64) -> DeviceSummary {
        DeviceSummary {
            index: 0,
            name: "Small Card".to_owned(),
            driver: String::new(),
            kind: "cpu",
            api_version: "1.3.0".to_owned(),
            timestamp_period_ns: 1.0,
            subgroup_size: 4,
            max_storage_buffer_bytes: 1 << 30,
            max_texels,
            max_shared_memory_bytes: 1 << 14,
            max_allocation_bytes,
            ray_query: false,
            lacks: Vec::new(),
        }
    }

    fn check(name: &str, resolution: [u32; 2], device: &DeviceSummary) -> Result<()> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(name)
            .with_extension("gltf");
        let scene = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
        let scene = PackedScene::new(&scene).unwrap_or_else(|error| panic!("{name}: {error}"));
        let config = RenderConfig {
            resolution,
            ..RenderConfig::default()
        };
        check_fits(&scene, &config, device, limits(device, u32::MAX, &scene))
    }

    /// The resolution in an error's advice.
    fn advised(error: &Error) -> [u32; 2] {
        match error {
            Error::Unfit {
                remedy: Remedy::Resolution(resolution),
                ..
            } => *resolution,
            other => panic!("no resolution is advised: {other}"),
        }
    }

    #[test]
    fn a_picture_of_more_texels_than_a_device_reads_is_told_with_one_that_fits() {
        // The limit of SwiftShader.
        let swift = device(1 << 16, 1 << 30);
        check("cornell", [64, 64], &swift).expect("64x64 fits");
        let error = check("cornell", [640, 480], &swift).expect_err("640x480 doesn't");
        let text = error.to_string();
        assert!(text.contains("65536 texels") && text.contains("Small Card"), "{text}");
        let fits = advised(&error);
        assert!(fits[0] > 100, "{error}");
        check("cornell", fits, &swift).unwrap_or_else(|error| panic!("what was advised: {error}"));
    }

    #[test]
    fn a_buffer_larger_than_what_can_be_allocated_is_told() {
        let small = device(1 << 27, 1 << 20);
        let error = check("cornell", [640, 480], &small).expect_err("1 MiB is too little");
        assert!(error.to_string().contains("allocates 1.0 MiB at once"), "{error}");
        check("cornell", advised(&error), &small).unwrap_or_else(|error| panic!("what was advised: {error}"));
    }

    #[test]
    fn a_picture_that_is_too_large_is_cut_into_crops_that_fit() {
        let small = device(1 << 20, 1 << 30);
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-spheres.gltf");
        let scene = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
        let scene = PackedScene::new(&scene).unwrap_or_else(|error| panic!("{error}"));
        let of = |resolution| RenderConfig {
            resolution,
            ..RenderConfig::default()
        };
        let found = crops(&scene, &of([640, 480]), &small).expect("a picture that fits");
        assert_eq!(found, [Region::whole([640, 480])]);
        let config = of([7680, 4320]);
        let found = crops(&scene, &config, &small).expect("crops");
        assert!((50..500).contains(&found.len()), "{} crops", found.len());
        let pixels: u64 = found.iter().map(Region::pixels).sum();
        assert_eq!(pixels, config.shown().pixels());
        let limits = limits(&small, u32::MAX, &scene);
        for crop in found {
            let config = RenderConfig {
                crop: Some(crop),
                ..config.clone()
            };
            check_fits(&scene, &config, &small, limits).unwrap_or_else(|error| panic!("{crop}: {error}"));
            assert_eq!(Sizes::new(&config, limits).photon_maps, 2, "{crop}: photon maps");
        }
        let tiny = device(16, 1 << 30);
        let error = crops(&scene, &config, &tiny).expect_err("no crop fits");
        assert!(matches!(error, Error::Unfit { .. }), "{error}");
    }

    #[test]
    fn acceleration_structures_larger_than_what_can_be_allocated_are_told_with_another_way() {
        let needed = StructureBytes {
            structures: 3 << 20,
            at_once: 2 << 20,
        };
        let small = device(1 << 27, 1 << 20);
        let error = check_structures_fit(needed, &small).expect_err("1 MiB is too little");
        let text = error.to_string();
        assert!(text.contains("need 2.0 MiB") && text.contains("bvh"), "{text}");
        check_structures_fit(needed, &device(1 << 27, 2 << 20)).expect("2 MiB is enough");
    }

    #[test]
    fn no_resolution_is_advised_where_the_scene_is_too_large() {
        let tiny = device(16, 1 << 30);
        let error = check("cornell-spheres", [64, 64], &tiny).expect_err("16 texels");
        let Error::Unfit { remedy, .. } = error else {
            panic!("{error}")
        };
        let of_scenes = [
            Remedy::SmallerScene,
            Remedy::SmallerTextures,
            Remedy::SmallerEnvironment,
        ];
        assert!(of_scenes.contains(&remedy), "{remedy}");
    }
}
