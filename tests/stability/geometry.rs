//! Triangles that must not break the loader, the hierarchy or the renderer.

use std::f64::consts::PI;

use glam::Vec3;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, EmissionChoice, RenderConfig};

use super::model::{Model, parallelogram};
use super::sound::{assert_mean, render, square};

const ALBEDO: f32 = 0.5;
/// Field of view that covers a tenth of the patch.
const WIDE: f32 = 0.1;

/// A flat patch of albedo ½ around the origin, in the plane z = 0 of a room whose walls emit 1 and reflect nothing. Both its
/// sides have radiance ½ where nothing covers it.
fn patch(add: impl FnOnce(&mut Model, usize), fov: f32) -> Model {
    let mut model = Model::new();
    let walls = model.black(1.0);
    model.room(walls, Vec3::NEG_ONE, Vec3::ONE);
    let matte = model.matte([ALBEDO; 3], 0.0);
    add(&mut model, matte);
    let target = Vec3::new(0.03, 0.02, 0.0);
    model.camera(target + Vec3::Z * 0.9, target, fov);
    model
}

fn corners(half: f32) -> [Vec3; 3] {
    [
        Vec3::new(-half, -half, 0.0),
        Vec3::X * (2.0 * half),
        Vec3::Y * (2.0 * half),
    ]
}

/// Checks the visible radiance, by light samples and by photons.
#[track_caller]
fn assert_patch_is_right(what: &str, model: &Model) {
    let scene = model.file.scene();
    // Each pixel draws its own light samples.
    let image = render(&scene, 0, 4, square(48, 1000)).image;
    let samples: Vec<f64> = image.pixels().iter().map(|pixel| pixel[0].into()).collect();
    assert_mean(&format!("{what}, by shadow rays"), &samples, ALBEDO.into(), 1e-6);

    // A path contributes one photon or none to the disc of radius R of a pixel, all of the same power: the radiance is a binomial
    // number. Beyond 6 standard deviations: probability 2 in 10⁹.
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.2),
        emission: EmissionChoice::Power,
        ..square(8, 200_000)
    };
    let paths = f64::from(config.photons);
    let mut rendered = render(&scene, 0, 1, config);
    let radius = f64::from(rendered.renderer.radius());
    let power = f64::from(rendered.photons()[0].flux[0]);
    let of_one = f64::from(ALBEDO) * power / (PI * PI * radius * radius);
    let deviation = (f64::from(ALBEDO) * of_one / paths).sqrt();
    let seen = f64::from(rendered.image.pixels()[0][0]);
    println!("{what}, by photons: {seen} ± {deviation:.1e}, {ALBEDO} expected");
    assert!(
        (seen - f64::from(ALBEDO)).abs() < 6.0 * deviation,
        "{what}, by photons: {seen} ± {deviation}, {ALBEDO} expected"
    );
}

#[test]
fn a_patch_of_slivers_and_needles_of_aspect_a_million_is_as_bright_as_any() {
    const WIDTH: f32 = 5e-7;
    // 400 slivers of two needles each along y = 0.02, and the rest of the patch; the camera sees little else.
    let slivers = |model: &mut Model, matte| {
        let [corner, a, b] = corners(0.5);
        let low = 0.02 - 200.0 * WIDTH;
        let high = 0.02 + 200.0 * WIDTH;
        let mut triangles = Vec::new();
        triangles.extend(parallelogram(corner, a, Vec3::Y * (low - corner.y)));
        triangles.extend(parallelogram(
            Vec3::new(corner.x, high, 0.0),
            a,
            Vec3::Y * (corner.y + b.y - high),
        ));
        for i in 0..400 {
            let y = |i: i32| 0.02 + WIDTH * (i - 200) as f32;
            let start = Vec3::new(corner.x, y(i), 0.0);
            triangles.extend(parallelogram(start, a, Vec3::Y * (y(i + 1) - y(i))));
        }
        model.mesh(matte, &triangles);
    };
    assert_patch_is_right("slivers", &patch(slivers, 2.0 * 200.0 * WIDTH));
}

#[test]
fn triangles_of_zero_area_are_counted_and_reported_and_change_nothing() {
    let with_degenerate = |model: &mut Model, matte| {
        let [corner, a, b] = corners(0.5);
        let mut triangles = parallelogram(corner, a, b).to_vec();
        triangles.push([Vec3::ZERO; 3]);
        triangles.push([Vec3::ZERO, Vec3::X, Vec3::X]);
        triangles.push([Vec3::ZERO, Vec3::X * 0.25, Vec3::X * 0.75]);
        model.mesh(matte, &triangles);
    };
    let model = patch(with_degenerate, WIDE);
    let scene = model.file.assert_warns(&["dropped 3 triangles"]);
    assert_eq!((scene.dropped_triangles, scene.triangles.len()), (3, 14));
    assert_patch_is_right("with triangles of zero area", &model);
}

#[test]
fn a_scene_of_degenerate_triangles_alone_is_refused() {
    let mut model = Model::new();
    let matte = model.matte([ALBEDO; 3], 1.0);
    model.mesh(matte, &[[Vec3::X; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0]]);
    model.file.assert_fails(&["no triangles", "zero area"]);
}

#[test]
fn two_faces_in_one_place_are_as_bright_as_one() {
    let [corner, a, b] = corners(0.5);
    let one = |model: &mut Model, matte| model.quad(matte, corner, a, b);
    let alike = |model: &mut Model, matte| (0..2).for_each(|_| model.quad(matte, corner, a, b));
    assert_patch_is_right("one face", &patch(one, WIDE));
    assert_patch_is_right("two faces alike", &patch(alike, WIDE));
}

/// Inside a block there are no photons; on both sides of a sheet there are.
#[test]
fn an_object_on_a_patch_hides_the_area_under_it_and_no_more() {
    let [corner, a, b] = corners(0.5);
    // The block emits like the walls, so that the light in the room stays uniform.
    let with_sheet = |model: &mut Model, matte| {
        model.quad(matte, corner, a, b);
        let sheet = model.black(1.0);
        model
            .file
            .set(&format!("/materials/{sheet}/doubleSided"), serde_json::json!(true));
        model.quad(sheet, Vec3::new(0.08, -0.4, 0.0), Vec3::Y * 0.8, Vec3::Z * 0.5);
    };
    let with_block = |model: &mut Model, matte| {
        model.quad(matte, corner, a, b);
        let block = model.black(1.0);
        model.block(block, Vec3::new(0.08, -0.4, 0.0), Vec3::new(0.4, 0.4, 0.5));
    };
    assert_patch_is_right("beside a sheet", &patch(with_sheet, WIDE));
    assert_patch_is_right("beside a block", &patch(with_block, WIDE));
}

#[test]
fn two_thousand_triangles_in_one_place_fit_into_the_hierarchy() {
    let [corner, a, b] = corners(0.5);
    let pile = |model: &mut Model, matte| {
        let triangles: Vec<_> = (0..1000).flat_map(|_| parallelogram(corner, a, b)).collect();
        model.mesh(matte, &triangles);
    };
    assert_patch_is_right("a thousand faces alike", &patch(pile, WIDE));
}

#[test]
fn a_mesh_and_a_scene_of_one_triangle_are_rendered() {
    let triangle = [
        Vec3::new(-0.9, -0.8, 0.0),
        Vec3::new(0.9, -0.8, 0.0),
        Vec3::new(0.0, 0.9, 0.0),
    ];
    let one = |model: &mut Model, matte| {
        model.mesh(matte, &[triangle]);
    };
    assert_patch_is_right("one triangle", &patch(one, WIDE));

    let mut model = Model::new();
    let lamp = model.matte([ALBEDO; 3], 3.0);
    model.mesh(lamp, &[triangle]);
    model.camera(Vec3::Z, Vec3::ZERO, WIDE);
    let image = render(&model.scene(), 0, 2, square(8, 1000)).image;
    assert!(
        image.pixels().iter().all(|pixel| *pixel == [3.0; 3]),
        "{:?}",
        image.pixels()[0]
    );
}
