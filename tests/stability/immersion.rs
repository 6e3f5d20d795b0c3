//! Lamps and cameras inside liquids.

use glam::Vec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::cpu;
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use super::model::Model;
use super::sound::{render, square};

/// Transmittance of a unit of length of the liquid.
const KEEPS: f32 = 0.4;

#[derive(Debug, Clone, Copy)]
enum Lamp {
    Panel,
    Point,
}

/// A floor one unit below a lamp and one unit from a camera, all in a block of liquid of index 1. With `glass`, the liquid is
/// inside a glass and overlaps it.
fn tank(lamp: Lamp, keeps: f32, glass: bool) -> Scene {
    let mut model = Model::new();
    let absorbing = |model: &mut Model, keeps: f32| {
        let material = model.glass(1.0);
        model.file.set(
            &format!("/materials/{material}/extensions/KHR_materials_volume"),
            json!({"thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": vec![keeps; 3]}),
        );
        material
    };
    let liquid = absorbing(&mut model, keeps);
    if glass {
        let material = absorbing(&mut model, 1.0);
        let cube = |half: f32| [Vec3::splat(-half), Vec3::splat(half)];
        model.shell(material, cube(2.2), cube(2.0));
        model.block(liquid, Vec3::splat(-2.001), Vec3::splat(2.001));
    } else {
        model.block(liquid, Vec3::splat(-2.0), Vec3::splat(2.0));
    }
    let floor = model.matte([0.8; 3], 0.0);
    model.quad(floor, Vec3::new(-0.5, 0.0, 0.5), Vec3::X, Vec3::NEG_Z);
    match lamp {
        Lamp::Panel => {
            let panel = model.black(100.0);
            model.quad(panel, Vec3::new(-0.02, 1.0, -0.02), 0.04 * Vec3::X, 0.04 * Vec3::Z);
        }
        Lamp::Point => {
            model.file.set(
                "/extensions",
                json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1}]}}),
            );
            model.file.add_root(json!({
                "translation": [0, 1, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}
            }));
        }
    }
    model.camera(Vec3::new(0.6, 0.8, 0.0), Vec3::ZERO, 0.05);
    model.scene()
}

/// Mean of the picture by kernels and by the CPU renderer.
fn seen(scene: &Scene, direct: Direct) -> [f64; 2] {
    let config = RenderConfig {
        direct,
        radius: Some(0.1),
        ..square(8, 5_000)
    };
    let on_device = render(scene, 0, 4, config.clone()).image;
    let packed = PackedScene::new(scene).expect("packed scene");
    let mut twin = cpu::Renderer::new(&packed, &scene.cameras[0], config).expect("a renderer");
    for _ in 0..4 {
        twin.iterate().expect("an iteration");
    }
    [on_device, twin.resolve().expect("a picture")].map(|image| {
        let sum: f64 = image.pixels().iter().map(|pixel| f64::from(pixel[0])).sum();
        sum / image.pixels().len() as f64
    })
}

/// Paths are the same with and without absorption, so that noise cancels; lengths vary by a few thousandths.
#[test]
fn liquid_absorbs_between_a_lamp_and_a_camera_that_are_both_in_it() {
    for lamp in [Lamp::Panel, Lamp::Point] {
        for glass in [false, true] {
            for direct in [Direct::Light, Direct::Photons] {
                let clear = seen(&tank(lamp, 1.0, glass), direct);
                let coloured = seen(&tank(lamp, KEEPS, glass), direct);
                let expected = f64::from(KEEPS).powi(2);
                for (by, (coloured, clear)) in ["device", "CPU"].into_iter().zip(coloured.into_iter().zip(clear)) {
                    let kept = coloured / clear;
                    assert!(
                        (kept / expected - 1.0).abs() < 0.01,
                        "{lamp:?} by {direct:?} on {by}, in glass: {glass}: keeps {kept}, {expected} expected"
                    );
                }
            }
        }
    }
}
