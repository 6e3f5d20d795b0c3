//! Cases about light: values known in closed form, or from another renderer's picture.
//!
//! Tolerances are five standard deviations, measured over other seeds, plus the blur of the radius: a false alarm is rarer than 1
//! in 10⁶ for each value.

use ppm_vk::internals::film::read_exr;

use super::files::{Seen, assert_refused, folder, name, render, scenes};

/// Radiance in the middle of the picture, where a block hides everything else.
fn is_middle(x: f64, y: f64) -> bool {
    x.abs().max(y.abs()) < 0.35
}

/// Where no block hides the plate.
fn is_beside(x: f64, y: f64) -> bool {
    x.abs().max(y.abs()) > 0.75
}

fn all(_: f64, _: f64) -> bool {
    true
}

/// Ray-triangle tests and hierarchies: all must agree on coincident faces.
const WAYS: [&[&str]; 4] = [
    &[],
    &["--accel", "brute", "--triangle-test", "havel"],
    &["--backend", "cpu"],
    &["--backend", "cpu", "--triangle-test", "havel"],
];

/// The relative error that the first radius may cause.
const BIAS_OF_RADIUS: f64 = 0.01;

/// 100 cd at 2 m, reflectance 0.8.
const WHITE_FACE: f64 = 0.8 * 25.0 / std::f64::consts::PI;

#[test]
fn of_doubled_faces_the_one_in_front_is_seen_in_either_order() {
    let Some(folder) = folder("01") else { return };
    for scene in scenes(&folder, 4) {
        for way in WAYS {
            let sampled = render(&scene, 9, 4, 2000, way);
            // The pixel in the middle is so wide that the lamp is .04 % farther away at its edges.
            let middle = |x: f64, y: f64| x.abs().max(y.abs()) < 0.1;
            sampled.assert_mean(WHITE_FACE, 0.001 * WHITE_FACE, &format!("the middle, {way:?}"), middle);
            if way.is_empty() {
                let photons = render(&scene, 9, 4, 50_000, &["--direct", "photons"]);
                photons.assert_mean(
                    sampled.mean(all)[0],
                    BIAS_OF_RADIUS * WHITE_FACE + 5.0 * 0.015,
                    "by photons",
                    all,
                );
            }
        }
    }
}

/// The sun, or a light without a number, is missing, and everything else is correct.
#[test]
fn an_environment_with_invalid_radiance_gives_a_finite_picture_and_a_warning() {
    let Some(folder) = folder("04") else { return };
    let plain = folder.join("plain.gltf");
    for (file, expected) in [
        ("inf.exr", Some(0.5)),
        ("nan.exr", Some(0.5)),
        ("negative.exr", Some(0.5)),
        ("max-half.exr", None),
    ] {
        let picture = folder.join(file);
        let seen = render(&plain, 8, 32, 512, &["--environment", picture.to_str().expect("UTF-8")]);
        match expected {
            // Like the plain plate, and a pixel of the environment is dark.
            Some(expected) => seen.assert_mean(expected, 0.025 + 0.003, file, all),
            None => assert!(seen.mean(all)[0] > 1.0, "{file}: the sun is missing; {}", seen.said),
        }
        let is_said = seen
            .warnings()
            .iter()
            .any(|line| line.contains("3 values of the environment"));
        assert_eq!(is_said, expected.is_some(), "{file}: {}", seen.said);
    }
}

#[test]
fn an_emissive_dome_lights_the_plate_under_an_invisible_block() {
    let Some(folder) = folder("10") else { return };
    for scene in scenes(&folder, 8) {
        match &*name(&scene) {
            "no-dome-sun.gltf" => render(&scene, 16, 1, 500, &[]).assert_mean(0.5, 1e-4, "all", all),
            // Unlit surfaces still block light, and this one shuts out the sun.
            "unlit-dome-sun.gltf" => {
                let seen = render(&scene, 16, 1, 500, &[]);
                seen.assert_mean(0.0, 0.0, "all", all);
                assert!(seen.warnings()[0].contains("black"), "{}", seen.said);
            }
            _ => assert_half(&render(&scene, 16, 8, 20_000, &[]), 0.009, 0.004),
        }
    }
}

#[test]
fn the_sun_lights_the_plate_under_an_invisible_block_on_a_ground_of_any_size() {
    let Some(folder) = folder("21") else { return };
    for scene in scenes(&folder, 4) {
        // Beside the block there is no noise.
        assert_half(&render(&scene, 16, 8, 20_000, &[]), 0.005, 0.0);
    }
}

/// ½ in the middle and beside it, with these standard deviations.
#[track_caller]
fn assert_half(seen: &Seen, middle: f64, beside: f64) {
    seen.assert_mean(0.5, 5.0 * middle + BIAS_OF_RADIUS * 0.5, "the middle", is_middle);
    seen.assert_mean(0.5, 5.0 * beside + BIAS_OF_RADIUS * 0.5, "beside", is_beside);
    assert!(seen.warnings().is_empty(), "{}", seen.said);
}

#[test]
fn a_pane_reflects_as_one_and_two_panes_as_two() {
    // Of a wall of radiance 10, at normal incidence.
    let once = 0.04;
    let twice = once * (1.0 + 0.96f64.powi(2) / (1.0 - once * once));
    let solid = 2.0 * once / (1.0 + once);
    let Some(folder) = folder("22") else { return };
    for scene in scenes(&folder, 6) {
        let (expected, deviation) = match &*name(&scene) {
            "gap.gltf" => (twice, 0.008),
            "solid.gltf" => (solid, 0.008),
            // Coincident panes are one pane (docs/files.md).
            _ => (once, 0.0),
        };
        // Coincident panes have no noise with kernels; others need their samples, and have no other result to agree with. The CPU
        // renderer chooses a pane's reflection at random: 16,384 paths, of which four percent see the wall.
        for way in &WAYS[..if deviation == 0.0 { WAYS.len() } else { 1 }] {
            let seen = render(&scene, 16, 8, 2000, way);
            // Away from the middle the angle is up to 8°, where 0.1 % more is reflected.
            let by_chance = 10.0 * (once * (1.0 - once) / 16_384.0).sqrt();
            let deviation = if way.contains(&"cpu") { by_chance } else { deviation };
            let tolerance = 5.0 * deviation + 0.001 * 10.0 * expected;
            seen.assert_mean(10.0 * expected, tolerance, &format!("{way:?}"), all);
        }
    }
}

/// The references have a noise of .1 % of their mean. For the largest terrain only the mean is compared: its patch of sun differs
/// from that of the next smaller one, which shows the same.
#[test]
fn a_room_with_a_window_is_as_a_path_tracer_has_it_whatever_lies_outside() {
    let Some(folder) = folder("32") else { return };
    for scene in scenes(&folder, 3) {
        let reference = name(&scene).replace("terrain", "ref").replace(".gltf", ".exr");
        let reference = Seen::of(read_exr(&folder.join(&reference)).expect(&reference), &reference);
        let seen = render(&scene, 48, 8, 50_000, &[]);
        let assert_alike = |deviation: f64, place: &str, is_asked: fn(f64, f64) -> bool| {
            let expected = reference.mean(is_asked)[0];
            seen.assert_mean(expected, 5.0 * deviation + BIAS_OF_RADIUS * expected, place, is_asked);
        };
        assert_alike(0.0075, "all", all);
        if !name(&scene).contains("1000") {
            assert_alike(0.006, "the left half", |x, _| x < 0.0);
            assert_alike(0.008, "the right half", |x, _| x > 0.0);
        }
    }
}

#[test]
fn where_a_label_is_clear_the_wall_below_it_is_seen_in_either_order() {
    let Some(folder) = folder("33") else { return };
    for scene in scenes(&folder, 8) {
        for way in WAYS {
            let seen = render(&scene, 16, 1, 500, way);
            // The light has no noise.
            seen.assert_mean(0.5, 1e-4, &format!("{way:?}"), |x, _| x > 0.0);
            // A quarter of the label is black; also of the small one, which ends within the picture.
            if name(&scene).contains("small") {
                seen.assert_mean(0.0, 0.0, &format!("the label, {way:?}"), |x, _| x < -0.9);
            }
        }
    }
}

#[test]
fn glass_that_would_amplify_light_is_clamped_to_clear_glass_with_a_warning() {
    let Some(folder) = folder("faults") else { return };
    let clear = render(&folder.join("att-one.gltf"), 16, 2, 4000, &[]);
    assert!(clear.warnings().is_empty(), "{}", clear.said);
    for file in ["att-1p5.gltf", "att-5123.gltf"] {
        let cut = render(&folder.join(file), 16, 2, 4000, &[]);
        let warnings = cut.warnings();
        assert!(
            warnings.len() == 1 && warnings[0].contains("attenuationColor") && warnings[0].contains("cut"),
            "{file}: {}",
            cut.said
        );
        assert!(
            cut.image == clear.image,
            "{file}: the picture differs from that of the value 1, to which it is clamped"
        );
    }
}

#[test]
fn an_instanced_mesh_whose_triangles_all_vanish_is_refused() {
    let Some(folder) = folder("faults") else { return };
    for more in [&[][..], &["--backend", "cpu"], &["--accel", "brute"]] {
        assert_refused(&folder.join("shared-vanishes.gltf"), "no triangles", more);
    }
}
