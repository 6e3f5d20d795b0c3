//! Plates of glass and a layer of water against Fresnel's equations.
//!
//! Light is unpolarised at every boundary here, so a plate with reflectance F at each side passes (1 − F) / (1 + F), where F
//! is the mean over both polarisations. In nature each polarisation has a plate's transmittance of its own, and the mean
//! of those is larger.

use std::f64::consts::PI;

use glam::dvec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, EmissionChoice, Estimator, RenderConfig};
use ppm_vk::internals::layout::CAUSTIC;

use crate::document::{Document, clear, light, matte, mirror};
use crate::energy::{photon_lanes, xyz};
use crate::measure::{Measured, Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{camera_ray, subject, walls};

const GLASS: f64 = 1.5;
const WATER: f64 = 1.33;

/// Reflectance of the boundary from index `from` to index `to` for unpolarised light: Born and Wolf, «Principles of
/// Optics», section 1.5.2, by the angles of incidence and refraction.
fn fresnel(cos: f64, from: f64, to: f64) -> f64 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    if cos == 1.0 {
        return ((from - to) / (from + to)).powi(2);
    }
    if from * sin >= to {
        return 1.0;
    }
    let (i, t) = (sin.asin(), (from * sin / to).asin());
    let perpendicular = ((i - t).sin() / (i + t).sin()).powi(2);
    let parallel = ((i - t).tan() / (i + t).tan()).powi(2);
    0.5 * (perpendicular + parallel)
}

/// Integral over a range of s = sin²θ, of which diffuse light has equal parts in equal intervals.
fn diffuse_share(from: f64, to: f64, of: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 20_000;
    let width = (to - from) / f64::from(STEPS);
    let at = |step: u32| of((1.0 - from - (f64::from(step) + 0.5) * width).sqrt());
    (0..STEPS).map(at).sum::<f64>() * width
}

fn plate_transmittance(cos: f64) -> f64 {
    let f = fresnel(cos, 1.0, GLASS);
    (1.0 - f) / (1.0 + f)
}

/// A plate between a camera and a wall of green radiance 1; a red one behind the camera is seen by reflection.
fn plate(degrees: f64) -> Subject {
    let mut scene = Document::new("plate");
    let red = scene.material(light("red", [1.0, 0.0, 0.0]));
    let green = scene.material(light("green", [0.0, 1.0, 0.0]));
    let glass = scene.material(clear("glass", GLASS));
    scene.object(
        "red",
        &Mesh::facing(dvec3(0.0, 0.0, 2.0), dvec3(0.0, 0.0, 0.0), 50.0),
        red,
    );
    scene.object(
        "green",
        &Mesh::facing(dvec3(0.0, 0.0, -2.0), dvec3(0.0, 0.0, 0.0), 50.0),
        green,
    );
    let plate = Mesh::cuboid(dvec3(-60.0, -60.0, -1.1), dvec3(60.0, 60.0, -1.0));
    scene.object("plate", &plate, glass);
    scene.camera([0.0, 0.0], [degrees.to_radians().tan(), -1.0], 2.0);
    subject(scene)
}

/// The pixels are independent samples of the same ratio; in `ppm` one iteration's path is all that a pixel has.
#[test]
fn a_plate_of_glass_passes_and_reflects_what_fresnel_says() {
    const SIDE: usize = 48;
    for degrees in [0.0, 45.0, 75.0] {
        let plate = plate(degrees);
        for (estimator, iterations) in [(Estimator::Sppm, 64), (Estimator::Ppm, 1)] {
            let config = RenderConfig {
                estimator,
                radius: Some(1.0),
                ..small(SIDE as u32, 100)
            };
            let image = plate.render(iterations, config);
            let mut samples = [const { Vec::new() }; 2];
            for (pixel, [red, green, _]) in image.pixels().iter().enumerate() {
                let centre = [(pixel % SIDE) as f64 + 0.5, (pixel / SIDE) as f64 + 0.5];
                let transmittance = plate_transmittance(-camera_ray(&plate, SIDE, centre).1.z);
                samples[0].push(f64::from(*green) / transmittance);
                samples[1].push(f64::from(*red) / (1.0 - transmittance));
            }
            for (samples, way) in samples.into_iter().zip(["transmitted", "reflected"]) {
                let what = format!("{way} at {degrees}° by {estimator:?}, relative to Fresnel");
                Measured::of(samples).assert_is(1.0, &what);
            }
        }
    }
}

/// A plate from wall to wall of a shaft, whose walls are perfect mirrors: the same as a plate without end. A photon comes
/// to the floor as steeply as it left the ceiling, so its direction says at which angle it met the plate.
#[test]
fn photons_pass_a_plate_as_fresnel_says_at_every_angle() {
    const PATHS: u32 = 262_144;
    const BINS: usize = 8;
    // Where paths bounce between the walls for long, 64 times are too few.
    const STEEPEST: f64 = 0.95;
    let mut scene = Document::new("shaft");
    let lamp = scene.material(light("lamp", [1.0; 3]));
    let black = scene.material(matte("black", [0.0; 3]));
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    let glass = scene.material(clear("glass", GLASS));
    scene.object("floor", &Mesh::facing_up(5.2, 0.0), black);
    scene.object("ceiling", &Mesh::facing_down(5.0, 2.0), lamp);
    for wall in walls(5.0, -0.1, 2.1) {
        scene.object("wall", &wall, mirror);
    }
    scene.object(
        "plate",
        &Mesh::cuboid(dvec3(-5.2, 0.9, -5.2), dvec3(5.2, 1.1, 5.2)),
        glass,
    );
    scene.camera([1.5, 4.0], [0.0, 0.0], 40.0);
    let shaft = subject(scene);
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.1),
        drop_unwanted: false,
        emission: EmissionChoice::Power,
        ..small(8, PATHS)
    };
    let mut renderer = shaft.renderer(config);
    renderer.iterate().expect("iteration");
    let mut counts = [[0.0; 2]; BINS];
    let floor = shaft
        .scene
        .objects
        .iter()
        .position(|object| object.name == "floor")
        .expect("a floor");
    for photon in photon_lanes(&mut renderer).iter().flatten() {
        let cos = ppm_vk::internals::cpu::decode_direction(photon.direction).y;
        let bin = ((1.0 - cos * cos) / STEEPEST * BINS as f64) as usize;
        if bin < BINS {
            counts[bin][usize::from(photon.object & !CAUSTIC == floor as u32)] += 1.0;
        }
        assert!(xyz(photon.flux).min_element() > 0.0, "a photon without flux");
    }
    for (bin, [reflected, transmitted]) in counts.into_iter().enumerate() {
        let [from, to] = [bin, bin + 1].map(|edge| STEEPEST * edge as f64 / BINS as f64);
        let expected = diffuse_share(from, to, plate_transmittance) / (to - from);
        let count: f64 = reflected + transmitted;
        // A binomial number, with its known deviation; all photons have the same flux.
        let error = (expected * (1.0 - expected) / count).sqrt();
        let found = transmitted / count;
        println!("sin² from {from:.2} to {to:.2}: {found:.4} ± {error:.4} of {count} pass, {expected:.4} expected");
        assert!(
            (found - expected).abs() < 5.8 * error,
            "sin² from {from} to {to}: {found} of the photons pass the plate, {expected} expected"
        );
    }
}

/// A grey floor under water under a luminous ceiling, without end thanks to walls that are perfect mirrors. Of the ceiling's
/// πL the share 1 − R enters the water, and of what the floor reflects, R' is sent back to it, R and R' being diffuse
/// reflectances from above and from below. Radiance ρE / π comes out divided by n²: without that the floor would be n²,
/// 1.77, times too bright.
fn assert_floor_under_water_is_as_bright_as_etendue_says(bottom: f64) {
    const SIDE: usize = 48;
    const ALBEDO: f64 = 0.5;
    let mut scene = Document::new("water");
    let lamp = scene.material(light("lamp", [1.0; 3]));
    let grey = scene.material(matte("grey", [ALBEDO; 3]));
    let mirror = scene.material(mirror("mirror", [1.0; 3]));
    let water = scene.material(clear("water", WATER));
    scene.object("floor", &Mesh::facing_up(2.0, 0.0), grey);
    scene.object("ceiling", &Mesh::facing_down(2.0, 2.0), lamp);
    for wall in walls(2.0, -0.1, 2.1) {
        scene.object("wall", &wall, mirror);
    }
    scene.object(
        "water",
        &Mesh::cuboid(dvec3(-2.05, bottom, -2.05), dvec3(2.05, 0.4, 2.05)),
        water,
    );
    scene.camera([1.6, 0.8], [0.4, 0.0], 25.0);
    let scene = subject(scene);
    let from_above = diffuse_share(0.0, 1.0, |cos| fresnel(cos, 1.0, WATER));
    let from_below = diffuse_share(0.0, 1.0, |cos| fresnel(cos, WATER, 1.0));
    let irradiance = PI * (1.0 - from_above) / (1.0 - ALBEDO * from_below);
    let all = Region::around([SIDE / 2; 2], SIDE / 2);
    let expected = all.mean(|[column, row]| {
        let (_, direction) = camera_ray(&scene, SIDE, [column as f64 + 0.5, row as f64 + 0.5]);
        let reflected = fresnel(-direction.y, 1.0, WATER);
        reflected + (1.0 - reflected) * ALBEDO / PI * irradiance / (WATER * WATER)
    });
    // What is seen lies more than the radius from the floor's rim: nothing is lost there.
    let config = RenderConfig {
        radius: Some(0.1),
        // Light that the water holds back goes far between the walls.
        max_depth: 512,
        ..small(SIDE as u32, 40_000)
    };
    let measured = measure(&scene, config, 32, |image| vec![all.of(image, 0)]);
    measured[0].assert_is(expected, &format!("the floor under water that begins at {bottom}"));
}

#[test]
fn a_floor_seen_through_water_is_as_bright_as_etendue_says() {
    assert_floor_under_water_is_as_bright_as_etendue_says(-0.05);
}

/// Rays meet the water's own lower side or the floor there, whichever rounding puts first.
#[test]
fn a_floor_on_which_water_lies_is_as_bright_as_etendue_says() {
    assert_floor_under_water_is_as_bright_as_etendue_says(0.0);
}
