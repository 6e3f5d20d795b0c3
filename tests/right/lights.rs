//! Light of points, directions and environments, in closed form.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};

use glam::DVec3;
use ppm_vk::internals::config::{Direct, Estimator, RenderConfig};
use ppm_vk::internals::cpu::Reflector;
use ppm_vk::internals::film::Image;
use ppm_vk::internals::metrics::compare;
use ppm_vk::internals::scene::Environment;
use serde_json::{Value, json};

use crate::document::{Document, clear, light, matte, metallic_roughness, mirror};
use crate::gloss::metal;
use crate::lamp::{SIDE, assert_floor_is_lit_by, config};
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::Subject;
use crate::stage::{camera_ray, mean_on_floor, subject, subject_under, walls};

pub const ALBEDO: f64 = 0.5;
pub const BLACK: [f64; 3] = [0.0; 3];

/// A floor under a punctual light that is placed by `place`.
pub fn floor_under(light: Value, height: f64, turn: f64) -> Subject {
    let mut scene = Document::new("punctual");
    let grey = scene.material(matte("grey", [ALBEDO; 3]));
    scene.object("floor", &Mesh::facing_up(1.5, 0.0), grey);
    scene
        .punctual(light)
        .at([0.0, height, 0.0])
        .rotated([1.0, 0.0, 0.0], turn);
    scene.camera([1.2, 1.2], [0.0, 0.0], 40.0);
    subject(scene)
}

/// By both ways of direct light: the middle, places around it, and most of the picture.
pub fn assert_lit(scene: &Subject, radius: f64, irradiance: impl Fn(DVec3) -> f64) {
    let points = [[24, 24], [8, 30], [38, 40], [14, 14], [40, 20]].map(|centre| Region::around(centre, 4));
    let regions = [&points[..], &[Region::around([24, 24], 20)]].concat();
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
        let config = config(direct, photons, radius);
        let by_photons = direct == Direct::Photons;
        assert_floor_is_lit_by(scene, &config, ALBEDO, &irradiance, &regions, by_photons, 1.0);
    }
}

/// Of an intensity of 1 at a height, with the cosine at the floor.
pub fn of_a_point(point: DVec3, height: f64) -> f64 {
    height / (height * height + point.length_squared()).powf(1.5)
}

#[test]
fn a_point_lights_a_floor_by_the_inverse_square_and_the_cosine() {
    let scene = floor_under(json!({"type": "point", "intensity": 20}), 1.5, 0.0);
    assert_lit(&scene, 0.2, |point| 20.0 * of_a_point(point, 1.5));
}

/// KHR_lights_punctual: times max(min(1 − (distance / range)⁴, 1), 0).
#[test]
fn a_range_takes_from_a_points_light_what_its_window_says() {
    let scene = floor_under(json!({"type": "point", "intensity": 20, "range": 2}), 1.5, 0.0);
    assert_lit(&scene, 0.1, |point| {
        let distance2 = 1.5 * 1.5 + point.length_squared();
        20.0 * of_a_point(point, 1.5) * (1.0 - (distance2 / 4.0).powi(2)).clamp(0.0, 1.0)
    });
}

/// A spotlight that points straight down: the square of a ramp in the cosine between its angles.
#[test]
fn a_spot_falls_off_between_its_angles() {
    let spot = json!({"type": "spot", "intensity": 20, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}});
    let scene = floor_under(spot, 1.5, -FRAC_PI_2);
    assert_lit(&scene, 0.05, |point| {
        let cosine = 1.5 / (1.5 * 1.5 + point.length_squared()).sqrt();
        let ramp = (cosine - 0.5_f64.cos()) / (0.2_f64.cos() - 0.5_f64.cos());
        20.0 * of_a_point(point, 1.5) * ramp.clamp(0.0, 1.0).powi(2)
    });
}

/// The falloff of Blender's spots.
#[test]
fn a_smooth_spot_falls_off_by_a_smoothstep() {
    let spot = json!({
        "type": "spot",
        "intensity": 20,
        "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5},
        "extensions": {"PPMVK_light_shape": {"smooth": true}},
    });
    let scene = floor_under(spot, 1.5, -FRAC_PI_2);
    assert_lit(&scene, 0.05, |point| {
        let cosine = 1.5 / (1.5 * 1.5 + point.length_squared()).sqrt();
        let ramp = ((cosine - 0.5_f64.cos()) / (0.2_f64.cos() - 0.5_f64.cos())).clamp(0.0, 1.0);
        20.0 * of_a_point(point, 1.5) * ramp * ramp * (3.0 - 2.0 * ramp)
    });
}

#[test]
fn a_directional_light_brings_its_lux_times_the_cosine() {
    // From straight down turned back by 30°.
    let scene = floor_under(
        json!({"type": "directional", "intensity": 5}),
        1.0,
        FRAC_PI_6 - FRAC_PI_2,
    );
    assert_lit(&scene, 0.1, |_| 5.0 * FRAC_PI_6.cos());
}

/// Camera paths follow so narrow a reflection, and no direction of theirs meets a point.
#[test]
fn polished_metal_shows_the_highlight_of_a_point() {
    const ROUGHNESS: f64 = 0.25;
    const F0: [f64; 3] = [0.9, 0.6, 0.3];
    let reflector = Reflector {
        f0: F0.into(),
        ..metal(ROUGHNESS * ROUGHNESS)
    };
    let material = metallic_roughness("metal", F0, 1.0, ROUGHNESS);
    assert_shows_highlights(|_| material, &Mesh::facing_up(1.5, 0.0), reflector, "polished");
}

/// The highlights of a point and of a sun on a floor that reflects like this.
pub fn assert_shows_highlights(
    material: impl FnOnce(&mut Document) -> Value,
    floor: &Mesh,
    reflector: Reflector,
    what: &str,
) {
    let mut scene = Document::new("highlight");
    let material = material(&mut scene);
    let metal = scene.material(material);
    let black = scene.material(matte("black", BLACK));
    scene.object("floor", floor, metal);
    // A light beside the punctual one, to choose between.
    scene.object("dark", &Mesh::facing_down(0.1, 2.0), black);
    let place = DVec3::new(0.2, 1.5, -1.4);
    let lamp = json!({"type": "point", "intensity": 20});
    scene.punctual(lamp).at(place.to_array());
    scene
        .punctual(json!({"type": "directional", "intensity": 3}))
        .rotated([1.0, 0.0, 0.0], -0.8);
    scene.camera([1.2, 1.2], [0.0, 0.0], 40.0);
    let scene = subject(scene);
    let sun = DVec3::new(0.0, 0.8_f64.sin(), 0.8_f64.cos());
    let radiance = |point: DVec3| {
        let v = (DVec3::new(0.0, 1.2, 1.2) - point).normalize();
        let to_lamp = place - point;
        let l = to_lamp.normalize();
        let by_lamp = reflector.brdf(DVec3::Y, v, l) * (20.0 * l.y / to_lamp.length_squared());
        by_lamp + reflector.brdf(DVec3::Y, v, sun) * 3.0 * sun.y
    };
    let regions = [Region::around([24, 24], 4), Region::around([24, 24], 16)];
    for (estimator, iterations) in [(Estimator::Sppm, 128), (Estimator::Ppm, 32)] {
        let settings = RenderConfig {
            estimator,
            ..config(Direct::Light, 100, 0.1)
        };
        let found = measure(&scene, settings, iterations, |image| {
            let read = |region: &Region| [0, 1, 2].map(|channel| region.of(image, channel));
            regions.iter().flat_map(read).collect()
        });
        for (index, found) in found.iter().enumerate() {
            let region = &regions[index / 3];
            let exact = region.mean(|pixel| match estimator {
                Estimator::Sppm => mean_on_floor(&scene, SIDE, pixel, |point| radiance(point)[index % 3]),
                Estimator::Ppm => {
                    let (origin, direction) = camera_ray(&scene, SIDE, pixel.map(|at| at as f64 + 0.5));
                    radiance(origin - direction * (origin.y / direction.y))[index % 3]
                }
            });
            let what = format!("{what}, {estimator:?}, {region:?}, channel {}", index % 3);
            // Sixteen places a pixel stand for its mean.
            found.assert_between(exact * 0.9995, exact * 1.0005, &what);
        }
    }
}

/// Straight light by a ray, and what a mirror above the light sends down by photons: no ray finds the light there. The floor's
/// albedo is small, so that what goes up from it and comes back is less than that part of it.
#[test]
fn a_mirror_over_a_point_light_adds_the_light_of_its_image() {
    const DARK: f64 = 1e-3;
    let mut scene = Document::new("mirrored-point");
    let grey = scene.material(matte("grey", [DARK; 3]));
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    scene.object("floor", &Mesh::facing_up(2.0, 0.0), grey);
    scene.object("mirror", &Mesh::facing_down(4.0, 1.5), mirror);
    scene
        .punctual(json!({"type": "point", "intensity": 20}))
        .at([0.0, 1.0, 0.0]);
    scene.camera([1.2, 1.2], [0.0, 0.0], 40.0);
    let scene = subject(scene);
    let irradiance = |point| 20.0 * (of_a_point(point, 1.0) + of_a_point(point, 2.0));
    let regions = [([24, 24], 20), ([10, 36], 8), ([38, 12], 8)].map(|(centre, side)| Region::around(centre, side));
    for direct in [Direct::Light, Direct::Photons] {
        let config = config(direct, 50_000, 0.15);
        assert_floor_is_lit_by(&scene, &config, DARK, irradiance, &regions, true, 1.0 + DARK);
    }
}

/// Irradiance of a floor by a picture that is black but for one pixel. Radiance is interpolated: around the pixel's centre it
/// falls to 0 over the width and the height of a pixel.
fn irradiance_by_pixel([width, height]: [usize; 2], row: usize, radiance: f64) -> f64 {
    const STEPS: u32 = 400;
    let step = 2.0 / f64::from(STEPS);
    let offsets = || (0..STEPS).map(move |i| (f64::from(i) + 0.5) * step - 1.0);
    let (width, height) = (width as f64, height as f64);
    let turns: f64 = offsets().map(|offset| 1.0 - offset.abs()).sum::<f64>() * step * 2.0 * PI / width;
    let falls: f64 = offsets()
        .map(|offset| {
            let rows = row as f64 + 0.5 + offset;
            // Past the uppermost centres nothing is left to interpolate with.
            let part = match rows {
                ..0.0 => 0.0,
                ..0.5 => 1.0,
                _ => 1.0 - offset.abs(),
            };
            let theta = PI * rows / height;
            part * theta.cos().max(0.0) * theta.sin() * step * PI / height
        })
        .sum();
    radiance * turns * falls
}

/// A picture of 16 × 8 pixels that is black but for one.
fn environment_of_one_pixel([column, row]: [usize; 2], radiance: f32) -> Environment {
    let mut pixels = vec![[0.0; 3]; 16 * 8];
    pixels[row * 16 + column] = [radiance; 3];
    Environment::new(Image::new(16, 8, pixels)).expect("an environment")
}

#[test]
fn one_bright_pixel_of_an_environment_lights_a_floor_as_its_integral_says() {
    for pixel in [[5, 2], [9, 0], [12, 3]] {
        let mut scene = Document::new("pixel");
        let grey = scene.material(matte("grey", [ALBEDO; 3]));
        scene.object("floor", &Mesh::facing_up(1.5, 0.0), grey);
        scene.camera([1.2, 1.2], [0.0, 0.0], 40.0);
        let scene = subject_under(scene, Some(environment_of_one_pixel(pixel, 100.0)));
        let expected = irradiance_by_pixel([16, 8], pixel[1], 100.0);
        assert_lit(&scene, 0.1, |_| expected);
    }
}

/// An environment's light that glass gathers on a floor comes by photons alone; all other light by rays or by photons, and
/// both are the same picture.
#[test]
fn an_environments_caustic_is_the_same_with_and_without_rays_to_it() {
    let mut scene = Document::new("caustic-afar");
    let grey = scene.material(matte("grey", [ALBEDO; 3]));
    let glass = scene.material(clear("glass", 1.5));
    scene.object("floor", &Mesh::facing_up(1.5, 0.0), grey);
    scene
        .object("glass", &Mesh::icosphere(0.4, 4), glass)
        .at([0.0, 0.6, 0.0]);
    scene.camera([1.2, 1.2], [0.0, 0.0], 40.0);
    let scene = subject_under(scene, Some(environment_of_one_pixel([0, 1], 100.0)));
    // The shadow with the caustic, a part of the floor beside it, and all of the floor that is seen past the sphere.
    let regions = [
        Region::around([24, 36], 10),
        Region::around([8, 24], 6),
        Region {
            columns: 2..46,
            rows: 26..46,
        },
    ];
    let read = |image: &Image| regions.iter().map(|region| region.of(image, 0)).collect::<Vec<_>>();
    // Paths that are aimed at the sphere go round in it now and then.
    let deep = |direct, photons| RenderConfig {
        max_depth: 256,
        ..config(direct, photons, 0.04)
    };
    let measured = [(Direct::Light, 20_000), (Direct::Photons, 50_000)]
        .map(|(direct, photons)| measure(&scene, deep(direct, photons), 64, read));
    for (by_rays, by_photons) in measured[0].iter().zip(&measured[1]) {
        // Photons blur the shadow's edge over a twelfth of its width: what goes in and out of a region is a small part of that.
        let slack = 0.01 * by_rays.mean + by_rays.chance();
        by_photons.assert_between(by_rays.mean - slack, by_rays.mean + slack, "the floor around a caustic");
    }
    let picture = |direct, seed| {
        let config = RenderConfig {
            seed,
            ..config(direct, 50_000, 0.04)
        };
        // The floor alone: the sun's faint images in the sphere are seen by chance, and bright.
        let picture = scene.render(32, config);
        Image::new(SIDE, 18, picture.pixels()[28 * SIDE..46 * SIDE].to_vec())
    };
    let pictures = [Direct::Light, Direct::Photons].map(|direct| [picture(direct, 0), picture(direct, 1)]);
    let rel_mse = |one: &Image, other: &Image| compare(one, other).expect("pictures of one size").rel_mse;
    // Two pictures by one way differ by their noise alone. Of 864 pixels' squared differences the mean is off by 5 %
    // (normal noise): 40 % are eight standard deviations.
    let noise = 0.5 * (rel_mse(&pictures[0][0], &pictures[0][1]) + rel_mse(&pictures[1][0], &pictures[1][1]));
    let difference = rel_mse(&pictures[1][0], &pictures[0][0]);
    println!("relMSE {difference}, of which {noise} is noise");
    assert!(
        difference < 1.4 * noise + 0.005,
        "relMSE {difference}, of which {noise} is noise"
    );
    let brightest = pictures[0][0]
        .pixels()
        .iter()
        .fold(0.0, |max, pixel| f64::max(max, pixel[0].into()));
    let open = measured[0][1].mean;
    assert!(
        brightest > 2.0 * open,
        "no caustic: {brightest} is not much above {open}"
    );
}

/// Two closed black rooms whose lamps have one radiance and areas of which one is 1e-8 of the other. In proportion to their
/// flux one photon in 10⁸ would leave the small one, and nothing be seen in its room.
#[test]
fn a_lamp_of_a_hundred_millionth_of_all_flux_lights_its_own_room() {
    const HEIGHT: f64 = 1.0;
    const RADIANCE: f64 = 1e8;
    const HALF_SIDE: f64 = 5e-5;
    let mut scene = Document::new("two-rooms");
    let grey = scene.material(matte("grey", [ALBEDO; 3]));
    let black = scene.material(matte("black", BLACK));
    let lamp = scene.material(light("lamp", [RADIANCE; 3]));
    for (x, half_side) in [(0.0, HALF_SIDE), (4.0, 0.5)] {
        scene
            .object("floor", &Mesh::facing_up(1.2, 0.0), grey)
            .at([x, 0.0, 0.0]);
        scene
            .object("ceiling", &Mesh::facing_down(1.3, HEIGHT + 0.2), black)
            .at([x, 0.0, 0.0]);
        for wall in walls(1.25, -0.1, HEIGHT + 0.3) {
            scene.object("wall", &wall, black).at([x, 0.0, 0.0]);
        }
        scene
            .object("lamp", &Mesh::facing_down(half_side, HEIGHT), lamp)
            .at([x, 0.0, 0.0]);
    }
    scene.camera([0.9, 0.9], [0.0, 0.0], 40.0);
    let scene = subject(scene);
    // As f32 has it: the lamp is so small that its corners are off by a thousandth of its side.
    let areas = (0..scene.scene.objects.len() as u32).map(|object| scene.scene.object_area(object));
    let area = areas.fold(f64::INFINITY, f64::min) / scene.scene.normalisation.scale.powi(2);
    assert!((area / (4.0 * HALF_SIDE * HALF_SIDE) - 1.0).abs() < 0.01, "{area}");
    let irradiance = |point: DVec3| {
        let distance2 = HEIGHT * HEIGHT + point.length_squared();
        RADIANCE * area * HEIGHT * HEIGHT / (distance2 * distance2)
    };
    let nearest = mean_on_floor(&scene, SIDE, [SIDE / 2, SIDE - 1], |point| point.z);
    assert!(
        nearest < 1.2,
        "the picture shows more than the floor, up to z = {nearest}"
    );
    let regions = [Region::around([24, 24], 20)];
    for (direct, photons) in [(Direct::Light, 100), (Direct::Photons, 50_000)] {
        let config: RenderConfig = config(direct, photons, 0.2);
        let by_photons = direct == Direct::Photons;
        // A surface as small as the lamp is placed in f32 a few 1e-4 of its side off.
        assert_floor_is_lit_by(&scene, &config, ALBEDO, irradiance, &regions, by_photons, 1.01);
    }
}
