//! Dielectrics inside others, touching or overlapping them.

use glam::Vec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::cpu;
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use super::model::Model;
use super::sound::{render, square};

/// Boxes around the origin: layers along the line of sight.
struct Body {
    ior: f32,
    /// Transmittance of a unit of length.
    keeps: f32,
    /// Half of its side, and of a hollow in it.
    half: f32,
    hollow: Option<f32>,
}

fn body(ior: f32, keeps: f32, half: f32, hollow: Option<f32>) -> Body {
    Body {
        ior,
        keeps,
        half,
        hollow,
    }
}

/// Radiance of the middle pixel by kernels and by the CPU renderer. Light of 1 arrives from all sides.
fn middle(bodies: &[Body]) -> [f64; 2] {
    let scene = scene(bodies);
    let config = square(16, 1000);
    let on_device = render(&scene, 0, 64, config.clone()).image;
    let packed = PackedScene::new(&scene).expect("packed scene");
    let mut twin = cpu::Renderer::new(&packed, &scene.cameras[0], config).expect("a renderer");
    for _ in 0..64 {
        twin.iterate().expect("an iteration");
    }
    [on_device, twin.resolve().expect("a picture")].map(|image| {
        let sum: f64 = image.pixels().iter().map(|pixel| f64::from(pixel[0])).sum();
        sum / image.pixels().len() as f64
    })
}

fn scene(bodies: &[Body]) -> Scene {
    let mut model = Model::new();
    let walls = model.black(1.0);
    model.room(walls, Vec3::splat(-4.0), Vec3::splat(4.0));
    for body in bodies {
        let material = model.glass(body.ior);
        let volume = format!("/materials/{material}/extensions/KHR_materials_volume");
        model.file.set(
            &volume,
            json!({
                "thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": vec![body.keeps; 3]
            }),
        );
        let half = |half: f32| (Vec3::splat(-half), Vec3::splat(half));
        let (low, high) = half(body.half);
        match body.hollow {
            None => model.block(material, low, high),
            Some(hollow) => {
                let (inner_low, inner_high) = half(hollow);
                model.shell(material, [low, high], [inner_low, inner_high]);
            }
        }
    }
    // All rays are close to the axis.
    model.camera(Vec3::new(0.0, 0.0, 3.5), Vec3::ZERO, 0.02);
    model.scene()
}

/// Radiance along the axis of layers with these indices of refraction and transmittances, in light of 1 from both sides. Adds up
/// all reflections: van de Hulst's adding method, without phases.
fn seen(layers: &[(f64, f64)]) -> f64 {
    let fresnel = |from: f64, to: f64| ((from - to) / (from + to)).powi(2);
    let iors: Vec<f64> = [1.0]
        .into_iter()
        .chain(layers.iter().map(|layer| layer.0))
        .chain([1.0])
        .collect();
    // Reflectance to the front and to the back, and transmittance, of the layers in front.
    let r = fresnel(iors[0], iors[1]);
    let (mut front, mut back, mut passed) = (r, r, 1.0 - r);
    for (i, (_, keeps)) in layers.iter().enumerate() {
        let r = fresnel(iors[i + 1], iors[i + 2]);
        let between = 1.0 - back * keeps * keeps * r;
        let new_passed = passed * keeps * (1.0 - r) / between;
        front += passed * passed * keeps * keeps * r / between;
        back = r + (1.0 - r) * (1.0 - r) * keeps * keeps * back / between;
        passed = new_passed;
    }
    front + passed
}

#[track_caller]
fn assert_seen(expected: f64, tolerance: f64, what: &str, bodies: &[Body]) {
    for (by, seen) in ["device", "CPU"].into_iter().zip(middle(bodies)) {
        assert!(
            (seen / expected - 1.0).abs() < tolerance,
            "{what}, by {by}: {seen}, {expected} expected"
        );
    }
}

/// With indices of 1 only absorption remains, along a known length.
#[test]
fn liquid_that_overlaps_its_glass_absorbs_along_the_length_that_it_fills() {
    for overlap in [-1e-3, 0.0, 1e-3, 0.05] {
        let liquid = body(1.0, 0.5, 0.9 + overlap, None);
        let glass = body(1.0, 1.0, 1.0, Some(0.9));
        // The glass has the smaller volume, and therefore counts.
        let length = 2.0 * f64::from(0.9f32.min(0.9 + overlap));
        assert_seen(
            0.5f64.powf(length),
            2e-4,
            &format!("overlap {overlap}"),
            &[liquid, glass],
        );
    }
}

/// With an overlap of a thousandth the result is that of touching objects, and of the layers. False alarms: the noise of 256
/// pixels after 64 iterations is .15 %.
#[test]
fn liquid_in_glass_looks_alike_whether_they_touch_or_overlap() {
    let expected = seen(&[(1.5, 1.0), (1.33, 0.5f64.powf(1.8)), (1.5, 1.0)]);
    for overlap in [0.0, 1e-3] {
        for liquid_first in [true, false] {
            let mut bodies = [body(1.33, 0.5, 0.9 + overlap, None), body(1.5, 1.0, 1.0, Some(0.9))];
            if !liquid_first {
                bodies.reverse();
            }
            assert_seen(
                expected,
                0.01,
                &format!("overlap {overlap}, liquid first: {liquid_first}"),
                &bodies,
            );
        }
    }
}

/// Between air and liquid there is a small gap: two more boundaries.
#[test]
fn a_gap_between_liquid_and_glass_is_two_boundaries_more() {
    let air = (1.0, 1.0);
    let expected = seen(&[(1.5, 1.0), air, (1.33, 0.5f64.powf(1.798)), air, (1.5, 1.0)]);
    let bodies = [body(1.33, 0.5, 0.899, None), body(1.5, 1.0, 1.0, Some(0.9))];
    assert_seen(expected, 0.01, "gap", &bodies);
}

/// A block of glass inside water: the boundary is that between glass and water, and water absorbs on both sides.
#[test]
fn glass_under_water_is_in_water() {
    let side = (1.33, 0.4f64.powf(0.5));
    let expected = seen(&[side, (2.0, 1.0), side]);
    let bodies = [body(1.33, 0.4, 1.0, None), body(2.0, 1.0, 0.5, None)];
    assert_seen(expected, 0.01, "submerged", &bodies);
}

/// The walls of a glass may be separate meshes with separate materials.
#[test]
fn a_glass_of_several_meshes_keeps_the_colour_of_the_liquid_pushed_into_it() {
    let expected = seen(&[(1.5, 1.0), (1.33, 0.5f64.powf(1.8)), (1.5, 1.0)]);
    let bodies = [
        body(1.5, 1.0, 1.0, None),
        body(1.5, 1.0, 0.0, Some(0.9)),
        body(1.33, 0.5, 0.901, None),
    ];
    assert_seen(expected, 0.01, "walls apart", &bodies);
}

/// A bubble may be a separate mesh whose fronts face inwards: behind it is air, not glass.
#[test]
fn a_bubble_with_its_fronts_inside_is_air() {
    let expected = seen(&[(1.5, 0.4f64.powf(0.5)), (1.0, 1.0), (1.5, 0.4f64.powf(0.5))]);
    let bodies = [body(1.5, 0.4, 1.0, None), body(1.5, 0.4, 0.0, Some(0.5))];
    assert_seen(expected, 0.01, "bubble", &bodies);
}
