//! Textures, leaning normals and alpha, where the answer is known.

use std::f64::consts::PI;

use glam::{DVec3, Vec3, dvec3};
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::scene::Environment;
use serde_json::json;

use crate::document::{Document, Filter, light, matte, png, with_texture};
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{subject, subject_under};

const SIDE: usize = 48;
const COLOR: &str = "/pbrMetallicRoughness/baseColorTexture";

fn config(direct: Direct, photons: u32) -> RenderConfig {
    RenderConfig {
        direct,
        radius: Some(0.05),
        ..small(SIDE as u32, photons)
    }
}

/// A plate of one square metre that fills the picture, seen from the front, in light of radiance 1 from everywhere.
fn plate(make: impl FnOnce(&mut Document) -> usize) -> Subject {
    let mut scene = Document::new("plate");
    let material = make(&mut scene);
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| dvec3(x, y, 0.0));
    scene.object("plate", &Mesh::quad(corners), material);
    // 2 · atan(0.5 / 1)
    scene.camera([0.0, 1.0], [0.0, 0.0], 53.130_102);
    subject_under(scene, Some(Environment::constant(Vec3::ONE)))
}

/// Regions inside each of the picture's quarters, row by row.
fn quarters() -> [Region; 4] {
    [[12, 12], [36, 12], [12, 36], [36, 36]].map(|centre| Region::around(centre, 8))
}

#[test]
fn in_uniform_light_each_texel_has_the_radiance_of_its_albedo() {
    // sRGB values, and what IEC 61966-2-1 says that they mean.
    let texels = [
        [0u8, 64, 255, 255],
        [188, 128, 10, 255],
        [255, 255, 255, 255],
        [50, 100, 200, 255],
    ];
    let linear = |value: u8| {
        let value = f64::from(value) / 255.0;
        if value <= 0.040_45 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
    };
    let plate = plate(|scene| {
        let texture = scene.texture(&png(2, 2, |x, y| texels[(2 * y + x) as usize]), Filter::Nearest);
        scene.material(with_texture(matte("plate", [0.5, 1.0, 1.0]), COLOR, texture))
    });
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
        let measured = measure(&plate, config(direct, photons), 32, |image| {
            let channels = |region: &Region| [0, 1, 2].map(|channel| region.of(image, channel));
            quarters().iter().flat_map(channels).collect()
        });
        for (index, measured) in measured.iter().enumerate() {
            let (quarter, channel) = (index / 3, index % 3);
            let expected = linear(texels[quarter][channel]) * [0.5, 1.0, 1.0][channel];
            measured.assert_is(
                expected,
                &format!("quarter {quarter}, channel {channel}, direct light by {direct:?}"),
            );
        }
    }
}

/// Behind the plate is the light of radiance 1, which it lets pass where it isn't there.
#[test]
fn what_is_there_in_part_covers_its_part() {
    for (mode, expected) in [("BLEND", [1.0, 0.6, 0.2, 0.0]), ("MASK", [1.0, 1.0, 0.0, 0.0])] {
        let plate = plate(|scene| {
            let alphas = [0u8, 102, 204, 255];
            let texture = scene.texture(
                &png(2, 2, |x, y| [255, 255, 255, alphas[(2 * y + x) as usize]]),
                Filter::Nearest,
            );
            let mut material = with_texture(matte("plate", [0.0; 3]), COLOR, texture);
            material["alphaMode"] = json!(mode);
            scene.material(material)
        });
        let measured = measure(&plate, config(Direct::Light, 100), 32, |image| {
            quarters().iter().map(|region| region.of(image, 0)).collect()
        });
        for (measured, expected) in measured.iter().zip(expected) {
            measured.assert_is(expected, mode);
        }
    }
}

/// A white plate reflects what it doesn't let pass, by rays and by photons: it vanishes.
#[test]
fn a_white_plate_that_is_there_in_part_vanishes() {
    let plate = plate(|scene| {
        let alphas = [64u8, 128, 192, 255];
        let texture = scene.texture(
            &png(2, 2, |x, y| [255, 255, 255, alphas[(2 * y + x) as usize]]),
            Filter::Nearest,
        );
        let mut material = with_texture(matte("plate", [1.0; 3]), COLOR, texture);
        material["alphaMode"] = json!("BLEND");
        scene.material(material)
    });
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
        let measured = measure(&plate, config(direct, photons), 32, |image| {
            quarters().iter().map(|region| region.of(image, 0)).collect()
        });
        for measured in measured {
            measured.assert_is(1.0, &format!("direct light by {direct:?}"));
        }
    }
}

/// Two faces in one place, neither of which is there, stop nothing: not even the render.
#[test]
fn faces_in_one_place_that_are_not_there_let_all_light_pass() {
    let mut scene = Document::new("leaves");
    let mut nothing = matte("nothing", [0.0; 3]);
    nothing["alphaMode"] = json!("MASK");
    nothing["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.0, 0.0, 0.0, 0.0]);
    let nothing = scene.material(nothing);
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| dvec3(x, y, 0.3 * x + 0.1 * y));
    let back = [corners[0], corners[3], corners[2], corners[1]];
    for face in [corners, back, corners] {
        scene.object("leaf", &Mesh::quad(face), nothing);
    }
    scene.camera([0.0, 1.0], [0.0, 0.0], 40.0);
    let leaves = subject_under(scene, Some(Environment::constant(Vec3::ONE)));
    let image = leaves.render(2, config(Direct::Photons, 1000));
    assert!(
        image.pixels().iter().all(|pixel| *pixel == [1.0; 3]),
        "something is seen"
    );
}

/// A small lamp high above a floor: radiance · area · cos θ² / distance² / π · albedo right below it, where what stands between
/// takes its part of it, and a leaning normal the cosine of its angle.
fn lit_floor(change_floor: impl FnOnce(&mut Document) -> usize, sheet: Option<f64>) -> (Subject, f64) {
    const HEIGHT: f64 = 1.0;
    let mut scene = Document::new("lit-floor");
    let floor = change_floor(&mut scene);
    let lamp = scene.material(light("lamp", [1e4; 3]));
    scene.object("floor", &Mesh::facing_up(0.1, 0.0), floor);
    scene.object("lamp", &Mesh::facing_down(0.01, HEIGHT), lamp);
    if let Some(alpha) = sheet {
        let mut material = matte("sheet", [0.0; 3]);
        material["alphaMode"] = json!("BLEND");
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.0, 0.0, 0.0, alpha]);
        let material = scene.material(material);
        scene.object("sheet", &Mesh::facing_up(0.5, 0.6), material);
    }
    scene.camera([0.3, 0.3], [0.0, 0.0], 10.0);
    (subject(scene), 1e4 * 4e-4 / (HEIGHT * HEIGHT) / PI)
}

/// What the camera and the photons' discs see of the floor lies 0.08 m from the point below the lamp at the most, where the light
/// is weaker by twice the square of that, and has half of this loss on average.
const OFF_CENTRE: f64 = 0.013;

fn assert_floor_shines_with(scene: &Subject, expected: f64, what: &str) {
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 200_000)] {
        let measured = measure(scene, config(direct, photons), 32, |image| {
            vec![Region::around([24, 24], 10).of(image, 0)]
        });
        let text = format!("{what}, direct light by {direct:?}");
        measured[0].assert_between(expected * (1.0 - OFF_CENTRE), expected, &text);
    }
}

#[test]
fn a_sheet_that_is_there_in_part_lets_the_rest_of_the_light_pass() {
    let grey = |scene: &mut Document| scene.material(matte("grey", [0.5; 3]));
    let (scene, irradiance) = lit_floor(grey, Some(0.3));
    assert_floor_shines_with(&scene, 0.5 * 0.7 * irradiance, "a sheet of alpha 0.3");
}

/// (0.6, 0, 0.8) in a texture is 204, 127.5 and 229.5: the cosine to the light is 0.8.
#[test]
fn a_leaning_normal_takes_its_cosine_of_the_light_by_rays_and_by_photons() {
    let leaning = |scene: &mut Document| {
        let texture = scene.texture(&png(1, 1, |_, _| [204, 128, 230, 255]), Filter::Linear);
        scene.material(with_texture(matte("grey", [0.5; 3]), "/normalTexture", texture))
    };
    let (scene, irradiance) = lit_floor(leaning, None);
    let normal = dvec3(204.0, 128.0, 230.0) / 127.5 - DVec3::ONE;
    assert_floor_shines_with(&scene, 0.5 * normal.normalize().z * irradiance, "a leaning normal");
}

/// All the flux of a lamp whose texture is black on one half and shines on the other comes from that half.
#[test]
fn a_textured_lamp_shines_with_the_mean_of_its_texture() {
    let mut scene = Document::new("textured-lamp");
    let grey = scene.material(matte("grey", [0.5; 3]));
    let texture = scene.texture(&png(2, 1, |x, _| [if x == 0 { 0 } else { 255 }; 4]), Filter::Nearest);
    let lamp = with_texture(light("lamp", [2e4; 3]), "/emissiveTexture", texture);
    let lamp = scene.material(lamp);
    scene.object("floor", &Mesh::facing_up(0.1, 0.0), grey);
    scene.object("lamp", &Mesh::facing_down(0.01, 1.0), lamp);
    scene.camera([0.3, 0.3], [0.0, 0.0], 10.0);
    let expected = 0.5 * 1e4 * 4e-4 / PI;
    assert_floor_shines_with(&subject(scene), expected, "half of a lamp");
}
