//! A prism parts white light.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, dvec2, dvec3};
use ppm_vk::internals::config::{Direct, EmissionChoice, RenderConfig};
use ppm_vk::internals::layout::{CAUSTIC, Photon};
use serde_json::json;

use crate::document::{Document, clear, matte};
use crate::energy::{PATHS, on_both, xyz};
use crate::measure::Measured;
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::subject;

const IOR: f64 = 1.5;
const DISPERSION: f64 = 2.0;
/// Shortest and longest wavelength that paths have, nm.
const ENDS: [f64; 2] = [400.0, 700.0];
/// Where the wall stands along the beam, and half its height.
const WALL: f64 = 3.0;
const HALF_HEIGHT: f64 = 4.0;
/// Where the beam enters, and its angle above the horizon: at 1.5 the light crosses the prism horizontally.
const ENTRY: DVec2 = dvec2(-0.25, 0.433_012_7);
const BEAM: f64 = 48.590_378 - 30.0;

/// Along the beam and up, to three dimensions.
fn place(x: f64, at: DVec2) -> DVec3 {
    dvec3(x, at.y, -at.x)
}

/// An equilateral prism in a narrow beam of white light, before a wall.
fn prism() -> Subject {
    let mut scene = Document::new("prism");
    let mut glass = clear("glass", IOR);
    glass["extensions"]["KHR_materials_dispersion"] = json!({ "dispersion": DISPERSION });
    let glass = scene.material(glass);
    let wall = scene.material(matte("wall", [0.0; 3]));
    let side = |left: f64, from: DVec2, to: DVec2| {
        Mesh::quad([place(left, from), place(-left, from), place(-left, to), place(left, to)])
    };
    let [near, far, top] = [dvec2(-0.5, 0.0), dvec2(0.5, 0.0), dvec2(0.0, 0.866_025_4)];
    scene.object("entry", &side(-1.0, near, top), glass);
    scene.object("exit", &side(1.0, far, top), glass);
    scene.object("bottom", &side(-1.0, far, near), glass);
    let screen = side(-4.0, dvec2(WALL, -HALF_HEIGHT), dvec2(WALL, HALF_HEIGHT));
    scene.object("wall", &screen, wall);
    let angle = BEAM.to_radians();
    let spot = json!({"type": "spot", "intensity": 1e6, "spot": {"innerConeAngle": 0.0, "outerConeAngle": 0.001}});
    let from = place(0.0, ENTRY - 1.5 * dvec2(angle.cos(), angle.sin()));
    scene.punctual(spot).at(from.to_array()).rotated([1.0, 0.0, 0.0], angle);
    scene.camera([0.5, 3.0], [0.5, 0.0], 40.0);
    subject(scene)
}

fn refract(incoming: DVec2, normal: DVec2, eta: f64) -> DVec2 {
    let cosine = -incoming.dot(normal);
    let sine2 = eta * eta * (1.0 - cosine * cosine);
    eta * incoming + (eta * cosine - (1.0 - sine2).sqrt()) * normal
}

/// Height at which the beam's axis meets the wall, by Snell and Cauchy: KHR_materials_dispersion, with the Fraunhofer lines d, F, C.
fn height(wavelength: f64) -> f64 {
    let inverse2 = |nanometres: f64| nanometres.powi(-2);
    let part = (inverse2(wavelength) - inverse2(587.56)) / (inverse2(486.13) - inverse2(656.27));
    let ior = IOR + (IOR - 1.0) * DISPERSION / 20.0 * part;
    let angle = BEAM.to_radians();
    let [entry, exit] = [dvec2(-0.75f64.sqrt(), 0.5), dvec2(0.75f64.sqrt(), 0.5)];
    let inside = refract(dvec2(angle.cos(), angle.sin()), entry, 1.0 / ior);
    // To the exit's plane, which goes through (0.5, 0).
    let t = (dvec2(0.5, 0.0) - ENTRY).dot(exit) / inside.dot(exit);
    let out = ENTRY + t * inside;
    let beyond = refract(inside, -exit, ior);
    out.y + (WALL - out.x) * beyond.y / beyond.x
}

#[test]
fn a_prism_spreads_white_light_as_snell_says_and_keeps_it_white() {
    let prism = prism();
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.05),
        drop_unwanted: false,
        emission: EmissionChoice::Power,
        ..small(8, PATHS)
    };
    for (place, lanes) in on_both(&prism, &config) {
        assert_spectrum(&prism, place, &lanes);
    }
}

fn assert_spectrum(prism: &Subject, place: &str, lanes: &[Vec<Photon>]) {
    let wall = prism
        .scene
        .objects
        .iter()
        .position(|object| object.name == "wall")
        .expect("a wall") as u32;
    let normalisation = prism.scene.normalisation;
    let [low, high] = ENDS.map(height);
    println!("{place}: from {low:.4} to {high:.4} expected");
    assert!(high - low > 0.2, "the spectrum is {} high", high - low);
    // The beam is 0.001 rad wide to each side, 5 m long.
    let blur = 0.006;
    let mut spectrum: Vec<(f64, DVec3)> = Vec::new();
    let mut colors: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for lane in lanes {
        let mut sum = DVec3::ZERO;
        for photon in lane.iter().filter(|photon| photon.object & !CAUSTIC == wall) {
            let y = xyz(photon.position).y / normalisation.scale + normalisation.centre.y;
            if (low - 0.1..high + 0.1).contains(&y) {
                spectrum.push((y, xyz(photon.flux)));
                sum += xyz(photon.flux);
            }
        }
        colors[0].push(sum.x - sum.y);
        colors[1].push(sum.z - sum.y);
    }
    spectrum.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (first, last) = (spectrum[0].0, spectrum[spectrum.len() - 1].0);
    println!("{} photons from {first:.4} to {last:.4}", spectrum.len());
    assert!(
        (first - low).abs() < blur && (last - high).abs() < blur,
        "{first} to {last}"
    );
    // Red is bent least, blue most.
    let centre = |channel: usize| {
        let (sum, all) = spectrum.iter().fold((0.0, 0.0), |(sum, all), (y, flux)| {
            (sum + y * flux[channel], all + flux[channel])
        });
        sum / all
    };
    let [red, green, blue] = [0, 1, 2].map(centre);
    println!("red {red:.4}, green {green:.4}, blue {blue:.4}");
    let spread = high - low;
    assert!(
        red > green + 0.1 * spread && green > blue + 0.1 * spread,
        "{red}, {green}, {blue}"
    );
    // All colours together are white: what Fresnel lets through differs by less than 2 % between the ends.
    let whole = PI * 1e6 * 1e-6 / 3.0;
    for (samples, what) in colors.into_iter().zip(["red less green", "blue less green"]) {
        Measured::of(samples).assert_between(-0.02 * whole, 0.02 * whole, what);
    }
}
