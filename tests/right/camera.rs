//! What cameras see, against geometry.

use std::f64::consts::PI;

use glam::{Vec2, Vec3, dvec3};
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::cpu;
use ppm_vk::internals::film::Image;
use ppm_vk::internals::scene::{Environment, Projection};

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

/// The chance by which the hidden back isn't there is another one than that of what lies behind it.
#[test]
fn half_a_sheet_behind_the_hidden_back_of_another_shows_half() {
    const SIDE: usize = 16;
    let half = |mut material: serde_json::Value| {
        material["alphaMode"] = "BLEND".into();
        material["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.5.into();
        material
    };
    let mut scene = Document::new("sheets");
    let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
    let at = |z: f64| Mesh::quad(corners.map(|[x, y]| dvec3(x, y, z)));
    let hidden = scene.material(half(one_sided(matte("hidden", [0.0; 3]))));
    let black = scene.material(half(matte("black", [0.0; 3])));
    scene.object("hidden", &at(0.0), hidden);
    scene.object("black", &at(-0.1), black);
    scene.camera([0.0, 1.0], [0.0, 0.0], 20.0);
    let subject = subject_under(scene, Some(Environment::constant(Vec3::ONE)));
    let all = Region::around([SIDE / 2; 2], SIDE / 2);
    let measured = measure(&subject, small(SIDE as u32, 100), 64, |image| vec![all.of(image, 0)]);
    measured[0].assert_is(0.5, "half a black sheet before radiance 1");
}

/// A picture twice as wide as high: its larger side is its width, and shifted by a quarter of that, a quarter of its columns or
/// half of its rows leave it.
#[test]
fn a_shift_moves_the_film_by_parts_of_its_larger_side() {
    let mut subject = shining(false);
    let scale = subject.scene.normalisation.scale as f32;
    let perspective = subject.scene.cameras[0].projection;
    for projection in [perspective, Projection::Orthographic { half_height: scale }] {
        subject.scene.cameras[0].projection = projection;
        let mut render = |shift: Vec2, iterations: u32| {
            subject.scene.cameras[0].shift = shift;
            let config = RenderConfig {
                resolution: [32, 16],
                ..config()
            };
            subject.render(iterations, config)
        };
        let still = render(Vec2::ZERO, 1);
        let moved = render(Vec2::new(0.25, -0.25), 1);
        let (mut same, mut compared) = (0, 0);
        for (x, y) in (0..24).flat_map(|x| (0..8).map(move |y| (x, y))) {
            let at = |image: &Image, x: usize, y: usize| image.pixels()[y * 32 + x];
            let (a, b) = (at(&still, x + 8, y + 8), at(&moved, x, y));
            // At the rectangle's edges each pixel has its own random numbers.
            if a == [0.0; 3] || a == [1.0; 3] {
                compared += 1;
                same += usize::from(a == b);
            }
        }
        assert!(
            compared > 150 && same > compared - 20,
            "{projection:?}: {same} of {compared}"
        );
    }
}

/// A map whose left half shines, seen along −z, where its edges meet: −x lies left of that, and shines.
#[test]
fn a_rotated_environment_turns_from_z_to_x() {
    let map = || {
        let pixel = |i: usize| [if i % 64 < 32 { 1.0 } else { 0.25 }; 3];
        Environment::new(Image::new(64, 32, (0..64 * 32).map(pixel).collect())).expect("an environment")
    };
    // The map's left half is the side of +x, unrotated; its middle line between the halves is +z.
    for (degrees, left, right) in [
        (0.0, 0.25, 1.0),
        (180.0, 1.0, 0.25),
        (90.0, 1.0, 1.0),
        (-90.0, 0.25, 0.25),
    ] {
        let mut scene = Document::new("sky");
        let black = scene.material(matte("black", [0.0; 3]));
        scene.object(
            "dot",
            &Mesh::quad([[-1.0, -1.0], [1.0, -1.0], [1.0, -0.99], [-1.0, -0.99]].map(|[x, y]| dvec3(x, y, -9.0))),
            black,
        );
        scene.camera([0.0, 2.0], [0.0, 0.0], 20.0);
        let subject = subject_under(scene, Some(map().rotated(degrees)));
        let image = subject.render(1, small(16, 100));
        for (column, expected) in [(2, left), (13, right)] {
            let seen = image.pixels()[2 * 16 + column][0];
            assert!(
                (seen - expected).abs() < 1e-5,
                "{degrees}°, column {column}: {seen}, not {expected}"
            );
        }
    }
}
