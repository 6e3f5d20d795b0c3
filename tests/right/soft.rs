//! Suns, points and spots with an extent, in closed form: what they light, the edges of their shadows, and their images.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};

use glam::DVec3;
use ppm_vk::internals::config::{Direct, RenderConfig};
use ppm_vk::internals::cpu::Reflector;
use serde_json::{Value, json};

use crate::document::{Document, clear, matte, metallic_roughness, mirror};
use crate::lamp::{SIDE, config};
use crate::lights::{ALBEDO, BLACK, assert_lit, floor_under, of_a_point};
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{mean_on_floor, subject};

/// Gives all punctual lights an extent: a radius in scene units, or half of an angle.
fn soften(subject: Subject, extent: f64) -> Subject {
    let mut scene = subject.scene;
    let scale = scene.normalisation.scale;
    for light in &mut scene.lights {
        let is_sun = matches!(light.kind, ppm_vk::internals::scene::LightKind::Directional { .. });
        light.extent = if is_sun { extent } else { extent * scale };
    }
    Subject::of(scene)
}

/// Unit vectors spread evenly over a cone around an axis, with 1 − cos of its angle.
fn in_cone(axis: DVec3, versine: f64) -> impl Iterator<Item = DVec3> {
    const STEPS: u32 = 24;
    let across = axis.any_orthonormal_vector();
    let other = axis.cross(across);
    (0..STEPS * STEPS).map(move |i| {
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let cos = 1.0 - versine * at(i / STEPS);
        // Turned from ring to ring, so that no straight edge meets many at once.
        let phi = 2.0 * PI * (at(i % STEPS) + 0.618 * f64::from(i / STEPS));
        let sin = (1.0 - cos * cos).sqrt();
        axis * cos + (across * phi.cos() + other * phi.sin()) * sin
    })
}

/// The integral over the directions in which a ball is seen, of its radiance where its intensity is 1.
fn over_ball(centre: DVec3, radius: f64, point: DVec3, value: impl Fn(DVec3) -> f64) -> f64 {
    let way = centre - point;
    let versine = 1.0 - (1.0 - radius * radius / way.length_squared()).sqrt();
    let (sum, count) =
        in_cone(way.normalize(), versine).fold((0.0, 0.0), |(sum, count), l| (sum + value(l), count + 1.0));
    sum / count * 2.0 * versine / (radius * radius)
}

fn point(intensity: f64) -> Value {
    json!({"type": "point", "intensity": intensity})
}

fn sun(irradiance: f64) -> Value {
    json!({"type": "directional", "intensity": irradiance})
}

/// A ball that is all above the floor lights it as its middle would.
#[test]
fn a_ball_lights_a_floor_by_the_inverse_square_and_the_cosine() {
    let scene = soften(floor_under(point(20.0), 1.5, 0.0), 0.5);
    assert_lit(&scene, 0.2, |point| 20.0 * of_a_point(point, 1.5));
}

#[test]
fn a_sun_with_an_angle_brings_its_lux_times_the_cosine() {
    let scene = soften(floor_under(sun(5.0), 1.0, FRAC_PI_6 - FRAC_PI_2), 10f64.to_radians());
    assert_lit(&scene, 0.1, |_| 5.0 * FRAC_PI_6.cos());
}

#[test]
fn a_spot_with_a_radius_falls_off_by_the_angle_of_each_ray() {
    let spot = json!({"type": "spot", "intensity": 20, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.6}});
    let scene = soften(floor_under(spot, 1.5, -FRAC_PI_2), 0.2);
    assert_lit(&scene, 0.05, |point| {
        let falloff = |l: DVec3| {
            ((l.y - 0.6_f64.cos()) / (0.1_f64.cos() - 0.6_f64.cos()))
                .clamp(0.0, 1.0)
                .powi(2)
        };
        20.0 * over_ball(DVec3::Y * 1.5, 0.2, point, |l| l.y * falloff(l))
    });
}

/// A black sheet over the half of a floor where x > 0, from below.
fn half_covered(light: Value, height: f64) -> Subject {
    let mut scene = Document::new("penumbra");
    let grey = scene.material(matte("grey", [ALBEDO; 3]));
    let black = scene.material(matte("black", BLACK));
    scene.object("floor", &Mesh::facing_up(1.5, 0.0), grey);
    let corners = [[0.0, -3.0], [3.0, -3.0], [3.0, 3.0], [0.0, 3.0]].map(|[x, z]| DVec3::new(x, SHEET, z));
    scene.object("sheet", &Mesh::quad(corners), black);
    scene
        .punctual(light)
        .at([0.0, height, 0.0])
        .rotated([1.0, 0.0, 0.0], -FRAC_PI_2);
    scene.camera([0.6, 1.6], [0.0, 0.0], 40.0);
    subject(scene)
}

/// Height of the sheet.
const SHEET: f64 = 0.8;

fn assert_penumbra(scene: &Subject, irradiance: impl Fn(DVec3) -> f64) {
    const RADIUS: f64 = 0.02;
    let columns = [10, 18, 21, 24, 27, 34].map(|column| Region {
        columns: column..column + 2,
        rows: 18..38,
    });
    for (direct, photons, iterations) in [(Direct::Light, 100, 128), (Direct::Photons, 100_000, 64)] {
        let settings = config(direct, photons, RADIUS);
        let measured = measure(scene, settings, iterations, |image| {
            columns.iter().map(|region| region.of(image, 0)).collect()
        });
        for (measured, region) in measured.iter().zip(&columns) {
            let mean = |value: &dyn Fn(DVec3) -> f64| {
                ALBEDO / PI * region.mean(|pixel| mean_on_floor(scene, SIDE, pixel, value))
            };
            // Photons blur by their radius; the sum over directions is right to a hundredth of the whole.
            let [low, high] = [RADIUS, -RADIUS].map(|shift| mean(&|point| irradiance(point + DVec3::X * shift)));
            let slack = 0.01 * ALBEDO / PI * irradiance(-DVec3::X);
            let what = format!("{direct:?}, columns {:?}", region.columns);
            measured.assert_between(low - slack, high + slack, &what);
        }
    }
}

#[test]
fn the_edge_of_a_ball_lights_shadow_is_as_wide_as_geometry_says() {
    const HEIGHT: f64 = 2.0;
    let scene = soften(half_covered(point(20.0), HEIGHT), 0.3);
    assert_penumbra(&scene, |point| {
        let seen = |l: DVec3| if point.x + l.x / l.y * SHEET < 0.0 { l.y } else { 0.0 };
        20.0 * over_ball(DVec3::Y * HEIGHT, 0.3, point, seen)
    });
}

#[test]
fn the_edge_of_a_suns_shadow_is_as_wide_as_its_angle_says() {
    let half_angle = 12f64.to_radians();
    let scene = soften(half_covered(sun(5.0), 1.0), half_angle);
    assert_penumbra(&scene, |point| {
        let directions = in_cone(DVec3::Y, 1.0 - half_angle.cos());
        let (mut seen, mut all) = (0.0, 0.0);
        for l in directions {
            all += l.y;
            seen += if point.x + l.x / l.y * SHEET < 0.0 { l.y } else { 0.0 };
        }
        5.0 * seen / all
    });
}

/// A picture without perspective of 2 by 2: the mean of a ball's radiance is its intensity over 4, however it comes there.
#[test]
fn a_ball_light_is_seen_by_the_camera_in_mirrors_and_behind_glass() {
    const SIDE: usize = 32;
    let passed = 0.96_f64 / 1.04;
    for (what, behind, surface, expected) in [
        ("by itself", false, None, 1.0),
        ("in a mirror", true, Some(mirror("mirror", [1.0; 3])), 1.0),
        ("through glass", false, Some(clear("glass", 1.5)), passed),
        ("in glass", true, Some(clear("glass", 1.5)), 1.0 - passed),
    ] {
        let mut scene = Document::new("image");
        let black = scene.material(matte("black", BLACK));
        scene.object(
            "wall",
            &Mesh::quad([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]].map(|[x, y]| DVec3::new(x, y, -3.0))),
            black,
        );
        if let Some(material) = surface {
            let material = scene.material(material);
            scene.object(
                "surface",
                &Mesh::cuboid(DVec3::new(-2.0, -2.0, -0.1), DVec3::new(2.0, 2.0, 0.1)),
                material,
            );
        }
        scene
            .punctual(point(20.0))
            .at([0.1, 0.2, if behind { 4.0 } else { -1.5 }]);
        scene.parallel_camera([0.0, 2.0], [0.0, 0.0], 1.0);
        let scene = soften(subject(scene), 0.4);
        let all = Region::around([SIDE / 2; 2], SIDE / 2);
        let measured = measure(
            &scene,
            RenderConfig {
                radius: Some(0.1),
                ..small(SIDE as u32, 100)
            },
            64,
            |image| vec![all.of(image, 0)],
        );
        measured[0].assert_is(20.0 / 4.0 * expected, what);
    }
}

/// Radiance of a sun of irradiance E and half an angle a: E / (π sin² a).
#[test]
fn a_sun_with_an_angle_is_seen_in_a_mirror() {
    let half_angle = 6f64.to_radians();
    let mut scene = Document::new("image");
    let mirror = scene.material(mirror("mirror", [0.5; 3]));
    scene.object("mirror", &Mesh::facing_up(2.0, 0.0), mirror);
    // Straight down, as the camera looks.
    scene.punctual(sun(5.0)).rotated([1.0, 0.0, 0.0], -FRAC_PI_2);
    scene.camera([1.0, 1e-3], [0.0, 0.0], 30.0);
    let scene = soften(subject(scene), half_angle);
    let [inside, outside] = [([24, 24], 4), ([5, 5], 4)].map(|(middle, side)| Region::around(middle, side));
    let measured = measure(&scene, config(Direct::Light, 100, 0.1), 32, |image| {
        [&inside, &outside].iter().map(|region| region.of(image, 0)).collect()
    });
    measured[0].assert_is(0.5 * 5.0 / (PI * half_angle.sin().powi(2)), "the disc in the mirror");
    measured[1].assert_is(0.0, "beside it");
}

/// Camera paths follow so narrow a reflection, which may meet the ball or not: a ray to it has brought its light already.
#[test]
fn polished_metal_shows_the_highlight_of_a_ball_once() {
    const ROUGHNESS: f64 = 0.25;
    const RADIUS: f64 = 0.15;
    let mut scene = Document::new("highlight");
    let metal = scene.material(metallic_roughness("metal", [0.9; 3], 1.0, ROUGHNESS));
    scene.object("floor", &Mesh::facing_up(1.5, 0.0), metal);
    let place = DVec3::new(0.2, 1.5, -1.4);
    scene.punctual(point(20.0)).at(place.to_array());
    scene.camera([1.2, 1.2], [0.0, 0.0], 40.0);
    let scene = soften(subject(scene), RADIUS);
    let reflector = Reflector {
        diffuse: DVec3::ZERO,
        f0: DVec3::splat(0.9),
        f90: 1.0,
        over_base: [0.0; 2],
        coat: 0.0,
        sheen: Default::default(),
        along: None,
        alpha: ROUGHNESS * ROUGHNESS,
    };
    // All of it, and its parts, since a wrong place on the ball moves light between them.
    let parts = [[16, 16], [32, 16], [16, 32], [32, 32]].map(|middle| Region::around(middle, 8));
    let regions = [&parts[..], &[Region::around([24, 24], 16)]].concat();
    let found = measure(&scene, config(Direct::Light, 100, 0.1), 128, |image| {
        regions.iter().map(|region| region.of(image, 0)).collect()
    });
    for (region, found) in regions.iter().zip(found) {
        let exact = region.mean(|pixel| {
            mean_on_floor(&scene, SIDE, pixel, |point| {
                let v = (DVec3::new(0.0, 1.2, 1.2) - point).normalize();
                20.0 * over_ball(place, RADIUS, point, |l| reflector.brdf(DVec3::Y, v, l).x * l.y)
            })
        });
        found.assert_between(exact * 0.999, exact * 1.001, &format!("the highlight, {region:?}"));
    }
}
