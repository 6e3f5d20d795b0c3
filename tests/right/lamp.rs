//! Light from one lamp, in closed form.

use std::f64::consts::PI;

use glam::DVec3;
use ppm_vk::internals::config::{Direct, RenderConfig};

use crate::document::{Document, Filter, light, matte, mirror, png, with_texture};
use crate::measure::{Measured, Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{mean_on_floor, mean_over_disc, subject};

pub const SIDE: usize = 48;

/// View factor from a point to the rectangle a × b whose corner is right above at height h, as an odd function of a and b:
/// Howell, «A Catalog of Radiation Heat Transfer Configuration Factors», B-4 (with cosines on both sides).
fn corner_view_factor(a: f64, b: f64, h: f64) -> f64 {
    let term = |a: f64, b: f64| a / a.hypot(h) * (b / a.hypot(h)).atan();
    (term(a, b) + term(b, a)) / (2.0 * PI)
}

/// Irradiance at a point under a square of radiance 1 and height y around the y axis that faces down.
fn irradiance_under_square(point: DVec3, half_side: f64, height: f64) -> f64 {
    irradiance_under_rectangle(point, [[-half_side, half_side]; 2], height)
}

/// The same of a rectangle with these bounds in x and z.
fn irradiance_under_rectangle(point: DVec3, [x, z]: [[f64; 2]; 2], height: f64) -> f64 {
    let [left, right] = x.map(|x| x - point.x);
    let [back, front] = z.map(|z| z - point.z);
    let factor = |a, b| corner_view_factor(a, b, height - point.y);
    PI * (factor(right, front) - factor(left, front) - factor(right, back) + factor(left, back))
}

/// Compares regions of a floor of albedo `albedo` with its irradiance in closed form, for red. Photons, if the light comes by
/// them, blur it over a disc of the radius, which shrinks from the initial one: what is seen then lies between the
/// irradiance and its mean over that disc. Returns what was measured.
pub fn assert_floor_is_lit_by(
    scene: &Subject,
    config: &RenderConfig,
    albedo: f64,
    irradiance: impl Fn(DVec3) -> f64,
    regions: &[Region],
    by_photons: bool,
    brighter_at_most: f64,
) -> Vec<Measured> {
    let radius = config.radius.expect("a radius");
    let iterations = if by_photons { 32 } else { 128 };
    let measured = measure(scene, config.clone(), iterations, |image| {
        regions.iter().map(|region| region.of(image, 0)).collect()
    });
    for (measured, region) in measured.iter().zip(regions) {
        let mean =
            |value: &dyn Fn(DVec3) -> f64| albedo / PI * region.mean(|pixel| mean_on_floor(scene, SIDE, pixel, value));
        let exact = mean(&irradiance);
        let blurred = if by_photons {
            mean(&|point| mean_over_disc(&irradiance, point, radius))
        } else {
            exact
        };
        let what = format!("{}, direct light by {:?}, {region:?}", scene.scene.name, config.direct);
        measured.assert_between(exact.min(blurred), exact.max(blurred) * brighter_at_most, &what);
    }
    measured
}

pub fn config(direct: Direct, photons: u32, radius: f64) -> RenderConfig {
    RenderConfig {
        direct,
        radius: Some(radius),
        ..small(SIDE as u32, photons)
    }
}

#[test]
fn a_floor_under_a_square_light_has_the_irradiance_of_its_view_factor() {
    let at_the_origin = 0.5 / PI * 10.0 * irradiance_under_square(DVec3::ZERO, 0.5, 2.0);
    assert!(
        (at_the_origin - 0.367_388).abs() < 1e-6,
        "{at_the_origin} isn't what scenes/README.md says"
    );
    let scene = Subject::named("light-area");
    let points = [[24, 24], [8, 30], [38, 40], [14, 14], [40, 20]].map(|centre| Region::around(centre, 4));
    let regions = [&points[..], &[Region::around([24, 26], 18)]].concat();
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
        let irradiance = |point| 10.0 * irradiance_under_square(point, 0.5, 2.0);
        assert_floor_is_lit_by(
            &scene,
            &config(direct, photons, 0.25),
            0.5,
            irradiance,
            &regions,
            direct == Direct::Photons,
            1.0,
        );
    }
}

/// So near a lamp rays go by the BSDF as well: light that both ways bring counts once.
#[test]
fn a_floor_close_under_a_square_light_has_the_irradiance_of_its_view_factor() {
    const HALF_SIDE: f64 = 0.5;
    const HEIGHT: f64 = 0.2;
    let mut scene = Document::new("close");
    let grey = scene.material(matte("grey", [0.5; 3]));
    let lamp = scene.material(light("lamp", [10.0; 3]));
    scene.object("floor", &Mesh::facing_up(0.6, 0.0), grey);
    scene.object("lamp", &Mesh::facing_down(HALF_SIDE, HEIGHT), lamp);
    // Through the lamp's back, which has one side.
    scene.camera([0.9, 0.9], [0.0, 0.0], 30.0);
    let scene = subject(scene);
    let regions =
        [([24, 24], 18), ([24, 24], 4), ([8, 24], 6), ([24, 40], 6)].map(|(at, side)| Region::around(at, side));
    let irradiance = |point| 10.0 * irradiance_under_square(point, HALF_SIDE, HEIGHT);
    assert_floor_is_lit_by(
        &scene,
        &config(Direct::Light, 100, 0.25),
        0.5,
        irradiance,
        &regions,
        false,
        1.0,
    );
}

/// One of a panel's 4,096 texels shines, or a tent over four of them where texels are blended: as a square of its size does, and with
/// as little noise. Chosen by area alone, rays and photons would miss it 4,095 times of 4,096.
#[test]
fn a_texel_of_a_lamp_lights_a_floor_as_a_lamp_of_its_size_does() {
    const TEXELS: u32 = 64;
    const TEXEL: [u32; 2] = [11, 38];
    for filter in [Filter::Nearest, Filter::Linear] {
        let mut scene = Document::new("texel");
        let grey = scene.material(matte("grey", [0.5; 3]));
        let image = png(
            TEXELS,
            TEXELS,
            |x, y| if [x, y] == TEXEL { [255; 4] } else { [0, 0, 0, 255] },
        );
        let texture = scene.texture(&image, filter);
        let lamp = with_texture(light("lamp", [1e4; 3]), "/emissiveTexture", texture);
        let lamp = scene.material(lamp);
        scene.object("floor", &Mesh::facing_up(1.0, 0.0), grey);
        scene.object("lamp", &Mesh::facing_down(0.5, 1.5), lamp);
        scene.camera([0.9, 0.9], [0.0, 0.0], 30.0);
        let scene = subject(scene);
        // A tent is the mean of squares around all places of the texel.
        let off: &[f64] = match filter {
            Filter::Nearest => &[0.0],
            Filter::Linear => &[-0.375, -0.125, 0.125, 0.375],
        };
        let side = 1.0 / f64::from(TEXELS);
        let bounds = |first: f64| [first * side - 0.5, (first + 1.0) * side - 0.5];
        let irradiance = |point: DVec3| {
            let square = |&x: &f64, &z: &f64| {
                let [column, row] = [f64::from(TEXEL[0]) + x, f64::from(TEXELS - 1 - TEXEL[1]) + z];
                irradiance_under_rectangle(point, [bounds(column), bounds(row)], 1.5)
            };
            let squares = off.iter().flat_map(|x| off.iter().map(move |z| square(x, z)));
            1e4 * squares.sum::<f64>() / (off.len() * off.len()) as f64
        };
        let regions = [([24, 24], 20), ([10, 36], 8), ([38, 12], 8)].map(|(centre, side)| Region::around(centre, side));
        for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
            let by_photons = direct == Direct::Photons;
            let config = config(direct, photons, 0.2);
            for measured in assert_floor_is_lit_by(&scene, &config, 0.5, irradiance, &regions, by_photons, 1.0) {
                let relative = measured.error / measured.mean;
                assert!(
                    relative < 0.02,
                    "direct light by {direct:?} has a standard error of {relative}"
                );
            }
        }
    }
}

/// The lamp is 2 cm wide: what it differs from a point is (0.01 / h)², 1e-4, at the most.
#[test]
fn light_falls_with_the_square_of_the_distance() {
    for height in [1.0, 2.0, 3.0] {
        let mut scene = Document::new("small-lamp");
        let grey = scene.material(matte("grey", [0.5; 3]));
        let lamp = scene.material(light("lamp", [1e4; 3]));
        scene.object("floor", &Mesh::facing_up(1.0, 0.0), grey);
        scene.object("lamp", &Mesh::facing_down(0.01, height), lamp);
        scene.camera([0.9, 0.9], [0.0, 0.0], 30.0);
        let scene = subject(scene);
        // Radiance × area × cos θ / distance², times cos θ at the floor.
        let irradiance = |point: DVec3| {
            let distance2 = height * height + point.length_squared();
            1e4 * 4e-4 * height * height / (distance2 * distance2)
        };
        for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
            let all = [Region::around([24, 24], 20)];
            assert_floor_is_lit_by(
                &scene,
                &config(direct, photons, 0.2),
                0.5,
                irradiance,
                &all,
                direct == Direct::Photons,
                1.0 + 1e-4,
            );
        }
    }
}

/// A lamp that faces up lights the floor by a mirror above it alone, as its mirror image would; its own shadow ends before
/// what is seen. The floor's albedo is small, so that what goes to the mirror and comes back a second time is less than
/// that part of it.
#[test]
fn a_mirror_lights_a_floor_as_the_lamps_image_does() {
    const ALBEDO: f64 = 1e-3;
    let mut scene = Document::new("mirrored-lamp");
    let grey = scene.material(matte("grey", [ALBEDO; 3]));
    let lamp = scene.material(light("lamp", [10.0; 3]));
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    scene.object("floor", &Mesh::facing_up(2.0, 0.0), grey);
    scene.object("lamp", &Mesh::facing_up(0.1, 1.0), lamp);
    scene.object("mirror", &Mesh::facing_down(4.0, 1.5), mirror);
    scene.camera([0.95, 2.0], [0.0, 1.2], 30.0);
    let scene = subject(scene);
    let nearest = mean_on_floor(&scene, SIDE, [SIDE / 2, 0], |point| point.z);
    assert!(
        nearest > 0.3 + 0.15,
        "the picture shows the lamp's shadow, at z = {nearest}"
    );
    let irradiance = |point| 10.0 * irradiance_under_square(point, 0.1, 2.0);
    let regions = [([24, 24], 22), ([10, 36], 8), ([38, 12], 8)].map(|(centre, side)| Region::around(centre, side));
    let config = config(Direct::Light, 50_000, 0.15);
    assert_floor_is_lit_by(&scene, &config, ALBEDO, irradiance, &regions, true, 1.0 + ALBEDO);
}
