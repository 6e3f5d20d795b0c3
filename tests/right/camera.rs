//! What cameras see, against geometry.

use std::f64::consts::PI;

use glam::{Vec3, dvec3};
use ppm_vk::backend::Backend;
use ppm_vk::config::RenderConfig;
use ppm_vk::cpu;
use ppm_vk::scene::{Environment, Projection};

use crate::document::{Document, light, matte, mirror, one_sided};
use crate::measure::{Region, measure};
use crate::mesh::Mesh;
use crate::picture::{Subject, small};
use crate::stage::{subject, subject_under};

const SIDE: usize = 48;

/// A shining rectangle before a black wall, seen along −z from (0, 0, 2); its far side is at x = 0 if it is a half.
fn shining(half: bool) -> Subject {
    let mut scene = Document::new("shining");
    let lamp = scene.material(light("lamp", [1.0; 3]));
    let black = scene.material(matte("black", [0.0; 3]));
    let quad = |left: f64, right: f64, low: f64, high: f64, z: f64| {
        Mesh::quad([[left, low], [right, low], [right, high], [left, high]].map(|[x, y]| dvec3(x, y, z)))
    };
    let lamp_quad = if half {
        quad(-2.0, 0.0, -2.0, 2.0, 1.0)
    } else {
        quad(-0.3, 0.5, -0.25, 0.5, 1.0)
    };
    scene.object("lamp", &lamp_quad, lamp);
    scene.object("wall", &quad(-2.0, 2.0, -2.0, 2.0, -1.0), black);
    scene.camera([0.0, 2.0], [0.0, 0.0], 40.0);
    subject(scene)
}

fn config() -> RenderConfig {
    RenderConfig {
        radius: Some(0.1),
        ..small(SIDE as u32, 100)
    }
}

/// The rectangle is 0.8 by 0.75 of 2 by 2, however far away.
#[test]
fn an_orthographic_picture_has_sizes_of_any_distance() {
    let mut subject = shining(false);
    let scale = subject.scene.normalisation.scale as f32;
    subject.scene.cameras[0].projection = Projection::Orthographic { half_height: scale };
    let measured = measure(&subject, config(), 32, |image| {
        vec![Region::around([SIDE / 2; 2], SIDE / 2).of(image, 0)]
    });
    measured[0].assert_is(0.8 * 0.75 / 4.0, "the rectangle's part of the picture");
}

/// Share of a disc beyond a line at so many radii from its centre.
fn cut_off(distance: f64) -> f64 {
    let t = distance.clamp(-1.0, 1.0);
    (t.acos() - t * (1.0 - t * t).sqrt()) / PI
}

/// A place (x, y) in focus at distance F sees through the lens's point l the half plane at distance D before it where
/// l (1 − D/F) + x D/F < 0: the share of the lens beyond −x D / (F − D).
#[test]
fn an_edge_out_of_focus_is_blurred_by_the_lens() {
    const RADIUS: f64 = 0.3;
    const FOCUS: f64 = 3.0;
    const DISTANCE: f64 = 1.0;
    let mut subject = shining(true);
    let lens = subject.scene.lens(&subject.scene.cameras[0], RADIUS, Some(FOCUS));
    subject.scene.cameras[0].lens = Some(lens.expect("a lens"));
    let column = |column: usize| Region {
        columns: column..column + 1,
        rows: 4..SIDE - 4,
    };
    let columns = [2, 14, 20, 23, 24, 28, 34, 45];
    let measured = measure(&subject, config(), 32, |image| {
        columns.iter().map(|&at| column(at).of(image, 0)).collect()
    });
    let width = FOCUS * 20f64.to_radians().tan();
    for (at, measured) in columns.into_iter().zip(measured) {
        let share = |inside: f64| {
            let x = ((at as f64 + inside) / SIDE as f64 * 2.0 - 1.0) * width;
            cut_off(x * DISTANCE / (FOCUS - DISTANCE) / RADIUS)
        };
        let expected = (0..16).map(|i| share((f64::from(i) + 0.5) / 16.0)).sum::<f64>() / 16.0;
        measured.assert_between(expected - 1e-3, expected + 1e-3, &format!("column {at}"));
    }
}

/// A black sheet that turns its back to the camera, in light of radiance 1 from everywhere, and again in a mirror.
#[test]
fn the_back_of_a_surface_with_one_side_is_seen_in_mirrors_alone() {
    const SIDE: u32 = 16;
    for (hidden, mirrored) in [(false, false), (true, false), (true, true)] {
        let mut scene = Document::new("sheet");
        let black = matte("black", [0.0; 3]);
        let sheet = scene.material(if hidden { one_sided(black) } else { black });
        let glass = scene.material(mirror("mirror", [1.0; 3]));
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
        let at = |z: f64| corners.map(|[x, y]| dvec3(x, y, z));
        // Both face away from the camera, or in the mirror's case towards it and away from the mirror.
        if mirrored {
            scene.object("mirror", &Mesh::quad(at(-1.0)).flipped(), glass);
            scene.object("sheet", &Mesh::quad(at(2.0)).flipped(), sheet);
        } else {
            scene.object("sheet", &Mesh::quad(at(0.0)), sheet);
        }
        scene.camera([0.0, 1.0], [0.0, 0.0], 20.0);
        let subject = subject_under(scene, Some(Environment::constant(Vec3::ONE)));
        let expected = if hidden && !mirrored { 1.0 } else { 0.0 };
        let config = small(SIDE, 100);
        let mut device = subject.renderer(config.clone());
        let mut twin = cpu::Renderer::new(&subject.packed, &subject.scene.cameras[0], config).expect("renderer");
        for renderer in [&mut device as &mut dyn Backend, &mut twin] {
            renderer.iterate().expect("an iteration");
            let image = renderer.resolve().expect("a picture");
            let wrong = image.pixels().iter().find(|pixel| **pixel != [expected; 3]);
            assert_eq!(
                wrong, None,
                "hidden {hidden}, in a mirror {mirrored}: {expected} expected"
            );
        }
    }
}
