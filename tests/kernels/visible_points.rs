//! The stage `camera`: end points of paths that go straight to the visible surface, and their BSDFs.
//!
//! Tolerances: the kernels compute in f32. Its rounding (6e-8 of coordinates within ±1) is multiplied a few times by the ray's
//! length and slope.

use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::cpu::{self, Receivers};
use ppm_vk::internals::layout::{FOLLOWED_ALPHA, GLOSSY_SURFACE};
use ppm_vk::internals::random::CameraTurn;
use ppm_vk::internals::stage::BufferId;

use super::agreement::{Agreement, relative_difference};
use super::bench::{Bench, object, small, xyz};

/// The last camera path of a pixel in the first iteration, whose visible points the buffers hold.
fn last_turn(config: &RenderConfig) -> CameraTurn {
    let first = CameraTurn::that_gathers(config, 0);
    first.others().last().unwrap_or(first)
}

/// Angle between two directions, one of them encoded, rad.
fn angle(code: u32, direction: glam::DVec3) -> f64 {
    cpu::decode_direction(code).angle_between(direction)
}

fn assert_camera_agrees(name: &str, config: RenderConfig, least_seen: usize, least_compared: usize) {
    let mut bench = Bench::new(name, config);
    let seen = bench.seen();
    let footprints: Vec<f32> = bench.download(BufferId::Footprints);
    let plain = bench.plain();
    let paths = plain.trace_camera_paths(last_turn(&bench.config));
    let settings = bench.settings;
    let [width, _] = settings.resolution.map(|side| side as usize);
    let radii2 = vec![1.0; seen.points.len()];
    let gathering = seen.with(&radii2);
    // The same ray reaches the same point.
    let is_straight = |position: glam::DVec3, footprint: f64| {
        let way = position.distance(xyz(settings.camera_position));
        (footprint / (way * f64::from(settings.pixel_spread)) - 1.0).abs() < 1e-4
    };
    let (mut places, mut scattered) = (Agreement::default(), Agreement::default());
    for (slot, found) in seen.points.iter().enumerate() {
        let Some([x, y]) = ppm_vk::internals::config::pixel_of(settings.resolution, slot as u32) else {
            continue;
        };
        let Some(expected) = paths[y as usize * width + x as usize].points.first() else {
            continue;
        };
        let position = xyz(found.position);
        let both = object(found.object).is_some()
            && is_straight(position, footprints[slot].into())
            && is_straight(expected.surface.position, expected.footprint);
        if !both {
            continue;
        }
        let normals = expected.bsdf.normals();
        let distance = position.distance(expected.surface.position);
        let material = &expected.surface.material;
        // A step of the octahedral code changes a direction by at most 1.3e-4 rad. A clear coat has its own normal.
        let mut turned = angle(found.geometric_normal, normals.geometric);
        if material.coat == 0.0 {
            turned = turned.max(angle(found.shading_normal, normals.shading));
        }
        let same = object(found.object) == Some(expected.surface.object) && distance < 2e-5 && turned < 1.5e-4;
        places.note(same, || {
            format!("slot {slot}: {found:?} instead of {expected:?}, {distance:e} apart")
        });
        // Without random choices both gather everything that the surface scatters. (Paths also pass straight through a thin
        // wall.)
        if !same || expected.throughput != glam::DVec3::ONE || material.coat > 0.0 {
            continue;
        }
        for l in [
            normals.geometric,
            2.0 * expected.viewer.dot(normals.shading) * normals.shading - expected.viewer,
        ] {
            let cosine = l.dot(normals.shading);
            if cosine < 0.05 || l.dot(normals.geometric) < 0.05 {
                continue;
            }
            let response = xyz(found.weight) * gathering.response(slot, l);
            let wanted = expected.bsdf.evaluate(cpu::Width::Wide, expected.viewer, l) / cosine;
            // Reflectances and α are stored as f16, directions in 32 bits.
            let difference = (0..3)
                .map(|channel| relative_difference(response[channel], wanted[channel]))
                .fold(0.0, f64::max);
            scattered.note(difference < 5e-3, || {
                format!("slot {slot}: {response} instead of {wanted}, {material:?}")
            });
        }
    }
    places.assert(&format!("visible points of {name}"), 0.999, least_seen);
    scattered.assert(
        &format!("what is gathered at visible points of {name}"),
        0.995,
        least_compared,
    );
}

#[test]
fn straight_paths_end_at_the_cpus_points_and_gather_the_same() {
    for (name, least_seen, least_compared) in [
        ("cornell", 3500, 3000),
        ("cornell-spheres", 2000, 2000),
        ("glossy", 2000, 1000),
        ("textures", 1000, 500),
        ("instances", 2000, 1000),
        ("coats", 1000, 0),
    ] {
        assert_camera_agrees(name, small(), least_seen, least_compared);
    }
}

/// In mirrors too: what sets a disc's size is the whole way from the camera.
#[test]
fn footprints_grow_with_the_way_over_mirrors() {
    let mut bench = Bench::new("cornell-spheres", small());
    let seen = bench.seen();
    let found: Vec<f32> = bench.download(BufferId::Footprints);
    let paths = bench.plain().trace_camera_paths(last_turn(&bench.config));
    let settings = bench.settings;
    let [width, _] = settings.resolution.map(|side| side as usize);
    let mut footprints = Agreement::default();
    for (slot, point) in seen.points.iter().enumerate() {
        let pixel = ppm_vk::internals::config::pixel_of(settings.resolution, slot as u32);
        let [x, y] = pixel.expect("whole tiles").map(|at| at as usize);
        let (position, Some(expected)) = (xyz(point.position), paths[y * width + x].points.first()) else {
            continue;
        };
        let straight = position.distance(xyz(settings.camera_position)) * f64::from(settings.pixel_spread);
        // The same place by a detour.
        if position.distance(expected.surface.position) < 1e-4 && expected.footprint > 1.01 * straight {
            let difference = relative_difference(found[slot].into(), expected.footprint);
            footprints.note(difference < 1e-4, || {
                format!("slot {slot}: {} instead of {}", found[slot], expected.footprint)
            });
        }
    }
    footprints.assert("footprints of what mirrors show", 1.0, 150);
}

/// The bounce limit ends the reflection. The CPU's paths end at the base at random, the kernels' always do.
#[test]
fn the_bounce_limit_leaves_the_base_of_narrow_surfaces() {
    let config = RenderConfig {
        max_depth: 1,
        ..small()
    };
    let mut bench = Bench::new("glossy", config);
    let seen = bench.seen();
    let paths = bench.plain().trace_camera_paths(last_turn(&bench.config));
    let [width, _] = bench.config.resolution.map(|side| side as usize);
    let mut bases = Agreement::default();
    for (slot, found) in seen.points.iter().enumerate() {
        let pixel = ppm_vk::internals::config::pixel_of(bench.config.resolution, slot as u32);
        let [x, y] = pixel.expect("whole tiles").map(|at| at as usize);
        let Some(expected) = paths[y * width + x].points.first() else {
            continue;
        };
        let surface = &expected.surface;
        let is_narrow = f64::from(surface.material.roughness).powi(2) < FOLLOWED_ALPHA;
        if surface.material.surface == GLOSSY_SURFACE && is_narrow {
            let same =
                object(found.object) == Some(surface.object) && xyz(found.position).distance(surface.position) < 2e-5;
            bases.note(same, || format!("slot {slot}: {found:?} instead of {expected:?}"));
        }
    }
    bases.assert("bases of narrow surfaces", 0.999, 100);
}

#[test]
fn a_picture_that_cuts_its_tiles_fills_the_same_slots() {
    let config = RenderConfig {
        resolution: [51, 29],
        ..small()
    };
    assert_camera_agrees("cornell", config, 700, 700);
}
