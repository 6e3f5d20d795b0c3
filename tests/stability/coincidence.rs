//! Coincident faces: which of them a ray hits does not depend on chance.

use glam::Vec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Accel, Direct, RenderConfig, TriangleTest};
use ppm_vk::internals::cpu;
use ppm_vk::internals::film::Image;
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use super::model::{Model, parallelogram};
use super::sound::{render, square};

/// Rotated, so that the coordinates use all their bits, or with all corners of a face on one coordinate.
const TURNS: [[f64; 4]; 2] = [[0.0, 0.0, 0.0, 1.0], [0.1825742, 0.3651484, 0.5477226, 0.7302967]];

/// Mean red of pictures of a scene, with a description of each: by kernels with both hierarchies and triangle tests, and by the
/// CPU renderer; with direct light by light samples and by photons.
fn pictures(scene: &Scene) -> Vec<(String, f64)> {
    let packed = PackedScene::new(scene).expect("packed scene");
    let mean = |image: &Image| {
        let sum: f64 = image.pixels().iter().map(|pixel| f64::from(pixel[0])).sum();
        sum / image.pixels().len() as f64
    };
    let mut means = Vec::new();
    for (direct, accel, triangle_test) in [
        (Direct::Light, Accel::Bvh, TriangleTest::Watertight),
        (Direct::Photons, Accel::Brute, TriangleTest::Watertight),
        (Direct::Light, Accel::Bvh, TriangleTest::Havel),
    ] {
        let config = RenderConfig {
            direct,
            accel,
            triangle_test,
            ..square(8, 40_000)
        };
        let image = render(scene, 0, 4, config).image;
        means.push((format!("{direct:?}, {accel:?}, {triangle_test:?}"), mean(&image)));
    }
    let config = RenderConfig {
        direct: Direct::Photons,
        ..square(8, 40_000)
    };
    let mut twin = cpu::Renderer::new(&packed, &scene.cameras[0], config).expect("a renderer");
    for _ in 0..4 {
        twin.iterate().expect("an iteration");
    }
    means.push(("photons, CPU".to_owned(), mean(&twin.resolve().expect("a picture"))));
    means
}

/// Asserts that all pictures of a room show this radiance. The walls emit 1 to all sides; `build` adds objects, and the camera
/// looks down at the middle. False alarms: the noise is a third of the tolerance; a fault changes the light by a quarter or more.
#[track_caller]
fn assert_shows(expected: f64, what: &str, build: impl Fn(&mut Model)) {
    for turn in TURNS {
        let mut model = Model::new();
        let walls = model.black(1.0);
        model.room(walls, Vec3::NEG_ONE, Vec3::ONE);
        build(&mut model);
        model.camera(Vec3::new(0.1, 0.5, 0.2), Vec3::new(0.02, 0.0, 0.01), 0.2);
        model.file.add_parent(json!({"rotation": turn}));
        for (by, mean) in pictures(&model.scene()) {
            assert!(
                (mean - expected).abs() < 0.12 * expected,
                "{what}, turned by {turn:?}, {by}: {mean}, {expected} expected"
            );
        }
    }
}

/// A floor half as wide as the room, facing up or down.
fn floor(up: bool, scale: f32) -> [[Vec3; 3]; 2] {
    let triangles = parallelogram(Vec3::new(-0.5, 0.0, -0.5) * scale, Vec3::Z * scale, Vec3::X * scale);
    triangles.map(|[a, b, c]| if up { [a, b, c] } else { [a, c, b] })
}

/// Adds two objects, in reverse order if `reversed`.
fn add_in_order(model: &mut Model, mut faces: [(usize, [[Vec3; 3]; 2]); 2], reversed: bool) {
    if reversed {
        faces.reverse();
    }
    for (material, triangles) in faces {
        model.mesh(material, &triangles);
    }
}

#[test]
fn of_doubled_faces_a_ray_meets_the_one_that_looks_to_it_in_every_order() {
    for white_first in [true, false] {
        assert_shows(0.8, &format!("white first: {white_first}"), |model| {
            let (white, black) = (model.matte([0.8; 3], 0.0), model.black(0.0));
            add_in_order(
                model,
                [(white, floor(true, 1.0)), (black, floor(false, 1.0))],
                !white_first,
            );
        });
    }
    assert_shows(0.8, "both in one mesh", |model| {
        let white = model.matte([0.8; 3], 0.0);
        model.mesh(white, [floor(false, 1.0), floor(true, 1.0)].as_flattened());
    });
}

/// A label of the wall's colour that is half transparent, or a black one that is cut out. Whichever face a path hits, the
/// radiance is the same.
#[test]
fn a_label_shows_the_wall_that_it_lies_on_where_it_is_clear() {
    for (mode, albedo, alpha) in [("BLEND", 0.8, 0.5), ("MASK", 0.0, 0.3)] {
        for label_first in [true, false] {
            for scale in [1.0, 0.7] {
                let what = format!("{mode}, label first: {label_first}, {scale} of the wall's size");
                assert_shows(0.8, &what, |model| {
                    let (white, label) = (model.matte([0.8; 3], 0.0), model.matte([albedo; 3], 0.0));
                    model.file.set(&format!("/materials/{label}/alphaMode"), json!(mode));
                    let color = format!("/materials/{label}/pbrMetallicRoughness/baseColorFactor");
                    model.file.set(&color, json!([albedo, albedo, albedo, alpha]));
                    add_in_order(
                        model,
                        [(white, floor(true, 1.0)), (label, floor(true, scale))],
                        label_first,
                    );
                });
            }
        }
    }
}

#[test]
fn a_lamp_flush_with_a_ceiling_is_seen_in_every_order() {
    for lamp_first in [true, false] {
        assert_shows(3.0, &format!("lamp first: {lamp_first}"), |model| {
            let (white, lamp) = (model.matte([0.8; 3], 0.0), model.black(3.0));
            add_in_order(
                model,
                [(lamp, floor(true, 0.8)), (white, floor(true, 1.0))],
                !lamp_first,
            );
        });
    }
}

/// Both faces of one mesh emit, each to its side.
#[test]
fn a_doubled_lamp_is_seen_in_a_mirror_in_every_order() {
    for down_first in [true, false] {
        assert_shows(3.0, &format!("down first: {down_first}"), |model| {
            let (mirror, lamp) = (model.mirror(), model.black(3.0));
            model.mesh(mirror, &floor(true, 1.0));
            let mut sides =
                [false, true].map(|up| floor(up, 1.9).map(|triangle| triangle.map(|corner| corner + Vec3::Y * 0.8)));
            if !down_first {
                sides.reverse();
            }
            model.mesh(lamp, sides.as_flattened());
        });
    }
}

/// The back of a black poster in a window faces the camera.
#[test]
fn a_poster_in_a_window_is_not_seen_from_behind() {
    for poster_first in [true, false] {
        assert_shows(1.0, &format!("poster first: {poster_first}"), |model| {
            let (glass, black) = (model.glass(1.5), model.black(0.0));
            let volume = format!("/materials/{glass}/extensions/KHR_materials_volume");
            model.file.remove(&volume);
            add_in_order(
                model,
                [(glass, floor(true, 1.0)), (black, floor(false, 1.0))],
                poster_first,
            );
        });
    }
}

/// In uniform light of 1 a pane shows 1, except for the black wall behind it, so that only its reflection is visible: 4 % at
/// normal incidence for one pane, 7.7 % for two.
#[test]
fn a_doubled_pane_reflects_as_one_or_two_and_a_box_without_thickness_as_a_pane() {
    let boxes = [floor(true, 1.0), floor(false, 1.0)];
    for (what, thin, objects) in [
        (
            "two objects, back to back",
            true,
            vec![vec![floor(true, 1.0)], vec![floor(false, 1.0)]],
        ),
        (
            "two objects alike",
            true,
            vec![vec![floor(true, 1.0)], vec![floor(true, 1.0)]],
        ),
        ("one object", true, vec![boxes.to_vec()]),
        ("a box without thickness", false, vec![boxes.to_vec()]),
    ] {
        for turn in TURNS {
            let mut model = Model::new();
            let (bright, dark) = (model.black(10.0), model.black(0.0));
            let glass = model.glass(1.5);
            if thin {
                model
                    .file
                    .remove(&format!("/materials/{glass}/extensions/KHR_materials_volume"));
            }
            model.quad(bright, Vec3::new(-2.0, 1.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0);
            model.quad(dark, Vec3::new(-2.0, -1.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0);
            for object in &objects {
                model.mesh(glass, object.as_flattened());
            }
            model.camera(Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO, 0.1);
            model.file.add_parent(json!({"rotation": turn}));
            for (by, mean) in pictures(&model.scene()) {
                assert!(
                    (0.39..0.78).contains(&mean),
                    "{what}, turned by {turn:?}, {by}: {mean}, 0.4 to 0.77 expected"
                );
            }
        }
    }
}

/// A duplicate lamp, facing down or two-sided, lights the floor like one lamp. Compared with the scene with one lamp; false
/// alarms: a fault is a factor of two, the noise of the mean of 64 pixels is below a twentieth of that.
#[test]
fn a_doubled_lamp_lights_as_one() {
    let lit = |copies: usize, two_sided: bool, turned: bool| {
        let mut model = Model::new();
        let white = model.matte([0.8; 3], 0.0);
        model.mesh(white, &floor(true, 1.0));
        let shining = model.black(10.0);
        model
            .file
            .set(&format!("/materials/{shining}/doubleSided"), json!(two_sided));
        for copy in 0..copies {
            let up = turned && copy == 1;
            let place = |corner: Vec3| 0.2 * corner + Vec3::Y;
            model.mesh(shining, &floor(up, 1.0).map(|triangle| triangle.map(place)));
        }
        model.camera(Vec3::new(0.9, 0.6, 0.0), Vec3::ZERO, 0.2);
        pictures(&model.scene())
    };
    for (two_sided, turned) in [(false, false), (true, false), (true, true)] {
        let once = lit(1, two_sided, false);
        for ((by, twice), (_, once)) in lit(2, two_sided, turned).into_iter().zip(once) {
            assert!(
                (twice / once - 1.0).abs() < 0.1,
                "two-sided: {two_sided}, one turned: {turned}, {by}: {twice} with the lamp twice, {once} once"
            );
        }
    }
}
