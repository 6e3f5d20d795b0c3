//! A matte ball in a room whose walls emit and reflect nothing. The ball is convex, so that it receives only the walls' light: π
//! · L on every part of its surface. Its radiance is albedo · L everywhere.

use std::f64::consts::PI;

use glam::Vec3;
use ppm_vk::internals::config::{Direct, EmissionChoice, RenderConfig};
use ppm_vk::internals::scene::Scene;

use super::bench::object;
use super::model::Model;
use super::sound::{assert_mean, render, square};

const ALBEDO: f32 = 0.5;

/// Adds a room of this half width, with a ball of a third of it in the middle and a camera that sees nothing else.
pub fn add_ball_in_room(model: &mut Model, centre: Vec3, half: f32, radiance: f32) {
    let walls = model.black(radiance);
    model.room(walls, centre - half, centre + half);
    add_ball(model, centre, half / 3.0);
}

/// Adds such a ball, and a camera that sees nothing else.
pub fn add_ball(model: &mut Model, centre: Vec3, radius: f32) {
    let ball = model.matte([ALBEDO; 3], 0.0);
    model.sphere(ball, centre, radius, false);
    model.camera(
        centre + Vec3::new(0.3, 0.5, 1.0).normalize() * (2.8 * radius),
        centre,
        0.3,
    );
}

/// The visible radiance of the ball. Each pixel draws its own light samples, so that the pixels are independent of each other.
#[track_caller]
pub fn assert_lit_by_shadow_rays(what: &str, scene: &Scene, camera: usize, radiance: f32) {
    let rendered = render(scene, camera, 8, square(64, 1000));
    let pixels = rendered.image.pixels().iter();
    let samples: Vec<f64> = pixels.map(|pixel| f64::from(pixel[0] / radiance)).collect();
    assert_mean(&format!("{what}, by shadow rays"), &samples, ALBEDO.into(), 1e-6);
}

/// Flux that photons carry to the balls, in the order of the objects. Paths are independent of each other, and each carries one
/// photon to a ball, or none.
#[track_caller]
pub fn assert_lit_by_photons(what: &str, scene: &Scene, radiances: &[f32]) {
    const PATHS: u32 = 100_000;
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.05 / scene.normalisation.scale),
        drop_unwanted: false,
        emission: EmissionChoice::Power,
        ..square(8, PATHS)
    };
    let photons = render(scene, 0, 1, config).photons();
    let balls: Vec<u32> = (0..)
        .zip(&scene.objects)
        .filter(|(_, ball)| ball.triangles.len() > 2)
        .map(|(ball, _)| ball)
        .collect();
    assert_eq!(balls.len(), radiances.len(), "balls");
    for (ball, radiance) in balls.into_iter().zip(radiances) {
        let received = PI * f64::from(*radiance) * scene.object_area(ball);
        let on_ball = photons.iter().filter(|photon| object(photon.object) == Some(ball));
        let mut samples: Vec<f64> = on_ball.map(|photon| f64::from(photon.flux[0]) / received).collect();
        samples.resize(PATHS as usize, 0.0);
        assert_mean(
            &format!("{what}, in light of {radiance:e}, by photons"),
            &samples,
            1.0,
            1e-6,
        );
    }
}
