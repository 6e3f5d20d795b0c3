//! Glass and mirrors in hard cases: from inside, at the critical angle, touching each other, and without end.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use ppm_vk::Warning;
use ppm_vk::internals::backend::Backend;
use ppm_vk::internals::config::{Direct, EmissionChoice, Estimator, RenderConfig};
use ppm_vk::internals::cpu;
use ppm_vk::internals::layout::{NO_OBJECT, Photon, Settings, VisiblePoint};
use ppm_vk::internals::packing::PackedScene;
use ppm_vk::internals::scene::Scene;
use ppm_vk::internals::stage::BufferId;
use serde_json::json;

use super::bench::{object, xyz};
use super::model::Model;
use super::sound::{render, square};

const IOR: f32 = 1.5;

/// A room, 2 wide, whose walls emit 1 and reflect nothing: objects without absorption are invisible in it.
fn shining_room() -> Model {
    let mut model = Model::new();
    let walls = model.black(1.0);
    model.room(walls, Vec3::NEG_ONE, Vec3::ONE);
    model
}

/// Directions of the rays through the pixels' centres in f64, by pixel.
fn direction(settings: &Settings, x: f64, y: f64) -> DVec3 {
    let film = |at: f64, side: u32| at / f64::from(side) * 2.0 - 1.0;
    let [width, height] = settings.resolution;
    (xyz(settings.camera_forward) + film(x, width) * xyz(settings.camera_right)
        - film(y, height) * xyz(settings.camera_up))
    .normalize()
}

/// Radiance over n² is constant across a boundary, so that inside glass it is n² times that outside. In a box, the absolute
/// components of a ray's direction are constant: if all are below the cosine of the critical angle, the ray is reflected for
/// ever. There is no such light; the renderer traces these paths to their bounce limit and reports it.
#[test]
fn a_camera_inside_a_glass_box_sees_n_squared_times_the_light_outside_or_total_reflection_without_end() {
    let mut model = shining_room();
    let glass = model.glass(IOR);
    model.block(glass, Vec3::splat(-0.5), Vec3::splat(0.5));
    model.camera(Vec3::new(0.05, 0.03, 0.1), Vec3::new(0.4, 0.3, 0.5), 1.8);
    let iterations = 4;
    let config = square(64, 1000);
    let max_depth = config.max_depth;
    let mut rendered = render(&model.scene(), 0, iterations, config);
    let settings: Settings = rendered.download::<Settings>(BufferId::Settings)[0];
    let critical = (1.0 - f64::from(IOR).powi(-2)).sqrt();
    let (mut free, mut trapped) = (0, 0);
    for (index, pixel) in rendered.image.pixels().iter().enumerate() {
        let (x, y) = ((index % 64) as f64, (index / 64) as f64);
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        let steepest = corners.map(|(dx, dy)| direction(&settings, x + dx, y + dy).abs().max_element());
        let expected = if steepest.iter().all(|cosine| *cosine > critical + 0.02) {
            free += 1;
            IOR * IOR
        } else if steepest.iter().all(|cosine| *cosine < critical - 1e-3) {
            trapped += 1;
            0.0
        } else {
            continue;
        };
        assert!(
            (pixel[0] - expected).abs() < 1e-4,
            "pixel {x}, {y}: {pixel:?}, {expected} expected"
        );
    }
    println!("{free} pixels see out, {trapped} don't");
    assert!(free > 1000 && trapped > 200, "{free} pixels see out, {trapped} don't");
    let truncated = rendered.counters.truncated_paths;
    assert!(
        truncated >= trapped * u64::from(iterations),
        "{truncated} paths are reported as cut"
    );
    let warnings = Warning::of(&rendered.counters, rendered.renderer.emitted(), max_depth);
    let is_told = |warning: &Warning| matches!(warning, Warning::Truncated { .. }) && !warning.is_slight();
    assert!(warnings.iter().any(is_told), "{warnings:?}");
}

/// Photons of a small lamp in the middle of a glass ball, and the lamp's flux. Reflections of the ball return to the lamp, which
/// absorbs them like the walls. So each path ends once, with its whole flux.
fn lamp_in_a_glass_ball(smooth: bool) -> (Vec<Photon>, f64) {
    let mut model = Model::new();
    let walls = model.black(0.0);
    model.room(walls, Vec3::NEG_ONE, Vec3::ONE);
    let lamp = model.black(100.0);
    model.sphere(lamp, Vec3::ZERO, 0.01, false);
    let glass = model.glass(IOR);
    model.sphere(glass, Vec3::ZERO, 0.4, smooth);
    model.camera(Vec3::Z * 0.9, Vec3::ZERO, 1.0);
    let scene = model.scene();
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.05),
        drop_unwanted: false,
        emission: EmissionChoice::Power,
        ..square(16, 20_000)
    };
    let paths = config.photons;
    let photons = render(&scene, 0, 1, config).photons();
    assert_eq!(photons.len(), paths as usize, "photons, one a path");
    (photons, PI * 100.0 * scene.object_area(LAMP))
}

/// The object of the lamp in [`lamp_in_a_glass_ball`], after the six walls.
const LAMP: u32 = 6;

fn mean_flux(photons: &[Photon]) -> f64 {
    let flux = |photon: &Photon| f64::from(photon.flux[0]);
    photons.iter().map(flux).sum::<f64>() / photons.len() as f64
}

/// The ball is made of plane facets: interpolated shading normals give a photon's flux the factor of the adjoint BSDF, so that
/// the total is conserved only in the mean.
#[test]
fn all_light_of_a_lamp_inside_a_glass_ball_of_facets_arrives() {
    let (photons, emitted) = lamp_in_a_glass_ball(false);
    let arrived = mean_flux(&photons);
    assert!((arrived / emitted - 1.0).abs() < 1e-5, "{arrived} of {emitted} arrives");
}

/// At normal incidence 4 % is reflected, nearly all of it back to the lamp: a binomial number, with 6 of its standard deviations.
#[test]
fn light_that_a_smooth_glass_ball_reflects_returns_to_the_lamp_in_its_middle() {
    let (photons, emitted) = lamp_in_a_glass_ball(true);
    let arrived = mean_flux(&photons);
    assert!((arrived / emitted - 1.0).abs() < 1e-3, "{arrived} of {emitted} arrives");
    let returned = |photon: &&Photon| object(photon.object) == Some(LAMP);
    let paths = photons.len() as f64;
    let back = photons.iter().filter(returned).count() as f64 / paths;
    let expected = 0.04;
    let deviation = f64::sqrt(expected * (1.0 - expected) / paths);
    println!("{back} of the light returns to the lamp, {expected} ± {deviation:.1e} expected");
    assert!(
        back < expected + 6.0 * deviation,
        "{back} of the light returns to the lamp"
    );
    assert!(back > 0.9 * expected, "{back} of the light returns to the lamp");
}

/// Fresnel reflectance for unpolarised light from inside glass, by sin² of the angle outside.
fn reflectance(sin2_t: f64) -> f64 {
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let n = f64::from(IOR);
    let (cos_i, cos_t) = ((1.0 - sin2_t / (n * n)).sqrt(), (1.0 - sin2_t).sqrt());
    let perpendicular = (n * cos_i - cos_t) / (n * cos_i + cos_t);
    let parallel = (cos_i - n * cos_t) / (cos_i + n * cos_t);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

/// At the critical angle reflectance has an infinite slope. The device's must be that of a sin² within the precision of f32:
/// 2.25 · (1 − cos²) for a cosine with 3 rounding errors.
#[test]
fn reflectance_at_the_critical_angle_is_fresnels_to_within_rounding_of_the_angle() {
    const ROUNDING: f64 = 1e-6;
    let critical = (1.0 / IOR).asin();
    for (fov, least_of_each) in [(1e-4, 400), (0.1, 1000)] {
        let mut model = Model::new();
        let walls = model.matte([1.0; 3], 1.0);
        model.room(walls, Vec3::NEG_ONE, Vec3::ONE);
        let glass = model.glass(IOR);
        model.quad(glass, Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
        // Behind the quad: inside the glass.
        model.camera(Vec3::Z * -0.5, Vec3::X * (0.5 * critical.tan()), fov);
        let config = RenderConfig {
            estimator: Estimator::Ppm,
            ..square(64, 1000)
        };
        let mut rendered = render(&model.scene(), 0, 1, config);
        let settings: Settings = rendered.download::<Settings>(BufferId::Settings)[0];
        let points: Vec<VisiblePoint> = rendered.download(BufferId::VisiblePoints);
        let (mut total, mut partial) = (0, 0);
        for (pixel_slot, points) in (0..).zip(points.chunks(settings.slots_per_pixel as usize)) {
            let [x, y] = ppm_vk::internals::config::pixel_of(settings.resolution, pixel_slot)
                .expect("whole tiles")
                .map(f64::from);
            let cos_i = direction(&settings, x + 0.5, y + 0.5).z;
            let sin2_t = f64::from(IOR * IOR) * (1.0 - cos_i * cos_i);
            let throughput = |point: &VisiblePoint| f64::from(point.weight[0]) * PI;
            let seen = points.iter().filter(|point| point.object != NO_OBJECT).count();
            let found = if seen == 2 {
                partial += 1;
                // The refracted ray's radiance counts n² times inside.
                let refracted = throughput(&points[0]) / f64::from(IOR * IOR);
                let reflected = throughput(&points[1]);
                assert!((refracted + reflected - 1.0).abs() < 1e-6, "{refracted} + {reflected}");
                reflected
            } else {
                total += 1;
                assert_eq!(seen, 1, "pixel {x}, {y}: visible points");
                throughput(&points[0])
            };
            let (low, high) = (reflectance(sin2_t - ROUNDING), reflectance(sin2_t + ROUNDING));
            assert!(
                low - 1e-6 <= found && found <= high + 1e-6,
                "pixel {x}, {y}, sin² {sin2_t}: reflectance {found}, {low} to {high} expected"
            );
        }
        println!("{partial} pixels below the critical angle, {total} above");
        assert!(
            partial >= least_of_each && total >= least_of_each,
            "{partial} below, {total} above"
        );
    }
}

/// Two blocks of glass side by side, seen at an angle, and rotated, so that the coordinates use all their bits.
fn two_blocks(iors: [f32; 2], gap: f32) -> Scene {
    let mut model = shining_room();
    let [left, right] = iors.map(|ior| model.glass(ior));
    model.block(left, Vec3::new(-0.5, -0.4, -0.4), Vec3::new(0.1, 0.4, 0.4));
    model.block(right, Vec3::new(0.1 + gap, -0.5, -0.3), Vec3::new(0.5, 0.4, 0.5));
    model.camera(Vec3::new(-0.9, 0.3, 0.6), Vec3::ZERO, 0.6);
    model
        .file
        .add_parent(json!({"rotation": [0.1825742, 0.3651484, 0.5477226, 0.7302967]}));
    model.scene()
}

/// The blocks' faces may be only a few ray offsets apart, or touch in a part of their area.
#[test]
fn glass_beside_glass_of_any_index_is_invisible_in_uniform_light_with_a_gap_or_without() {
    for iors in [[1.5, 1.5], [1.5, 1.2], [1.2, 2.0]] {
        for gap in [1e-3, 1e-5, 0.0] {
            let scene = two_blocks(iors, gap);
            let config = square(48, 1000);
            let on_device = render(&scene, 0, 2, config.clone()).image;
            let packed = PackedScene::new(&scene).expect("packed scene");
            let mut twin = cpu::Renderer::new(&packed, &scene.cameras[0], config).expect("renderer");
            twin.iterate().expect("iteration");
            for (image, by) in [(on_device, "device"), (twin.resolve().expect("picture"), "CPU")] {
                let wrong = image.pixels().iter().filter(|pixel| (pixel[0] - 1.0).abs() > 1e-4);
                assert_eq!(wrong.count(), 0, "{iors:?}, gap {gap}, {by}: pixels that aren't 1");
            }
        }
    }
}

/// A block of glass lies on an emissive wall. From inside, straight up, its other face shows 4 % of the wall's light as a
/// reflection and n² times the other 96 % of the light outside, whichever of the two coincident faces a ray hits first.
#[test]
fn a_shining_wall_that_glass_lies_on_is_seen_mirrored_in_it() {
    let mut model = shining_room();
    let glass = model.glass(IOR);
    model.block(glass, Vec3::new(-0.5, -0.5, -1.0), Vec3::new(0.5, 0.5, 0.0));
    model.camera(Vec3::new(0.05, 0.03, -0.5), Vec3::new(0.05, 0.03, 0.0), 0.01);
    model
        .file
        .add_parent(json!({"rotation": [0.1825742, 0.3651484, 0.5477226, 0.7302967]}));
    let scene = model.scene();
    let config = square(48, 1000);
    let on_device = render(&scene, 0, 2, config.clone()).image;
    let packed = PackedScene::new(&scene).expect("packed scene");
    let mut twin = cpu::Renderer::new(&packed, &scene.cameras[0], config).expect("renderer");
    twin.iterate().expect("iteration");
    let expected = 0.96 * IOR * IOR + 0.04;
    let wrong = on_device
        .pixels()
        .iter()
        .filter(|pixel| (pixel[0] - expected).abs() > 1e-4);
    assert_eq!(wrong.count(), 0, "pixels that aren't {expected}");
    // Paths are reflected or transmitted at random: 2,304 paths, each with a standard deviation of √(0.04 · 0.96) times the
    // difference. Six standard deviations of the mean: a correct program fails once in 5·10⁸ runs.
    let image = twin.resolve().expect("picture");
    let mean = image.pixels().iter().map(|pixel| pixel[0]).sum::<f32>() / image.pixels().len() as f32;
    let deviation = (0.04f32 * 0.96 / 2304.0).sqrt() * (IOR * IOR - 1.0);
    assert!((mean - expected).abs() < 6.0 * deviation, "CPU: {mean}, not {expected}");
    let is_either = |value: f32| (value - 1.0).abs() < 1e-4 || (value - IOR * IOR).abs() < 1e-4;
    assert!(
        image.pixels().iter().all(|pixel| is_either(pixel[0])),
        "CPU: pixels that match neither case"
    );
}

/// A room of perfect mirrors: a path ends at the lamp or at the bounce limit. Light that reaches neither the picture nor the lamp
/// is counted.
#[test]
fn paths_in_a_room_of_mirrors_end_at_the_lamp_or_are_counted() {
    let mut model = Model::new();
    let mirror = model.mirror();
    model.room(mirror, Vec3::NEG_ONE, Vec3::ONE);
    let lamp = model.black(2.0);
    model.sphere(lamp, Vec3::new(0.3, -0.2, 0.1), 0.1, false);
    model.camera(Vec3::new(-0.5, 0.4, 0.7), Vec3::ZERO, 1.0);
    let config = RenderConfig {
        direct: Direct::Photons,
        radius: Some(0.05),
        estimator: Estimator::Ppm,
        ..square(32, 5000)
    };
    let (paths, max_depth) = (u64::from(config.photons), config.max_depth);
    let rendered = render(&model.scene(), 0, 1, config);
    let pixels = rendered.image.pixels();
    let seen = |radiance: f32| pixels.iter().filter(|pixel| (pixel[0] - radiance).abs() < 1e-5).count() as u64;
    let (lit, dark) = (seen(2.0), seen(0.0));
    let counters = rendered.counters;
    println!("{lit} pixels see the lamp, {dark} don't; {counters:?}");
    assert_eq!(lit + dark, 32 * 32, "pixels have the lamp's radiance or none");
    assert!(dark > 100 && lit > 100, "{dark} dark, {lit} lit pixels");
    assert_eq!(counters.truncated_paths, dark + (paths - counters.photons_stored));
    let emitted = rendered.renderer.emitted();
    let expected = Warning::Truncated {
        paths: counters.truncated_paths,
        emitted,
        max_depth,
    };
    assert_eq!(Warning::of(&counters, emitted, max_depth), [expected]);
}
