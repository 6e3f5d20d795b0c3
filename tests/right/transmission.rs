//! Glass that absorbs, is rough, a thin wall, or a part of a surface, in rooms whose walls all have radiance 1.

use glam::{DVec3, dvec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::cpu::{self, Reflector};
use serde_json::{Value, json};

use crate::document::{Document, light};
use crate::gloss::albedo;
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{camera_ray, subject};

const SIDE: usize = 32;
const IOR: f64 = 1.5;

/// A sheet that fills the view, from z = 0 to −thickness, before walls of radiance 1.
fn sheet(mesh: &Mesh, material: Value) -> Subject {
    let mut scene = Document::new("sheet");
    let wall = scene.material(light("wall", [1.0; 3]));
    let room = Mesh::cuboid(dvec3(-1.0, -1.0, -1.0), dvec3(1.0, 1.0, 1.0)).flipped();
    scene.object("room", &room, wall);
    let glass = scene.material(material);
    scene.object("sheet", mesh, glass);
    scene.camera([0.1, 0.8], [0.0, 0.0], 40.0);
    subject(scene)
}

fn slab(thickness: f64) -> Mesh {
    Mesh::cuboid(dvec3(-0.9, -0.9, -thickness), dvec3(0.9, 0.9, 0.0))
}

fn wall() -> Mesh {
    let corner = |x, y| dvec3(x, y, 0.0);
    Mesh::quad([
        corner(-0.9, -0.9),
        corner(0.9, -0.9),
        corner(0.9, 0.9),
        corner(-0.9, 0.9),
    ])
}

fn glass(roughness: f64, extensions: Value) -> Value {
    let mut all = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    for (name, extension) in extensions.as_object().expect("extensions") {
        all[name] = extension.clone();
    }
    json!({
        "name": "glass",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.9, 0.6, 0.3, 1], "metallicFactor": 0, "roughnessFactor": roughness
        },
        "extensions": all
    })
}

/// Beer: a path of length x keeps attenuationColor^(x / attenuationDistance). Without refraction (index 1) nothing else
/// happens, and no chance is in it.
#[test]
fn light_that_passes_a_liquid_falls_with_its_thickness() {
    const ATTENUATION: [f64; 3] = [0.8, 0.5, 0.1];
    for thickness in [0.05, 0.2, 0.8] {
        let mut liquid = glass(
            0.0,
            json!({
                "KHR_materials_ior": {"ior": 1},
                "KHR_materials_volume": {
                    "thicknessFactor": 1, "attenuationColor": ATTENUATION, "attenuationDistance": 0.3
                }
            }),
        );
        liquid["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, 1]);
        let subject = sheet(&slab(thickness), liquid);
        let config = small(SIDE as u32, 1000);
        let mut device = subject.renderer(config.clone());
        let mut twin = cpu::Renderer::new(&subject.packed, &subject.scene.cameras[0], config).expect("renderer");
        let mut worst: f64 = 0.0;
        for renderer in [&mut device as &mut dyn Backend, &mut twin] {
            renderer.iterate().expect("an iteration");
            let image = renderer.resolve().expect("a picture");
            for (pixel, found) in image.pixels().iter().enumerate() {
                let (column, row) = ((pixel % SIDE) as f64, (pixel / SIDE) as f64);
                // Any ray of the pixel: its corners have the extremes.
                let lengths = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| {
                    let (_, direction) = camera_ray(&subject, SIDE, [column + x, row + y]);
                    thickness / -direction.z
                });
                let shortest = lengths.into_iter().fold(f64::INFINITY, f64::min);
                let longest = lengths.into_iter().fold(0.0, f64::max);
                for (found, attenuation) in found.iter().zip(ATTENUATION) {
                    let found = f64::from(*found);
                    let (low, high) = (attenuation.powf(longest / 0.3), attenuation.powf(shortest / 0.3));
                    // The middle of a side may be nearer to the view's axis than both corners.
                    assert!(
                        found > low * 0.999 && found < high * 1.003,
                        "{thickness}: {found} at {column}, {row}, {low} to {high} expected"
                    );
                    worst = worst.max(high / low);
                }
            }
        }
        println!("thickness {thickness}: within each pixel's own range, a factor of {worst:.3} at the most");
    }
}

fn fresnel(cos_i: f64) -> f64 {
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (IOR * IOR)).sqrt();
    let parallel = (IOR * cos_i - cos_t) / (IOR * cos_i + cos_t);
    let perpendicular = (cos_i - IOR * cos_t) / (cos_i + IOR * cos_t);
    0.5 * (parallel.powi(2) + perpendicular.powi(2))
}

fn measured_and_expected(subject: &Subject, direct: Direct, expected: impl Fn(f64) -> f64) {
    let middle = Region::around([SIDE / 2; 2], 8);
    let expected = middle.mean(|[column, row]| {
        let (_, direction) = camera_ray(subject, SIDE, [column as f64 + 0.5, row as f64 + 0.5]);
        expected(-direction.z)
    });
    let config = RenderConfig {
        direct,
        radius: Some(0.1),
        ..small(SIDE as u32, 20_000)
    };
    let measured = measure(subject, config, 32, |image| vec![middle.of(image, 0)]);
    // The mean of Fresnel's reflectance over a pixel is that of its middle to 1e-4.
    measured[0].assert_between(expected - 1e-4, expected + 1e-4, &format!("{direct:?}"));
}

/// glTF: one boundary's reflectance F, and (1 − F) · baseColor straight through.
#[test]
fn a_thin_wall_reflects_f_and_passes_the_rest_in_its_colour() {
    let subject = sheet(&wall(), glass(0.0, json!({})));
    measured_and_expected(&subject, Direct::Light, |cosine| {
        let f = fresnel(cosine);
        f + (1.0 - f) * 0.9
    });
}

/// The other half is lacquer: a base under the same smooth boundary, by Schlick's Fresnel.
#[test]
fn a_surface_that_is_half_clear_scatters_the_other_half() {
    let half = json!({"KHR_materials_transmission": {"transmissionFactor": 0.5}});
    let subject = sheet(&wall(), glass(0.0, half));
    let lacquer = Reflector {
        diffuse: DVec3::splat(0.9),
        f0: DVec3::splat(0.04),
        f90: 1.0,
        over_base: [0.04, 1.0],
        alpha: 0.0,
        coat: 0.0,
        sheen: Default::default(),
        along: None,
    };
    for direct in [Direct::Light, Direct::Photons] {
        measured_and_expected(&subject, direct, |cosine| {
            let f = fresnel(cosine);
            let scattered = albedo(lacquer, cosine, 96).x + lacquer.fresnel(cosine).x;
            0.5 * (f + (1.0 - f) * 0.9) + 0.5 * scattered
        });
    }
}

/// In uniform light nothing but masking between microfacets is lost, which is little at this roughness.
#[test]
fn rough_glass_all_but_vanishes_in_uniform_light() {
    for (mesh, volume) in [
        (wall(), json!({})),
        (slab(0.2), json!({"KHR_materials_volume": {"thicknessFactor": 1}})),
    ] {
        for (roughness, least) in [(0.1, 0.995), (0.3, 0.97)] {
            let mut material = glass(roughness, volume.clone());
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, 1]);
            let subject = sheet(&mesh, material);
            let middle = Region::around([SIDE / 2; 2], 8);
            let config = RenderConfig {
                // Total reflection holds light for long.
                max_depth: 2048,
                ..small(SIDE as u32, 1000)
            };
            let measured = measure(&subject, config, 32, |image| vec![middle.of(image, 0)]);
            measured[0].assert_between(least, 1.0, &format!("roughness {roughness}"));
        }
    }
}
