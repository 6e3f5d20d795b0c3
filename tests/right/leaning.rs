//! Light by mirrors and glass whose shading normals lean: photons bring what rays along the same directions would find.
//!
//! A sun of irradiance E across its rays and a flat mirror with one shading normal: rays find the sun's radiance in the mirror, times
//! its reflectance F, in a cone as wide as the sun. So what the mirror reflects has the irradiance F·E across its rays, however its
//! triangles lie. At a boundary of glass the cone changes as refraction says, by cos θ_i / cos θ_t of the angles to the shading
//! normal, and the irradiance with it.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::cpu;
use serde_json::{Value, json};

use crate::document::{Document, clear, matte, metallic_roughness, mirror};
use crate::lamp::{assert_floor_is_lit_by, config};
use crate::measure::{Measured, Region};
use crate::mesh::Mesh;
use crate::picture::Subject;
use crate::stage::subject;

/// So small that what the floor sends back to the mirror is less than this part.
const DARK: f64 = 1e-3;
const IRRADIANCE: f64 = 10.0;

fn add_sun(scene: &mut Document, towards: DVec3) {
    let sun = json!({"type": "directional", "intensity": IRRADIANCE});
    scene.punctual(sun).towards(-towards);
}

/// The direction at an angle above the x axis, in degrees.
fn direction(degrees: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    dvec3(cos, sin, 0.0)
}

/// By kernels, and by the plain renderer.
fn assert_lit(scene: &Subject, ways: &[Direct], irradiance: f64) {
    let regions = [Region::around([24, 24], 8)];
    let samples = (0..32).map(|seed| {
        let config = RenderConfig {
            seed,
            ..config(Direct::Photons, 20_000, 0.1)
        };
        let mut plain = cpu::Renderer::new(&scene.packed, &scene.scene.cameras[0], config).expect("a renderer");
        plain.iterate().expect("an iteration");
        regions[0].of(&plain.resolve().expect("a picture"), 0)
    });
    let radiance = DARK / PI * irradiance;
    let what = format!("{} by the plain renderer", scene.scene.name);
    Measured::of(samples.collect()).assert_between(radiance, radiance * (1.0 + DARK), &what);
    for &direct in ways {
        let config = config(direct, 50_000, 0.05);
        assert_floor_is_lit_by(scene, &config, DARK, |_| irradiance, &regions, true, 1.0 + DARK);
    }
}

/// A wall at x = −0.5 reflects a sun onto the floor before it.
fn assert_mirror_reflects_the_sun(material: Value, lean: f64, reflectance: f64) {
    let mut scene = Document::new("leaning-mirror");
    let grey = scene.material(matte("grey", [DARK; 3]));
    let mirror = scene.material(material);
    scene.object("floor", &Mesh::facing_up(2.0, 0.0), grey);
    let mut wall = Mesh::quad([
        dvec3(-0.5, 0.0, 2.0),
        dvec3(-0.5, 0.0, -2.0),
        dvec3(-0.5, 3.0, -2.0),
        dvec3(-0.5, 3.0, 2.0),
    ]);
    let (sun, normal) = (direction(40.0), direction(lean));
    wall.normals.fill(normal);
    scene.object("wall", &wall, mirror);
    add_sun(&mut scene, sun);
    scene.camera([1.2, 1.2], [0.0, 0.0], 10.0);
    let reflected = 2.0 * sun.dot(normal) * normal - sun;
    let expected = IRRADIANCE * (sun.y - reflectance * reflected.y);
    assert_lit(&subject(scene), &[Direct::Light, Direct::Photons], expected);
}

#[test]
fn a_mirror_with_leaning_normals_reflects_as_much_light_as_rays_see_in_it() {
    for lean in [-15.0, -10.0, 5.0] {
        assert_mirror_reflects_the_sun(mirror("mirror", [1.0; 3]), lean, 1.0);
    }
}

/// So smooth that it is a mirror too, and as a microfacets' lobe that is a little wider.
#[test]
fn polished_metal_with_leaning_normals_reflects_as_much_light_as_rays_see_in_it() {
    for roughness in [0.01, 0.06] {
        assert_mirror_reflects_the_sun(metallic_roughness("metal", [1.0; 3], 1.0, roughness), -10.0, 1.0);
    }
}

/// A floor in water under a high sun. The camera is in the water too.
#[test]
fn water_with_leaning_normals_passes_as_much_light_as_refraction_says() {
    const IOR: f64 = 1.33;
    let mut scene = Document::new("leaning-water");
    let grey = scene.material(matte("grey", [DARK; 3]));
    let water = scene.material(clear("water", IOR));
    scene.object("floor", &Mesh::facing_up(1.0, 0.0), grey);
    let mut body = Mesh::cuboid(dvec3(-2.0, -0.5, -2.0), dvec3(2.0, 1.0, 2.0));
    let (sun, normal) = (direction(80.0), direction(45.0));
    for face in body.normals.iter_mut().filter(|face| face.y > 0.5) {
        *face = normal;
    }
    scene.object("water", &body, water);
    add_sun(&mut scene, sun);
    scene.camera([0.5, 0.5], [0.0, 0.0], 20.0);
    let cos_i = sun.dot(normal);
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (IOR * IOR)).sqrt();
    let refracted = -sun / IOR + (cos_i / IOR - cos_t) * normal;
    let parallel = (IOR * cos_i - cos_t) / (IOR * cos_i + cos_t);
    let across = (cos_i - IOR * cos_t) / (cos_i + IOR * cos_t);
    let transmittance = 1.0 - 0.5 * (parallel * parallel + across * across);
    let expected = IRRADIANCE * transmittance * cos_i / cos_t * -refracted.y;
    assert_lit(&subject(scene), &[Direct::Photons], expected);
}
